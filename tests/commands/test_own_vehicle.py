"""A vehicle file that ``identify`` writes from measured flights, through commands that take a
vehicle; ``train`` and ``export-c`` take one in ``test_examples``.
"""

import shutil

import gymnasium as gym
import numpy as np
import pytest

import windwrench  # noqa: F401 (registers the tasks)
from tests.support.data_paths import excerpt
from windwrench.dynamics import load_vehicle

FLIGHTS = ("B2_circle_fast_rep3", "B5_helix_fast_rep2")
pytestmark = pytest.mark.measured


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """Return the folder of the vehicle file and its flights."""
    folder = tmp_path_factory.mktemp("mine")
    for name in FLIGHTS:
        shutil.copy(excerpt(f"nanobench/{name}.csv.gz"), folder)
    return folder


@pytest.fixture
def mine(written, call, tmp_path):
    """Return the path of the vehicle file in the test's folder, identified once from a flight."""
    kept = written / "mine.yaml"
    if not kept.exists():
        words = ("--mass", 0.034, "--geometry", 0.0325, "--reader", "nanobench")
        code, text, err = call(
            "identify", written / f"{FLIGHTS[1]}.csv.gz:2-14", *words, "--out", kept
        )
        assert code == 0, err
        assert "thrust and drag" in text
        assert "Use: " in text
    return shutil.copy(kept, tmp_path / "mine.yaml")


def test_it_says_what_stands(mine):
    vehicle = load_vehicle(mine)
    assert {vehicle.status.force, vehicle.status.torque} <= {"identified", "refuted"}
    x, y, z = np.linalg.eigvalsh(vehicle.inertia)
    assert z < x + y
    disc = 1.225 * np.pi * vehicle.rotor_radius**4
    assert (vehicle.k / disc < 0.1).all()


def test_another_flight_is_estimated_by_it(mine, written, call):
    log = written / f"{FLIGHTS[0]}.csv.gz"
    words = ("--reader", "nanobench", "--vehicle", mine, "--no-tune")
    code, _, err = call("estimate", log, *words)
    assert code == 0, err


def test_it_flies_every_task(mine, call):
    for task in ("WindHover-v2", "WindTrajectory-v2", "FanTracking-v2"):
        with gym.make(f"windwrench/{task}", vehicle=str(mine), action="rates") as env:
            env.reset(seed=1)
            assert np.isfinite(env.step(np.zeros(4))[1])
    words = ("--vehicle", mine, "--task", "WindHover", "--controller", "lqg")
    code, _, err = call("fly", *words, "--out", "flight")
    assert code == 0, err
