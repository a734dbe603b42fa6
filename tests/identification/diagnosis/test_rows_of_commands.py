"""Flights whose rotors are known by commands, in hover: tilt answers what moves the vehicle, and
the measured tilt is noise for the most part.
"""

import math
from dataclasses import replace

import numpy as np
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from tests.support.flown import VEHICLE
from windwrench.dynamics.vehicle import MotorCurve
from windwrench.identification.diagnosis.diagnosing import diagnose
from windwrench.identification.diagnosis.regression import RegressedFlights
from windwrench.identification.diagnosis.row_nuisances import THRUST_STD, row_nuisances
from windwrench.identification.diagnosis.rows import Rows
from windwrench.identification.logs.flight_log import FlightLog

SECONDS = 20.0
PERIOD = 0.01
# N of thrust is what a command is taken for
STATED = replace(VEHICLE, motor_curve=MotorCurve(thrust=(0.0, 0.5, 1.0)))


def gusts(rng, size, time):
    """Return an Ornstein-Uhlenbeck disturbance (samples, axes) with these standard deviations."""
    keep = math.exp(-PERIOD / time)
    steps = (
        rng.standard_normal((round(SECONDS / PERIOD), len(size))) * size * (1.0 - keep**2) ** 0.5
    )
    out = np.zeros_like(steps)
    for k in range(1, len(out)):
        out[k] = keep * out[k - 1] + steps[k]
    return out


def hover(load, seed):
    """Return a hover in gusts of a vehicle that carries a load: its loop answers them by thrust and
    by tilt, of which the motion capture sees 0.3 degrees too much or too little.
    """
    rng = default_rng(seed)
    push = gusts(rng, np.array([0.04, 0.04, 0.06]), 0.5)
    seen = gusts(rng, np.full(2, 0.006), 0.1)
    position = np.zeros_like(push)
    answer = np.zeros_like(push)
    position[0, 2] = 1.0
    velocity = np.zeros(3)
    for k in range(1, len(push)):
        wanted = 9.0 * (position[0] - position[k - 1]) - 4.0 * velocity
        answer[k] = answer[k - 1] + PERIOD / 0.1 * (wanted - answer[k - 1])
        velocity = velocity + PERIOD * (answer[k] + push[k])
        position[k] = position[k - 1] + PERIOD * velocity
    tilt = answer[:, :2] / STATED.gravity + seen
    attitude = Rotation.from_euler("xy", np.column_stack([-tilt[:, 1], tilt[:, 0]]))
    thrust = (STATED.mass + load) * (STATED.gravity + answer[:, 2])
    speed = np.sqrt(thrust / STATED.k.sum())
    return FlightLog(
        PERIOD * np.arange(len(push)),
        position + 2e-4 * rng.standard_normal(position.shape),
        attitude.as_quat(scalar_first=True),
        np.repeat(speed[:, None], 4, axis=1),
        name="hover",
        commanded=True,
    )


def test_thrust_at_a_command_is_a_nuisance_by_its_differences_between_flights():
    """A column that is nearly thrust_scale's own would with it stand for a lag or a drag."""
    logs = [hover(0.0, seed) for seed in range(2)]
    one, two = (row_nuisances(Rows(RegressedFlights(x, STATED), {})) for x in (logs[:1], logs))
    assert not one["thrust 0"].any()
    assert abs(two["thrust 0"]).max() > 0.4 * THRUST_STD * STATED.gravity
    assert_allclose(two["thrust 0"], -two["thrust 1"], atol=1e-12)
    # only a curve states the thrust
    assert not RegressedFlights(logs, STATED).thrust_std
    assert RegressedFlights(logs, VEHICLE).thrust_std > 0.0


def test_a_hover_shows_a_load_by_the_mean_thrust_alone():
    """How the measured tilt goes with the motion is the flight loop's answer, and noise: it does
    not tell a lifting force from more thrust.
    """
    found = diagnose([hover(0.3 * STATED.mass, seed=0)], STATED)
    by_name = {e.name: e for e in found.effects}
    assert "constant_force" not in by_name
    thrust = by_name["thrust_scale"]
    scale = thrust.coefficients["s"]
    std = thrust.std["s"]
    assert abs(scale - (1.0 / 1.3 - 1.0)) < 1.96 * std
    # a command makes another thrust in each flight
    assert std > 0.9 * THRUST_STD * (1.0 + scale)


def test_in_a_hover_without_a_load_nothing_is_sure():
    """A loop that holds the height lets thrust vary against every vertical disturbance."""
    assert not [e for e in diagnose([hover(0.0, seed=1)], STATED).effects if not e.tentative]
