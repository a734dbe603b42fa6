"""The built wheel, installed where there is no checkout, is whole."""

import json
import os
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.programs import said as done
from tests.support.sources import copied
from windwrench.cli import app

CHECKOUT_ONLY = ("evidence", "reproduction", "tests", "installation", "setup.py")
MOST_BYTES = 4_000_000  # of the wheel
ENVIRONMENT = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy: of a build folder in the checkout only the core's objects may
    serve, and none is left behind.
    """
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    copied(source, objects=True)
    done(
        *(sys.executable, "-m", "build", "--wheel", "--no-isolation"),
        *("--outdir", str(folder), str(source)),
    )
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def empty(wheel, tmp_path_factory):
    """The programs' folder of an environment that holds the wheel alone; dependencies are those of
    the running one.
    """
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, with_pip=False, symlinks=os.name != "nt")
    programs = folder / ("Scripts" if os.name == "nt" else "bin")
    python = programs / "python"
    done(
        *(sys.executable, "-m", "pip", "--python", str(python), "install", "--no-deps", "--quiet"),
        *("--disable-pip-version-check", "--no-index", str(wheel)),
    )
    site = done(python, "-c", "import sysconfig; print(sysconfig.get_path('purelib'))").strip()
    # a line of a .pth file is a folder whose own .pth files, an editable install's among them, do
    # not count
    dependencies = sysconfig.get_path("purelib") + "\n"
    (Path(site) / "dependencies.pth").write_text(dependencies, encoding="utf-8")
    return programs


@pytest.fixture(scope="module")
def installed(empty):
    """The folder that the wheel was installed to."""
    return next(empty.parent.rglob("windwrench/__init__.py")).parent.parent


def call(empty, folder, *arguments):
    return done(empty / "windwrench", *arguments, cwd=folder, env=ENVIRONMENT)


def test_the_wheel_holds_code_and_data_and_nothing_else(installed):
    package = installed / "windwrench"
    for name in (
        "py.typed",
        "_core/__init__.pyi",
        "core/ukf.hpp",
        "_core/baseline" + sysconfig.get_config_var("EXT_SUFFIX"),
        "envs/quadrotor.xml",
        "dynamics/vehicles/ardrone2.yaml",
        "dynamics/effects/page.md.j2",
        "live/export_c/source/windwrench.cpp",
        "identification/logs/maps/nanobench.yaml",
        "training/policies/tasks/WindHover-gru-0.npz",
    ):
        assert (package / name).is_file(), name
    assert not (package / "tests").exists()
    rooms = [
        path.name
        for path in ROOT.iterdir()
        if (path / "__init__.py").is_file() and path.name not in CHECKOUT_ONLY
    ]
    sources = {str(p.relative_to(ROOT)) for room in rooms for p in (ROOT / room).rglob("*.py")}
    wrapped = {str(p.relative_to(package)) for p in package.rglob("*.py")}
    assert sources <= wrapped
    assert not [name for name in wrapped if name.startswith(CHECKOUT_ONLY)]


def test_the_wheel_is_small(wheel):
    assert wheel.stat().st_size <= MOST_BYTES


def test_the_paper_s_figures_need_a_checkout(empty, tmp_path):
    words = [empty / "windwrench", "reproduce", "fig3"]
    ended = subprocess.run(words, cwd=tmp_path, env=ENVIRONMENT, capture_output=True, text=True)
    assert ended.returncode == 2
    assert ended.stderr.startswith("error: reproduce: ")
    assert "checkout" in ended.stderr
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_every_command_starts_where_there_is_no_checkout(empty, tmp_path):
    for name in sorted(command.name for command in app.registered_commands):
        assert f"Usage: windwrench {name}" in call(empty, tmp_path, name, "--help")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_tasks_fly_where_there_is_no_checkout(empty, tmp_path):
    few = ("--episodes", "1", "--scenarios", "static", "--jobs", "1", "--out", "demo")
    call(empty, tmp_path, "benchmark", *few)
    assert len(json.loads((tmp_path / "demo" / "leaderboard.json").read_bytes())) == 4
    said = call(empty, tmp_path, "fly", "--scenario", "static", "--out", "demo", "--json")
    assert json.loads(said)["result"]["lost"] is False
    call(empty, tmp_path, "record", "--seconds", "1", "--out", "flight.csv")
    assert (tmp_path / "flight.csv").read_text().startswith("t,px,py,pz,qw,qx,qy,qz,omega1")


def test_importing_the_package_is_light(installed, tmp_path):
    code = f"import sys; sys.path.insert(0, {str(installed)!r}); import windwrench\n"
    code += "print([m for m in ('mujoco', 'torch', 'scipy') if m in sys.modules])"
    assert done(sys.executable, "-c", code, cwd=tmp_path).strip() == "[]"
