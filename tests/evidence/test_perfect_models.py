"""Three plants fly as declared: flights obey the vehicle, and a diagnosis believes the model."""

from itertools import product

import numpy as np
import pytest

from tests.support.data_paths import DATA
from windwrench.evidence.perfect_models import LOGS, PLANTS, claimed, flown, is_claim

SIMULATOR = str(DATA.parent / "generator" / "make_flights.py")


def test_the_third_plant_obeys_its_vehicle():
    log, vehicle = flown("third", 0, 6.0, SIMULATOR)  # without gusts
    torque = vehicle.rotor_wrench(log.rotor_speeds)[:, 1:]
    inertia = np.diagonal(vehicle.inertia)
    turned = np.gradient(log.gyro, log.period, axis=0) * inertia
    # a difference over two ticks takes 5 ms of the rotors' fastest changes
    off = turned + np.cross(log.gyro, log.gyro * inertia) - torque
    assert off[5:-5].std() < 0.05 * torque.std()


def test_a_perfect_model_is_believed_by_its_imu_alone():
    told = claimed("own", 5, 24.0, SIMULATOR, ["IMU alone"])
    assert not is_claim(told["IMU alone"])


@pytest.mark.slow
def test_perfect_models_are_believed():
    each = [claimed(plant, i, 20.0, SIMULATOR) for plant, i in product(PLANTS, range(10, 20))]
    for kind in LOGS:
        claims = sum(is_claim(told[kind]) for told in each)
        assert claims <= 2, kind
