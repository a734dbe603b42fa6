"""The residual of flights before and after effects are named, and what of it is noise."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...dynamics.vehicle import Vehicle
from .regression import Flights, Setting

Array = NDArray[np.float64]


@dataclass(frozen=True)
class NoiseSettings:
    """What of a residual is noise."""

    # times the noise floor; a residual up to that is the sensors' noise
    most_floor_ratio: float = 1.2
    # shares of the weight, and of the weight times the arm: a weaker disturbance, below the cut-off
    # ``CUTOFFS.calm_hz``, is none
    calm_force: float = 0.006
    calm_torque: float = 0.0015


NOISE = NoiseSettings()


@dataclass(frozen=True, eq=False)
class Balance:
    """The residual of flights (rows, 6), by the declared vehicle and by the amended one."""

    before: Array
    after: Array
    floor: tuple[float, float]  # RMS of what sensors alone leave, N and Nm
    error_before: tuple[float, float]  # RMS on held-out rows, N and Nm
    error_after: tuple[float, float]
    noisy: bool  # whether more is left than the sensors' noise
    # by how much the mean square of force and torque grows on held-out blocks, as a share, and the
    # standard error of that over the blocks
    growth: tuple[float, float]

    @property
    def better(self) -> bool:
        """Whether the amended vehicle's held-out error is smaller."""
        return self.growth[0] < 0.0


def balance(flights: Flights, setting: Setting) -> Balance:
    """Return the residual with a setting of effects. What of it is a sensor's bias is no error of
    the model, and counts before as well.
    """
    sensors = {k: x for k, x in setting.get("", {}).items() if ("", k) in flights.biases}
    before = flights.residual({"": sensors} if sensors else {})
    after = flights.residual(setting)
    held_out = ~flights.fit_rows
    floor = _rms(flights.visible_noise)
    error = _rms(after[held_out])
    # an IMU's own noise, and what a filter left of a pose's, is below what counts for none
    quiet = calm(flights.vehicle)[[0, 3]] * (flights.inertial or flights.filtered)
    least = np.hypot(floor, quiet)
    noisy = bool(np.any(np.array(error) > NOISE.most_floor_ratio * least))
    old, new = np.square(before[held_out]), np.square(after[held_out])
    change = np.mean((new - old) / (old.mean(axis=0) + 1e-30), axis=1)
    block = flights.block[held_out]
    blocks = np.array([change[block == b].mean() for b in np.unique(block)])
    return Balance(
        before,
        after,
        floor,
        _rms(before[held_out]),
        error,
        noisy,
        (float(blocks.mean()), float(blocks.std() / math.sqrt(max(len(blocks) - 1, 1)))),
    )


def calm(vehicle: Vehicle) -> Array:
    """Return the disturbances (6,) that count for none, N and Nm."""
    return vehicle.weight * np.repeat([NOISE.calm_force, NOISE.calm_torque * vehicle.arm_l], 3)


def _rms(wrench: Array) -> tuple[float, float]:
    """Return the RMS of force (N) and torque (Nm) over rows and axes."""
    force, torque = np.sqrt(np.square(wrench).reshape(-1, 2, 3).mean(axis=(0, 2))).tolist()
    return force, torque
