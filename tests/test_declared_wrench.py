"""What a model says acts is what the residual takes away, by the declared mass and inertia."""

import numpy as np

from windwrench.dynamics import EffectSetting, load_vehicle
from windwrench.experiments.practice_flights import fly_practice
from windwrench.identification.residual import declared_wrench, model_wrench, residual_wrench
from windwrench.identification.signals import log_signals


def test_the_balance_by_the_declared_body_is_that_of_the_residual():
    declared = load_vehicle("ardrone2")
    vehicle = declared.with_effects(EffectSetting("mass", {"dm": 0.05}),
                                    EffectSetting("inertia", {"jx": 0.1, "jy": -0.2, "jz": 0.3}),
                                    EffectSetting("com_offset", {"cx": 0.01, "cy": 0.003, "cz": -0.02}))
    (s,) = log_signals(fly_practice(declared, seconds=6.0, seed=1))
    body = model_wrench(s, vehicle)[2]
    needed = np.column_stack([declared.mass * (s.acceleration + np.array([0.0, 0.0, declared.gravity])),
                              s.angular_acceleration @ declared.inertia.T])
    r = residual_wrench(s, vehicle)
    r = np.column_stack([declared.mass / body.mass * r[:, :3],
                         np.linalg.solve(body.inertia, r[:, 3:].T).T @ declared.inertia.T])
    np.testing.assert_allclose(needed - declared_wrench(s, vehicle, declared), r, atol=1e-10)
