"""Three plants fly as declared: flights obey the vehicle, and a diagnosis believes the model."""

from itertools import product

import numpy as np
import pytest
from numpy.random import default_rng

from tests.support.data_paths import DATA
from windwrench.dynamics import load_vehicle
from windwrench.envs.plant import TICK
from windwrench.evidence.perfect_models import (
    GUSTS,
    LOGS,
    LOOPS,
    PLANTS,
    SIZES,
    claimed,
    flown,
    gusts,
    is_claim,
    table,
)

SIMULATOR = str(DATA.parent / "generator" / "make_flights.py")
VEHICLE = load_vehicle("hummingbird")


@pytest.mark.parametrize("number", range(len(LOOPS)))
def test_the_third_plant_obeys_its_vehicle(number):
    log, vehicle = flown("third", number, 6.0, SIMULATOR)
    rotors = vehicle.rotor_wrench(log.rotor_speeds)
    wrench = gusts(GUSTS[number], vehicle, default_rng((number, 2)), len(log.t))
    inertia = np.diagonal(vehicle.inertia)
    turned = np.gradient(log.gyro, TICK, axis=0) * inertia
    needed = turned + np.cross(log.gyro, log.gyro * inertia) - wrench[:, 3:]
    # a difference over two ticks takes 5 ms of the rotors' fastest changes
    off = (needed - rotors[:, 1:])[5:-5]
    assert off.std() < 0.05 * rotors[:, 1:].std()
    up = vehicle.mass * log.accelerometer[:, 2] - rotors[:, 0]
    assert np.abs(up).max() < 1e-3 * vehicle.weight + 4.0 * wrench[:, :3].std()
    assert np.linalg.norm(log.position - log.position.mean(axis=0), axis=1).max() < 6.0  # m


@pytest.mark.parametrize("kind", GUSTS)
def test_gusts_have_a_stated_size(kind):
    wrench = gusts(kind, VEHICLE, default_rng(3), 4001)
    share = wrench[:, :3].std(axis=0) / VEHICLE.weight
    low, high = (0.0, 0.0) if kind == "none" else SIZES
    assert np.all((share >= low) & (share <= high))
    assert np.allclose(share, share[0])


def test_claims_are_counted_by_plant_and_log():
    quiet, loud = {"names": {}, "unknown": 0.1}, {"names": {}, "unknown": 0.3}
    done = {f"{plant} 0": dict.fromkeys(LOGS, quiet) for plant in PLANTS}
    done["third 0"] = {**done["third 0"], "IMU alone": loud}
    *_, last = table(done).splitlines()
    assert [cell.split(" (")[0] for cell in last.split(" | ")[1:]] == [
        "0 of 1",
        "0 of 1",
        "1 of 1",
        "1 of 3",
    ]


@pytest.mark.parametrize(("plant", "number"), [("own", 5), ("third", 1)])
def test_a_perfect_model_is_believed_by_its_imu_alone(plant, number):
    told = claimed(plant, number, 24.0, SIMULATOR, ["IMU alone"])
    assert not is_claim(told["IMU alone"])


@pytest.mark.slow
def test_perfect_models_are_believed():
    each = [claimed(plant, i, 20.0, SIMULATOR) for plant, i in product(PLANTS, range(10, 20))]
    for kind in LOGS:
        claims = sum(is_claim(told[kind]) for told in each)
        assert claims <= 2, kind
