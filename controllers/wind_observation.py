"""The observation and the action of the tasks in the wind.

One frame is (27,), world axes: three numbers each. Position error, velocity, velocity and
acceleration of the reference. Estimated force and torque, specific force of accelerometer and
rotors, last action. The action is (3,): an acceleration in m/s2 beside the flight loop's.
"""

POSITION_ERROR = slice(0, 3)  # m, reference less estimate
VELOCITY = slice(3, 6)  # m/s
REFERENCE_VELOCITY = slice(6, 9)
REFERENCE_ACCELERATION = slice(9, 12)  # m/s2
FORCE = slice(12, 15)  # N
TORQUE = slice(15, 18)  # Nm
SPECIFIC_FORCE = slice(18, 21)  # m/s2, measured
ROTOR_FORCE = slice(21, 24)  # m/s2, of the rotors by the declared model
LAST_ACTION = 24
WIND_OBSERVATION_SIZE = 27

MAX_ACCELERATION = 4.0  # m/s2
WIND_PERIOD = 0.04  # s, of a decision

_THREE = (
    (5.0, 0.2),
    (10.0, 1.0),
    (10.0, 1.0),
    (20.0, 2.0),
    (10.0, 1.0),
    (1.0, 0.03),
    (40.0, 10.0),
    (40.0, 10.0),
    (MAX_ACCELERATION, MAX_ACCELERATION),
)
OBSERVATION_LIMITS = tuple(limit for limit, _ in _THREE for _ in range(3))
OBSERVATION_SCALES = tuple(scale for _, scale in _THREE for _ in range(3))
