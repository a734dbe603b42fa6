"""A perfect model in gusts is believed: a flight loop on gyros answers gusts that no pose shows."""

import numpy as np
import pytest

from tests.support.data_paths import data_file
from tests.support.imu_flights import pose_removed
from windwrench.dynamics import load_vehicle
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.diagnosis.causal_filter import Track
from windwrench.identification.diagnosis.raw_poses import Poses
from windwrench.identification.diagnosis.rotor_innovations import LAGS, rotor_innovations
from windwrench.identification.diagnosis.settings import DIAGNOSIS
from windwrench.identification.diagnosis.unknown import beside_unknown, unknown
from windwrench.identification.logs.reading import read_log


def test_gusts_around_a_perfect_model_are_gusts():
    """Of 30 mN, and beside an IMU: ``tests/golden/sentences.json``."""
    vehicle = load_vehicle("ardrone2")
    log = read_log(data_file("hard_logs/perfect_model_gusts_10mN.csv.gz"), vehicle=vehicle)
    found = diagnose([log], vehicle)
    assert found.effects == ()
    assert found.remainder in ("none", "random")
    assert found.probabilities.unknown < DIAGNOSIS.most_unknown
    gust = {g.channel: g.rms for g in found.gusts}
    assert 0.005 < gust["Fx"] < 0.02  # N
    assert 0.0005 < gust["tau_x"] < 0.002  # Nm


@pytest.mark.slow
@pytest.mark.parametrize("every", [0, 20])
def test_gusts_around_a_perfect_model_are_gusts_without_its_pose(every):
    vehicle = load_vehicle("ardrone2")
    log = read_log(data_file("hard_logs/perfect_model_gusts_10mN_imu.csv.gz"), vehicle=vehicle)
    found = diagnose([pose_removed(log, every)], vehicle)
    assert (found.verdict, found.remainder) == ("nothing to explain", "none")
    assert found.probabilities.unknown < 0.25


@pytest.mark.slow
def test_what_no_effect_of_the_library_does_has_no_sure_name():
    """A load on a rubber tether; the headline names the unknown cause and no effects."""
    vehicle = load_vehicle("ardrone2")
    log = read_log(data_file("hard_logs/rubber_tether.csv.gz"), vehicle=vehicle)
    assert all(e.tentative for e in diagnose([log], vehicle).effects)


def test_rotors_that_answer_a_product_of_rates_have_no_innovation_by_it():
    """A loop on a gyro answers gyroscopic torques, which are in the model and are no gust."""
    rng = np.random.default_rng(0)
    n = 3000
    rate, noise = rng.standard_normal((n, 3)), rng.standard_normal((n, 4))
    level, zeros = np.repeat(np.eye(3)[None], n, axis=0), np.zeros((n, 6))
    speeds = 400.0 + 0.5 * noise
    answered = np.zeros((n, 4))
    answered[1:, 1] = rate[:-1, 1] * rate[:-1, 2]
    rotors = speeds**2 * 1e-5
    # a roll torque by four rotors that speed up and slow down in pairs
    roll = np.array([1.0, 1.0, -1.0, -1.0])
    speeds = np.sqrt((rotors + 0.02 * answered[:, 1:2] * roll) / 1e-5)
    mix = 1e-5 * np.array([[1, 1, 1, 1], roll, [-1, 1, 1, -1], [1, -1, 1, -1]]).T
    between = 0.5 * (speeds + np.vstack([speeds[1:], speeds[-1:]]))
    heading = np.tile([1.0, 0.0], (n, 1))
    k = np.arange(n)
    t = 0.005 * k
    poses = Poses(0.005, t, zeros[:, :3], heading, speeds, zeros[:, 0], zeros[:1], k, k, k)
    track = Track(
        t, zeros[:, :3], level, zeros[:, :3], rate, zeros, between**2 @ mix, zeros, zeros, heading,
        zeros, zeros,
    )  # fmt: skip
    found = rotor_innovations(poses, track)
    roll_innovation, answer = found[LAGS:, 1], answered[LAGS:, 1]
    assert abs(np.corrcoef(roll_innovation, answer)[0, 1]) < 0.01


def test_a_name_has_no_ceiling_and_keeps_its_probability_beside_a_weak_structure():
    quiet = unknown(-2.0, push=False)
    assert 0.0 < quiet < 0.05
    assert beside_unknown(1.0, 300.0, -2.0, quiet) == 1.0
    strange = unknown(17.0, push=False)
    assert strange > 0.999
    weak, strong = (beside_unknown(1.0, factor, 17.0, strange) for factor in (20.0, 2000.0))
    assert weak < 1e-4
    assert 0.6 < strong < 0.7
    assert beside_unknown(0.4, 2000.0, 0.0, strange) == pytest.approx(0.4)
