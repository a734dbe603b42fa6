"""The built wheel, installed where there is no checkout, is whole."""

import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def installed(tmp_path_factory):
    """The folder of a wheel's contents; dependencies come from the environment that runs the tests."""
    folder = tmp_path_factory.mktemp("wheel")
    source = folder / "source"
    # built from a copy: a build folder in the checkout must not leak into the wheel, nor be left behind
    names = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, capture_output=True, text=True)
    files = names.stdout.splitlines() if names.returncode == 0 else [
        str(p.relative_to(ROOT)) for p in ROOT.rglob("*") if p.is_file() and ".venv" not in p.parts[len(ROOT.parts)]]
    for name in files:
        if (ROOT / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            (source / name).write_bytes((ROOT / name).read_bytes())
    built = subprocess.run([sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(folder), str(source)],
                           capture_output=True, text=True)
    assert built.returncode == 0, built.stdout + built.stderr
    (wheel,) = folder.glob("*.whl")
    site = folder / "site"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    return site


def run(installed, code, folder):
    return subprocess.run([sys.executable, "-c", f"import sys; sys.path.insert(0, {str(installed)!r})\n{code}"],
                          cwd=folder, capture_output=True, text=True)


def test_the_wheel_holds_code_and_data_and_nothing_else(installed):
    package = installed / "windwrench"
    for name in ("py.typed", "cli.py", "envs/quadrotor.xml", "dynamics/vehicles/ardrone2.yaml",
                 "dynamics/effects/rotor_drag.py", "identification/readers/nanobench.py"):
        assert (package / name).is_file(), name
    assert not (package / "tests").exists()
    sources = {str(p.relative_to(ROOT)) for folder in ("dynamics", "estimator", "controllers", "envs", "identification",
                                                       "training", "experiments", "benchmarks", "commands")
               for p in (ROOT / folder).rglob("*.py")}
    assert sources <= {str(p.relative_to(package)) for p in package.rglob("*.py")}
    entry = next(installed.glob("*.dist-info")) / "entry_points.txt"
    assert "windwrench = windwrench.cli:main" in entry.read_text()


def test_it_runs_from_any_folder(installed, tmp_path):
    out = run(installed, "import gymnasium, windwrench, pathlib\n"
              f"assert pathlib.Path(windwrench.__file__).is_relative_to({str(installed)!r})\n"
              "env = gymnasium.make('windwrench:windwrench/FanTracking-v0')\n"
              "env.reset(seed=0); print(env.step([0.1])[1])", tmp_path)
    assert out.returncode == 0, out.stderr
    assert float(out.stdout) > 0


def test_the_command_runs_from_any_folder(installed, tmp_path):
    out = run(installed, "sys.argv = ['windwrench', 'record', '--seconds', '1', '--out', 'flight.csv']\n"
              "from windwrench.cli import main; main()", tmp_path)
    assert out.returncode == 0, out.stderr
    assert (tmp_path / "flight.csv").read_text().startswith("t,px,py,pz,qw,qx,qy,qz,omega1")


def test_importing_the_package_is_light(installed, tmp_path):
    out = run(installed, "import windwrench\nprint(any(m in sys.modules for m in ('mujoco', 'torch', 'numba', 'scipy')))",
              tmp_path)
    assert out.stdout.strip() == "False", out.stderr
