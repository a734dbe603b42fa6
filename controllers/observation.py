"""The observation of controllers, and their action.

One frame is (8,): estimated external force x, y, z (N) and torque x, y, z (Nm), world. Then the
estimated velocity along y (m/s), and the last command (m/s). The action is (1,): the commanded
velocity along the world's y.
"""

FORCE_X, FORCE_Y, FORCE_Z, TORQUE_X, TORQUE_Y, TORQUE_Z, VELOCITY_Y, LAST_COMMAND = range(8)
OBSERVATION_SIZE = 8
MAX_COMMAND = 1.0  # m/s
DECISION_PERIOD = 0.08  # s, from one observation to the next
