"""Import lines of the first version still run: those of its README, pages and examples, and the
public names of every module that its reference listed.
"""

import importlib
import importlib.util
import sys
import warnings
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from windwrench.runtime import errors
from windwrench.runtime.moved_modules import MOVED

LINES = (Path(__file__).parent / "old_imports.txt").read_text(encoding="utf-8").splitlines()
OPTIONAL = {"vec_env": "stable_baselines3", "train import": "torch", "imitate": "torch"}


@pytest.mark.parametrize("line", LINES)
def test_an_import_line_of_the_first_version_runs(line):
    for word, library in OPTIONAL.items():
        if word in line and importlib.util.find_spec(library) is None:
            pytest.skip(f"{library} is not installed: pip install 'windwrench[rl]'")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        exec(line, {})


def test_an_old_path_says_where_its_module_is_now():
    sys.modules.pop("windwrench.dynamics.errors", None)
    with pytest.warns(
        DeprecationWarning, match=r"windwrench.dynamics.errors is now windwrench.runt"
    ) as seen:
        from windwrench.dynamics.errors import InputError
    assert seen[0].filename == __file__
    assert InputError is errors.InputError


def test_every_old_path_leads_to_modules_that_are_there_and_hides_none():
    for old, places in MOVED.items():
        assert not (ROOT / f"{old.replace('.', '/')}.py").exists(), old
        for place in places:
            path = ROOT / place.replace(".", "/")
            assert path.with_suffix(".py").is_file() or (path / "__init__.py").is_file(), place


def test_what_never_was_is_not_found():
    with pytest.raises(ModuleNotFoundError, match=r"windwrench.dynamics.nothing"):
        importlib.import_module("windwrench.dynamics.nothing")
    sys.modules.pop("windwrench.envs.jet", None)
    with pytest.warns(DeprecationWarning, match=r"windwrench.envs.jet is now windwrench.envs.fan"):
        old = importlib.import_module("windwrench.envs.jet")
    with pytest.raises(AttributeError, match=r"module 'windwrench.envs.jet' has no attribute 'no'"):
        old.no  # noqa: B018
