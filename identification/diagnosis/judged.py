"""What a judgement of flights gives to the report, whichever way it was reached."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ..findings import (
    Candidate,
    Disturbance,
    NamedEffect,
    Probabilities,
    Ranking,
    Structure,
    TransientDisturbance,
)
from .regression import Flights
from .sensor_bias import biases

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Setting = Mapping[str, Mapping[str, float]]
Report = Callable[[str], None]


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
    before = flights.residual(biases(setting))
    after = flights.residual(setting)
    held_out = ~flights.fit_rows
    floor = _rms(flights.visible_noise)
    error = _rms(after[held_out])
    # an IMU's own noise is far below the disturbances that count for none
    quiet = calm(flights.vehicle.weight, flights.vehicle.arm_l)[[0, 3]]
    least = np.hypot(floor, quiet) if flights.inertial else np.array(floor)
    noisy = bool(np.any(np.array(error) > NOISE.most_floor_ratio * least))
    return Balance(
        before,
        after,
        floor,
        _rms(before[held_out]),
        error,
        flights.filtered or noisy,
        _growth(before[held_out], after[held_out], flights.block[held_out]),
    )


def _growth(before: Array, after: Array, block: Index) -> tuple[float, float]:
    """Return by how much the mean square of six channels grows, each as a share of what it was, and
    the standard error over blocks.
    """
    size = np.mean(np.square(before), axis=0) + 1e-30
    change = np.mean((np.square(after) - np.square(before)) / size, axis=1)
    blocks = np.array([change[block == b].mean() for b in np.unique(block)])
    return float(blocks.mean()), float(blocks.std() / math.sqrt(max(len(blocks) - 1, 1)))


def calm(weight: float, arm: float) -> Array:
    """Return the disturbances (6,) that count for none, N and Nm."""
    return weight * np.repeat([NOISE.calm_force, NOISE.calm_torque * arm], 3)


def _rms(wrench: Array) -> tuple[float, float]:
    """Return the RMS of force (N) and torque (Nm) over rows and axes."""
    return float(np.sqrt(np.mean(np.square(wrench[:, :3])))), float(
        np.sqrt(np.mean(np.square(wrench[:, 3:])))
    )


@dataclass(frozen=True, eq=False)
class Judged:
    """What acts on flights, and what is left.

    Attributes:
        setting: coefficients of the effects; under no name what the sensors have.
        balance: the residual with them.
        effects: in the order in which they were found.
        remainder: of the residual, as in ``Diagnosis``.
        structure: signs of structure in it, the strongest first.
        candidates: effects that were tried alone, the best first.
        notes: sentences.
        doubts: why names are tentative, by the check that says so.
        hidden: effects that would show if the errors of an IMU were known.
        unseen: effects of which these flights would not show a typical size.
        gusts: disturbances of each channel.
        pushes: transient disturbances.
        ranking: the posterior.
        probabilities: of what was found.
    """

    setting: Setting
    balance: Balance
    effects: tuple[NamedEffect, ...]
    remainder: str
    structure: tuple[Structure, ...]
    candidates: tuple[Candidate, ...]
    notes: tuple[str, ...] = ()
    doubts: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    hidden: frozenset[str] = frozenset()
    unseen: frozenset[str] = frozenset()
    gusts: tuple[Disturbance, ...] = ()
    pushes: tuple[TransientDisturbance, ...] = ()
    ranking: Ranking | None = None
    probabilities: Probabilities = field(default_factory=lambda: Probabilities({}, (), math.nan))
