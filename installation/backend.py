"""PEP 517: setuptools, with ``ziglang`` among the requirements where there is no compiler."""

import sys

from compilers import ZIG, system_compiler
from setuptools import build_meta
from setuptools.build_meta import (
    build_editable,
    build_sdist,
    build_wheel,
    get_requires_for_build_sdist,
    prepare_metadata_for_build_editable,
    prepare_metadata_for_build_wheel,
)

__all__ = [
    "build_editable",
    "build_sdist",
    "build_wheel",
    "get_requires_for_build_editable",
    "get_requires_for_build_sdist",
    "get_requires_for_build_wheel",
    "prepare_metadata_for_build_editable",
    "prepare_metadata_for_build_wheel",
]
# setuptools leaves the script that runs, by this name, out of the wheel
sys.argv[0] = "setup.py"
Settings = dict[str, str | list[str] | None] | None


def get_requires_for_build_wheel(config_settings: Settings = None) -> list[str]:
    """Return what pip installs for a wheel's build."""
    return [*build_meta.get_requires_for_build_wheel(config_settings), *missing_compiler()]


def get_requires_for_build_editable(config_settings: Settings = None) -> list[str]:
    """Return what pip installs for an editable installation's build."""
    return [*build_meta.get_requires_for_build_editable(config_settings), *missing_compiler()]


def missing_compiler() -> list[str]:
    """Return the requirement of a compiler where the system has none."""
    return [] if system_compiler() else [ZIG]
