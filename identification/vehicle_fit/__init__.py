"""A vehicle from its logs: thrust and torque coefficients, inertia, lag, centre of mass, drag."""
