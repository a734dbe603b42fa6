"""The extended Kalman filter's Jacobian against finite differences; that it is consistent,
``test_consistency.py`` says.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.support.flights import PERIOD
from tests.support.reference_filters import KIT_ORDER
from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.estimator.ekf import WrenchEKF, model_jacobian
from windwrench.estimator.filter_record import drive, propagate
from windwrench.estimator.reference import difference, displaced
from windwrench.runtime.compiled import compiled

VEHICLE = load_vehicle("ardrone2")
OFFSET = EffectSetting("com_offset", {"cx": 0.02, "cy": -0.03, "cz": 0.05})
EFFECTS = (
    OFFSET,
    EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 2e-4}),
    EffectSetting("ground_effect", {"rho": 3.0}),
)


@compiled
def one_step(record, speeds, dt, A):
    """Write the state after a step into ``centre``, and the Jacobian into ``A``."""
    f = record[0]
    drive(f, speeds, dt, 11.1)
    propagate(f, f.x, dt, f.centre)
    model_jacobian(f, dt, A, True)


@pytest.mark.parametrize(
    "vehicle",
    [
        VEHICLE,
        VEHICLE.with_effects(OFFSET),
        VEHICLE.with_effects(*EFFECTS),
        replace(
            VEHICLE,
            inertia=np.array([[2.2e-3, 3e-4, -2e-4], [3e-4, 3e-3, 1e-4], [-2e-4, 1e-4, 4.8e-3]]),
        ),
    ],
    ids=["plain", "offset", "effects", "full inertia"],
)
@pytest.mark.parametrize("rate", [0.0, 4.0])
def test_jacobian_equals_finite_differences(vehicle, rate):
    rng = np.random.default_rng(0)
    ekf = WrenchEKF(vehicle)
    x = np.zeros(20)
    x[0:3] = [0.1, -0.2, 0.5]
    x[3:7] = Rotation.random(rng=rng).as_quat(scalar_first=True)
    x[7:10], x[10:13] = rng.standard_normal(3), rate * rng.standard_normal(3)
    x[13:16], x[16:19] = 0.05 * rng.standard_normal(3), rng.standard_normal(3)
    speeds, numeric, size = np.array([350.0, 380.0, 360.0, 400.0]), np.empty((18, 18)), 1e-5
    start = x[KIT_ORDER]

    def stepped(error):
        A = np.zeros((12, 18))
        ekf.record[0]["x"][KIT_ORDER] = displaced(start, error)
        one_step(ekf.record, speeds, PERIOD, A)
        return ekf.record[0]["centre"][KIT_ORDER], A

    centre, A = stepped(np.zeros(18))
    F = np.eye(18)
    F[:12] += A
    for n in range(18):
        high, low = (stepped(s * size * np.eye(18)[n])[0] for s in (1.0, -1.0))
        numeric[:, n] = (difference(high, centre) - difference(low, centre)) / (2 * size)
    assert np.abs(A).max() > 1
    assert np.allclose(F, numeric, rtol=0, atol=1e-8)
