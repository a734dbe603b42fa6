"""How a page or a result came about: the command, the versions and the commit of the code."""

import subprocess
from collections.abc import Iterable
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path

from .. import __version__

_ROOT = Path(__file__).resolve().parent.parent
# packages behind a result
_PACKAGES = (
    "stable-baselines3",
    "sb3-contrib",
    "torch",
    "numpy",
    "scipy",
    "mujoco",
    "gymnasium",
)


def package_versions() -> dict[str, str]:
    """Return the versions of the installed packages behind a result."""
    versions = {}
    for name in _PACKAGES:
        with suppress(metadata.PackageNotFoundError):
            versions[name] = metadata.version(name)
    return versions


@cache
def commit(root: Path = _ROOT) -> str | None:
    """Return the short hash of the checkout's commit, with ``-dirty`` where code differs; None
    where the package is no checkout. Pages are no code: one is made after the other.

    A process asks once, and long runs ask before they begin: a commit made meanwhile is not the
    running code.

    Args:
        root: the checkout; default: this package's folder.
    """
    if not (root / ".git").exists():  # an installed package may lie inside another's checkout
        return None
    try:
        name = git(root, "rev-parse", "--short", "HEAD")
        changed = git(root, "diff", "--name-only", "HEAD", "--", ".", ":!docs", ":!*.md")
    except (OSError, subprocess.SubprocessError):
        return None
    return f"{name}-dirty" if changed else name


def git(root: Path, *words: str) -> str:
    """Return the output of a git command in a checkout, without taking a lock.

    Raises:
        OSError: there is no git.
        subprocess.SubprocessError: the command failed, or took longer than 30 s.
    """
    done = subprocess.run(
        ["git", "--no-optional-locks", *words],
        cwd=root,
        capture_output=True,
        text=True,
        check=True,
        timeout=30,
    )
    return done.stdout.strip()


def made_by(command: str, commits: Iterable[str | None], version: str = __version__) -> str:
    """Return the line of a page with its command, version and commits.

    Args:
        command: the whole command line.
        commits: the commits of the code behind the page's results, as ``commit`` returned them.
        version: version of the code; default: this one's.
    """
    stated = list(dict.fromkeys(name for name in commits if name))
    words = f", commit{'s' * (len(stated) > 1)} {', '.join(stated)}" if stated else ""
    return f"Made by `{command}`, windwrench {version}{words}."
