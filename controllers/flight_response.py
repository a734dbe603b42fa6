"""How soon the flight loop carries out what it is told, as a linear system near hover."""

import numpy as np

from .flight import FlightGains

_STEP = 0.001  # s, of the answer
_LONGEST = 3.0  # s


def half_response(gains: FlightGains | None = None, motor_lag: float = 0.04) -> float:
    """Return how many seconds after a step of the commanded velocity along one axis half of it is
    flown.

    The cascade of ``flight``: position, velocity and integral make an acceleration, the attitude
    loop follows it as a second-order system behind the motors' lag. No command given later than
    this has been carried out by half.

    Args:
        gains: of the flight loop.
        motor_lag: s, of a first-order motor.

    Raises:
        ValueError: the loop does not reach half of the step within 3 s.
    """
    from scipy.linalg import expm

    g = FlightGains() if gains is None else gains
    # place, velocity, acceleration, its rate, acceleration behind the motors, integral, set point
    A, b = np.zeros((7, 7)), np.zeros(7)
    A[0, 1] = A[1, 2] = A[2, 3] = 1.0
    A[3, [2, 3, 4]] = -g.attitude, -g.rate, g.attitude
    A[4] = np.array([-g.position, -g.velocity, 0.0, 0.0, -1.0, g.integral, g.position]) / motor_lag
    b[4] = g.velocity / motor_lag
    A[5, [0, 6]] = -1.0, 1.0
    b[6] = 1.0
    whole = np.zeros((8, 8))
    whole[:7, :7], whole[:7, 7] = A, b
    step, state = expm(_STEP * whole), np.zeros(8)
    state[7] = 1.0
    for n in range(round(_LONGEST / _STEP)):
        if state[1] >= 0.5:
            return n * _STEP
        state = step @ state
    raise ValueError("half_response: the flight loop does not follow its command")
