"""The flight loop and its vehicle near hover, one axis at a time, as linear systems.

An acceleration ``u`` added to the flight loop's, an external force ``f`` and an external torque
``tau`` move a horizontal axis as

    x'' = g tilt + f / m        tilt'' = alpha + tau / J        alpha' = (wanted - alpha) / lag
    wanted = k_attitude (a / g - tilt) - k_rate tilt'
    a = u + k_position e + k_velocity de/dt + k_integral (integral of e)

``e`` is the reference less the place. These are the equations of ``controllers.flight`` for small
angles, with first-order motors. Along the vertical the rotors produce ``a`` behind the same lag.
"""

from dataclasses import dataclass

import numpy as np

from ..dynamics.effects import compile_effects
from ..dynamics.vehicle import Vehicle
from ..runtime.arrays import Array
from .flight import FlightGains

MOTOR_LAG = 0.04  # s, in the tasks' plant
PLACE, SPEED, TILT, RATE, ALPHA = range(5)  # states of a horizontal axis; then the integral
SET_POINT = 6  # state of a horizontal axis that has a set point
THRUST = 2  # vertical states: place, speed, the rotors' acceleration, integral


@dataclass(frozen=True, eq=False)
class AxisModel:
    """``dx/dt = A x + B u + D d`` of n states. ``d`` is force in N; on a horizontal axis also the
    tilting torque in Nm.
    """

    A: Array  # (n, n)
    B: Array  # (n, 1)
    D: Array  # (n, 2) or (n, 1)

    def held(self, period: float) -> tuple[Array, Array, Array]:
        """Return A, B and D of a step of ``period`` s with constant inputs."""
        from scipy.linalg import expm

        n, inputs = len(self.A), np.hstack([self.B, self.D])
        whole = np.zeros((n + inputs.shape[1],) * 2)
        whole[:n] = np.hstack([self.A, inputs])
        step = np.asarray(expm(period * whole))[:n]
        return step[:, :n], step[:, n : n + 1], step[:, n + 1 :]

    def with_set_point(self, velocity: float = FlightGains.velocity) -> "AxisModel":
        """Return the model with the set point's place as its last state, and the set point's
        velocity (m/s) as its input.

        Args:
            velocity: gain of the flight loop on a velocity error, 1/s.
        """
        n = len(self.A)
        A = np.zeros((n + 1, n + 1))
        # the flight loop sees the place less the set point alone
        A[:n] = np.hstack([self.A, -self.A[:, :1]])
        B = np.vstack([velocity * self.B, [[1.0]]])
        return AxisModel(A, B, np.vstack([self.D, np.zeros((1, self.D.shape[1]))]))


def axis_models(
    vehicle: Vehicle, gains: FlightGains | None = None, lag: float = MOTOR_LAG
) -> tuple[AxisModel, AxisModel, AxisModel]:
    """Return the models along the world's x, y and z of a vehicle facing along +x or -x, with its
    declared body effects.
    """
    body, k = compile_effects(vehicle).vehicle, gains or FlightGains()
    g, m = body.gravity, body.mass
    lateral = np.zeros((6, 6))
    lateral[PLACE, SPEED] = lateral[TILT, RATE] = lateral[RATE, ALPHA] = 1.0
    lateral[SPEED, TILT], lateral[5, PLACE] = g, -1.0
    asked = np.array([-k.position, -k.velocity, 0.0, 0.0, 0.0, k.integral])
    lateral[ALPHA] = k.attitude / g * asked
    lateral[ALPHA, [TILT, RATE, ALPHA]] = -k.attitude, -k.rate, -1.0
    lateral[ALPHA] /= lag
    upwards = np.zeros((4, 4))
    upwards[PLACE, SPEED] = upwards[SPEED, THRUST] = 1.0
    upwards[3, PLACE] = -1.0
    upwards[THRUST] = np.array([-k.position, -k.velocity, -1.0, k.integral]) / lag

    def along(A: Array, state: int, gain: float, inertia: float = 0.0) -> AxisModel:
        B, D = np.zeros((len(A), 1)), np.zeros((len(A), 2 if inertia else 1))
        B[state, 0], D[SPEED, 0] = gain / lag, 1.0 / m
        if inertia:
            D[RATE, 1] = 1.0 / inertia
        return AxisModel(A, B, D)

    about_x, about_y, _ = np.diag(body.inertia).tolist()
    return (
        along(lateral, ALPHA, k.attitude / g, about_y),
        along(lateral, ALPHA, k.attitude / g, about_x),
        along(upwards, THRUST, 1.0),
    )


def tilting(torque: Array) -> tuple[Array, Array]:
    """Return the parts of torques (..., 3), world, that tilt the thrust along x, and along y."""
    return torque[..., 1], -torque[..., 0]
