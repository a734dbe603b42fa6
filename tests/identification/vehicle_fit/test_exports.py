"""Exports against the definitions of those who read them."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting, MotorCurve
from windwrench.identification.vehicle_fit.exports import EXPORTS
from windwrench.identification.vehicle_fit.result import IDENTIFIED, Estimate

LAG = Estimate("motor_lag", 0.05, 0.04, 0.06, "s", IDENTIFIED, "")


class Found(SimpleNamespace):
    """As much of a result as exports read."""

    def __getitem__(self, name):
        return {e.name: e for e in self.estimates}[name]

    @property
    def by_name(self):
        return {e.name: e for e in self.estimates}


def found(*effects, curve=None, lag=LAG, commands=False):
    vehicle = load_vehicle("crazyflie").with_effects(*effects)
    vehicle = vehicle.__class__(**{**vehicle.__dict__, "motor_curve": curve})
    drive = SimpleNamespace(commands=commands)
    return Found(vehicle=vehicle, estimates=[lag], fit=SimpleNamespace(drive=drive))


def test_px4_and_ardupilot_predict_the_drag_that_the_vehicle_has():
    effects = (
        EffectSetting("rotor_drag", {"kdx": 2e-6, "kdy": 2e-6}),
        EffectSetting("body_drag", {"cx": 4e-4, "cy": 6e-4}),
    )
    it = found(*effects)
    v, speed = it.vehicle, 3.0
    set_to = dict(re.findall(r"param set (\S+) (\S+)", EXPORTS["px4"](it)))
    predicted = float(set_to["EKF2_MCOEF"]) * speed
    predicted += 0.5 * 1.225 * speed**2 / float(set_to["EKF2_BCOEF_Y"])
    force = 4 * v.hover_rate * 2e-6 * speed + 6e-4 * speed**2
    assert predicted == pytest.approx(force / v.mass, rel=1e-3)
    lines = dict(x.split(",") for x in EXPORTS["ardupilot"](it).splitlines() if x[0] != "#")
    assert float(lines["EK3_DRAG_MCOEF"]) == float(set_to["EKF2_MCOEF"])
    assert float(lines["EK3_DRAG_BCOEF_X"]) == float(set_to["EKF2_BCOEF_X"])
    assert "not known from these logs: MPC_THR_HOVER, THR_MDL_FAC" in EXPORTS["px4"](it)


def test_the_thrust_curve_hovers_where_the_autopilot_thinks():
    full, bend = 0.15, 0.7
    it = found(curve=MotorCurve((0.0, (1 - bend) * full, bend * full)), commands=True)
    text = EXPORTS["px4"](it)
    set_to = {k: float(x) for k, x in re.findall(r"param set (\S+) (\S+)", text)}
    assert set_to["THR_MDL_FAC"] == pytest.approx(bend, rel=1e-3)
    # relative thrust T = f u^2 + (1 - f) u; at hover four rotors carry the weight
    assert 4 * full * set_to["MPC_THR_HOVER"] == pytest.approx(it.vehicle.weight, rel=1e-3)
    assert "EKF2_MCOEF" not in set_to
    assert f"MOT_THST_EXPO,{bend:g}" in EXPORTS["ardupilot"](it)


def test_rotorpy_makes_the_same_forces_and_torques():
    it = found(EffectSetting("rotor_drag", {"kdx": 2e-6, "kdy": 3e-6}))
    names = {"np": np}
    exec(EXPORTS["rotorpy"](it), names)
    p, v = names["quad_params"], it.vehicle
    thrust = v.k * np.array([1500.0, 1600.0, 1700.0, 1800.0]) ** 2
    place = np.array(list(p["rotor_pos"].values()))
    torque = np.cross(place, np.column_stack([0 * thrust, 0 * thrust, thrust])).sum(axis=0)
    torque[2] += p["k_m"] / p["k_eta"] * p["rotor_directions"] @ thrust
    want = v.rotor_wrench(np.array([1500.0, 1600.0, 1700.0, 1800.0]))
    assert [p["k_eta"] / v.k[0] * thrust.sum(), *torque] == pytest.approx(want, rel=1e-4)
    assert p["tau_m"] == 0.05
    assert p["k_d"] == pytest.approx(2.5e-6)
