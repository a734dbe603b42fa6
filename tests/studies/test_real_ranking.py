"""The control law of a published flight is read off its log."""

import csv

import numpy as np
import pytest

from studies.real_ranking.published_log import control_gains
from windwrench.runtime.errors import InputError

GAINS = {"x": (2.6, 4.0, 1.1), "z": (3.0, 2.7, 0.6)}


def write_log(path):
    """Write a flight's table whose commands follow ``GAINS``."""
    rng = np.random.default_rng(0)
    t = 0.02 * np.arange(1000)
    p_d = np.column_stack([1.25 * np.sin(t), 0.0 * t, 2.0 + 0.75 * np.sin(2.0 * t)])
    v_d = np.gradient(p_d, t, axis=0)
    slow = 0.03 * np.sin(0.7 * t)  # two tones, or the integral looks like the rate
    e = np.column_stack([0.05 * np.sin(1.3 * t) + slow, 0.0 * t, 0.1 * np.cos(2.1 * t) + slow])
    rate = np.gradient(e, t, axis=0)
    wanted = np.gradient(v_d, t, axis=0)
    for i, (kp, kd, ki) in zip((0, 2), GAINS.values(), strict=True):
        total = np.concatenate([[0.0], np.cumsum(0.01 * (e[1:, i] + e[:-1, i]))])
        wanted[:, i] -= kp * e[:, i] + kd * rate[:, i] + ki * total + 0.3
    wanted += 0.005 * rng.standard_normal(wanted.shape)
    force = wanted + np.array([0.0, 0.0, 9.81])
    size = np.linalg.norm(force, axis=1)
    half = 0.5 * np.arctan2(force[:, 0], force[:, 2])
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(["", "t", "p", "p_d", "v", "v_d", "q_sp", "T_sp", "hover_throttle"])
        for k in range(len(t)):
            q = [0.0, -np.sin(half[k]), 0.0, -np.cos(half[k])]  # either sign of a quaternion
            cells = [p_d[k] + e[k], p_d[k], v_d[k] + rate[k], v_d[k], np.array(q)]
            thrust = [float(0.5 * size[k] / 9.81)]
            table.writerow([k, t[k], *(str(c.tolist()) for c in cells), str(thrust), "[0.5]"])


def test_gains_of_a_log(tmp_path):
    write_log(tmp_path / "flight.csv")
    for found, gains in zip(control_gains(tmp_path / "flight.csv"), GAINS.values(), strict=True):
        assert (found.position, found.velocity, found.integral) == pytest.approx(gains, abs=0.05)
        assert max(found.std) < 0.05
        assert found.left == pytest.approx(0.005, rel=0.1)


def test_another_table_is_refused(tmp_path):
    (tmp_path / "other.csv").write_text("t,p\n0,[1]\n")
    with pytest.raises(InputError, match=r"other\.csv: no column p_d"):
        control_gains(tmp_path / "other.csv")
