"""Whether an effect that explains a residual acts on the vehicle, or is a feedback-induced
correlation.

The flight loop counteracts every disturbance, so rotors, attitude and velocity follow it, and an
effect that depends on one of them seems to explain it. The innovations of a filter that knows how
disturbances last tell the two apart: past poses do not predict them, so the loop cannot have
reacted to them yet. A change of the model is asked which share of it the innovations confirm: all
of it if it is an effect, none if it is a feedback-induced correlation, whatever the loop. (With a
noise model, prediction errors identify in closed loop: L. Ljung, System Identification, 2nd
edition, 1999, section 13.4.)
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from ...dynamics.effects import get
from ..motion.inertial_signals import InertialSignals
from ..motion.sensing_effects import undo_log_sensing
from ..motion.signals import log_signals
from .disturbance_filter import (
    DISTURBANCE,
    disturbance_variance,
    innovations,
    likeliest_disturbance,
)
from .gram_matrix import Gram, priors_and_ranges
from .regression import (
    Column,
    Flights,
    Piece,
    Setting,
    coefficient,
    is_delay,
    typical_size,
)
from .time_offsets import ROTOR_TIME_OFFSET

Array = NDArray[np.float64]


@dataclass(frozen=True)
class InnovationSettings:
    """How much of a change of the model the innovations must confirm."""

    # share of the change; effects have 0.8 to 1.4, feedback-induced correlations -5 to 0.2, one had
    # 0.53
    least_confirmed_share: float = 0.65
    # log-likelihood ratio (twice the gain of the log-likelihood); chance alone gives one an axis
    least_log_likelihood_ratio: float = 20.0
    settling_time: float = 1.0  # s, from the start of a piece to the first innovation that counts
    grid_margin: float = 1.0  # in the logarithm, around the best point of a grid
    derivative_step: float = 0.1  # typical sizes, over which derivatives are taken
    least_sum: float = 1e-300  # against a division by zero


INNOVATIONS = InnovationSettings()


class Innovations:
    """What flights confirm of changes of a model.

    Args:
        flights: whose rotors are measured.
        setting: the effects of the model.
    """

    def __init__(self, flights: Flights, setting: Setting) -> None:
        self._flights, self._setting = flights, setting
        self._poses: dict[int, tuple[Piece, Array]] = {}
        self._motions = self._motions_of(setting)
        self._counts = []
        rows = np.split(flights.fit_rows, np.flatnonzero(flights.start)[1:])
        for piece, fit in zip(flights.pieces(setting), rows, strict=True):
            t, k = piece.signals.t, np.arange(len(piece.signals.t))
            near = fit[np.searchsorted(piece.rows, k).clip(max=len(fit) - 1)]
            self._counts.append(
                near & (t > t[0] + INNOVATIONS.settling_time) & (k <= piece.rows[-1])
            )
        self._count = sum(int(np.count_nonzero(x)) for x in self._counts)

    def confirm(
        self, after: Setting, least: float = INNOVATIONS.least_log_likelihood_ratio
    ) -> bool:
        """Return whether innovations confirm the change to the effects ``after``, with a
        log-likelihood ratio of at least ``least``.

        They object to nothing where the pose was filtered: its noise then lasts, and past poses
        predict it.
        """
        return self._flights.filtered or _confirmed(*self.confirmed_share(after), least)

    def confirmed_share(self, after: Setting) -> tuple[float, float]:
        """Return the share of that change that minimises the innovations, and its log-likelihood
        ratio.
        """
        return self._share(
            [
                new - old
                for old, new in zip(
                    self._motions,
                    self._motions_of(self._with_rotor_time_offset(after)),
                    strict=True,
                )
            ]
        )

    def confirm_column(self, column: Array) -> bool:
        """Return whether they confirm a change of the model's force (N, world) and torque (Nm,
        body) at the rows (rows, 6).
        """
        if self._flights.filtered:
            return True
        changes = []
        parts = np.split(column, np.flatnonzero(self._flights.start)[1:])
        for motion, piece, part in zip(
            self._motions, self._flights.pieces(self._setting), parts, strict=True
        ):
            change = np.zeros_like(motion)
            at = np.arange(motion.shape[1]).clip(piece.rows[0], piece.rows[-1])
            change[1] = self._accelerations(CubicSpline(piece.rows, part)(at))
            changes.append(change)
        return _confirmed(*self._share(changes))

    def gram(self, columns: Sequence[Column]) -> Gram:
        """Return the regression of the innovations on coefficients, in one block, each axis by its
        standard deviation.

        The disturbances are the likeliest ones of the innovations as they are.
        """
        slopes = [self._slope(column) for column in columns]
        total = np.zeros((len(columns) + 1, len(columns) + 1))
        for axis in range(6):
            parts = [
                np.stack([*(slope[i][..., axis] for slope in slopes), -motion[..., axis]], axis=-1)
                for i, motion in enumerate(self._motions)
            ]
            products = self._products([part[..., -1:] for part in parts], axis)
            strength, time = likeliest_disturbance(
                lambda *disturbance, of=products: float(of(*disturbance)[0, 0])
            )
            sums = self._sums(
                parts, float(DISTURBANCE.strengths[strength]), float(DISTURBANCE.times[time]), axis
            )
            total += sums * self._count / max(sums[-1, -1], INNOVATIONS.least_sum)
        return Gram(
            tuple(columns),
            np.zeros((0, 6, len(total))),
            np.zeros(1, dtype=np.intp),
            total[None],
            *priors_and_ranges(self._flights, self._setting, columns),
        )

    def _slope(self, column: Column) -> list[Array]:
        """Return what a unit of a coefficient adds to the motions (2, n, 6)."""
        effect, name = column
        own = self._flights.coefficients(self._setting, effect)
        value, delta = (
            own.get(name, 0.0),
            INNOVATIONS.derivative_step * typical_size(column, self._flights.vehicle),
        )
        if (
            effect
            and not coefficient(column).minimum <= value + delta <= coefficient(column).maximum
        ):
            delta = -delta
        after = {**self._setting, effect: {**own, name: value + delta}}
        return [
            (new - old) / delta
            for new, old in zip(
                self._motions_of(self._with_rotor_time_offset(after)), self._motions, strict=True
            )
        ]

    def disturbances(self) -> list[tuple[float, float]]:
        """Return the RMS (N in the world, Nm in the body) and the correlation time (s) of the
        likeliest disturbances of each of the six channels.

        An effect that the model lacks counts as a disturbance too. The rounding steps of rotor
        speeds look like fast disturbances.
        """
        inertias = [self._flights.vehicle.mass] * 3 + np.diagonal(
            self._flights.vehicle.inertia
        ).tolist()
        return [
            self._disturbance([-motion[..., [axis]] for motion in self._motions], inertia, axis)
            for axis, inertia in enumerate(inertias)
        ]

    def _disturbance(
        self, motions: Sequence[Array], inertia: float, axis: int
    ) -> tuple[float, float]:
        period = self._flights.pieces(self._setting)[0].signals.period
        products = self._products(motions, axis)
        i, j = likeliest_disturbance(lambda strength, time: float(products(strength, time)[0, 0]))
        begun = np.log([DISTURBANCE.strengths[i], DISTURBANCE.times[j]])

        def loss(x: Array) -> float:
            strength, time = np.exp(x).tolist()
            return float(np.log(self._sums(motions, strength, time, axis)[0, 0]))

        near = INNOVATIONS.grid_margin * np.array([-1.0, 1.0])
        best = minimize(
            loss,
            begun,
            method="Nelder-Mead",
            bounds=[begun[0] + near, begun[1] + near],
            options={"xatol": 0.05, "fatol": 1.0 / self._count},
        )
        strength, time = np.exp(best.x).tolist()
        return inertia * math.sqrt(
            disturbance_variance(
                math.exp(best.fun) / self._count, strength, time, period, self._integrals(axis)
            )
        ), time

    def _share(self, changes: Sequence[Array]) -> tuple[float, float]:
        """Return the share of changes of the motions that minimises the innovations, over all axes,
        and its log-likelihood ratio.

        Each axis has a disturbance of its own, an Ornstein-Uhlenbeck acceleration. Its strength and
        correlation time are the likeliest ones, once together with a share and once without: the
        ratio is what the share gains over other disturbances.
        """
        axes = [
            self._axis(
                [
                    np.stack([-motion[..., axis], change[..., axis]], axis=-1)
                    for motion, change in zip(self._motions, changes, strict=True)
                ],
                axis,
            )
            for axis in range(6)
            if any(np.any(change[..., axis]) for change in changes)
        ]
        cross, square = (sum(x[row, 1] / _unexplained(x) for x, _ in axes) for row in (0, 1))
        share = float(cross / max(square, INNOVATIONS.least_sum))
        rest = np.array([-1.0, share])
        ratio = self._count * sum(
            float(
                np.log(
                    max(y[0, 0], INNOVATIONS.least_sum)
                    / max(rest @ x @ rest, INNOVATIONS.least_sum)
                )
            )
            for x, y in axes
        )
        return share, ratio

    def _axis(self, both: Sequence[Array], axis: int) -> tuple[Array, Array]:
        """Return the sums of products (2, 2) of one axis' innovations and of a change's, of which
        each piece is (2, n, 2).

        Once with the likeliest disturbance of both, once with that of the innovations alone.
        """
        products = self._products(both, axis)
        found = [
            products(
                *likeliest_disturbance(lambda *disturbance: _unexplained(products(*disturbance)))
            ),
            products(
                *likeliest_disturbance(lambda *disturbance: float(products(*disturbance)[0, 0]))
            ),
        ]
        return min(found, key=_unexplained), min(found, key=lambda x: float(x[0, 0]))

    def _products(self, motions: Sequence[Array], axis: int) -> Callable[[int, int], Array]:
        """Return a function of disturbances that gives the sums of products (c, c) of innovations;
        each piece is (2, n, c).
        """

        @cache
        def products(strength: int, time: int) -> Array:
            return self._sums(
                motions,
                float(DISTURBANCE.strengths[strength]),
                float(DISTURBANCE.times[time]),
                axis,
            )

        return products

    def _integrals(self, axis: int) -> int:
        """Return how often what is measured of an axis is the acceleration integrated."""
        return (0 if axis < 3 else 1) if self._flights.inertial else 2

    def _sums(self, motions: Sequence[Array], strength: float, time: float, axis: int) -> Array:
        pieces = self._flights.pieces(self._setting)
        found = [
            innovations(
                measured, drive, strength, time, piece.signals.period, self._integrals(axis)
            )[counted]
            for (measured, drive), piece, counted in zip(motions, pieces, self._counts, strict=True)
        ]
        return np.asarray(sum(x.T @ x for x in found))

    def _with_rotor_time_offset(self, after: Setting) -> Setting:
        """Return ``after`` with a change of the clock made by a rotor time offset: moving the poses
        would move their noise as well.
        """
        for effect in [e for e in after if e and is_delay(e) and get(e).kind == "sensing"]:
            name = get(effect).coefficients[0].name
            own = self._flights.coefficients(self._setting, effect)
            offsets = dict(after.get(ROTOR_TIME_OFFSET[0], {}))
            offsets[ROTOR_TIME_OFFSET[1]] = (
                offsets.get(ROTOR_TIME_OFFSET[1], 0.0) + after[effect][name] - own.get(name, 0.0)
            )
            after = {
                **{k: v for k, v in after.items() if k != effect},
                ROTOR_TIME_OFFSET[0]: offsets,
                **({effect: own} if own else {}),
            }
        return after

    def _motions_of(self, setting: Setting) -> list[Array]:
        """Return for each piece (2, n, 6) the pose as measured, and the model's acceleration,
        linear (world) and angular (body). Of an IMU it is its acceleration and angular velocity.

        The pose's angle (rad) is the sum of its rotations. The attitude is always the same: a
        gain of the attitude would make the innovations small by removing their own noise.
        """
        out = []
        pieces = self._flights.pieces(setting)
        for piece, like, model in zip(
            pieces, self._flights.pieces(self._setting), self._flights.model(setting), strict=True
        ):
            pose = np.column_stack(
                [self._raw(setting, piece)[:, :3], self._raw(self._setting, like)[:, 3:]]
            )
            begun = np.concatenate([like.signals.velocity[0], like.signals.angular_velocity[0]])
            if self._flights.inertial:  # what is measured is no pose
                begun[:] = 0.0
            fallen = self._flights.vehicle.gravity * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
            out.append(
                np.stack(
                    [
                        pose - np.outer(piece.signals.t - piece.signals.t[0], begun),
                        self._accelerations(model) - fallen,
                    ]
                )
            )
        return out

    def _raw(self, setting: Setting, piece: Piece) -> Array:
        """Return the pose (n, 6) of a piece, from its start, without the low-pass, which uses the
        future.
        """
        if isinstance(piece.signals, InertialSignals):
            return piece.signals.measured
        if id(piece) not in self._poses:
            log = undo_log_sensing(self._flights.logs[piece.log], self._flights.amended(setting))
            signals = next(s for s in log_signals(log, np.inf) if s.t[0] == piece.signals.t[0])
            turned = Rotation.from_matrix(signals.rotation)
            angle = np.vstack(
                [np.zeros(3), np.cumsum((turned[:-1].inv() * turned[1:]).as_rotvec(), axis=0)]
            )
            self._poses[id(piece)] = (
                piece,
                np.column_stack([signals.position - signals.position[0], angle]),
            )
        return self._poses[id(piece)][1]

    def _accelerations(self, wrench: Array) -> Array:
        """Return the linear and the angular acceleration (n, 6) of a force and a torque (n, 6)."""
        vehicle = self._flights.vehicle
        return np.column_stack(
            [wrench[:, :3] / vehicle.mass, np.linalg.solve(vehicle.inertia, wrench[:, 3:].T).T]
        )


def _confirmed(
    share: float, ratio: float, least: float = INNOVATIONS.least_log_likelihood_ratio
) -> bool:
    return share > INNOVATIONS.least_confirmed_share and ratio > least


def confirms_addition(
    flights: Flights,
    before: Setting,
    after: Setting,
    least: float = INNOVATIONS.least_log_likelihood_ratio,
) -> bool:
    """Return whether innovations confirm what a fit has beyond a smaller one, with a log-likelihood
    ratio of at least ``least``.

    Both have the time offsets of ``after``: disturbances bias these, and they are not asked about.
    """
    offsets = {ROTOR_TIME_OFFSET[0]: after.get(ROTOR_TIME_OFFSET[0], {})}
    return Innovations(flights, {**before, **offsets}).confirm({**after, **offsets}, least)


def _unexplained(products: Array) -> float:
    """Return the sum of squares of innovations that the best multiple of a change leaves, from
    their sums of products (2, 2).
    """
    return max(
        float(products[0, 0] - products[0, 1] ** 2 / max(products[1, 1], INNOVATIONS.least_sum)),
        INNOVATIONS.least_sum,
    )
