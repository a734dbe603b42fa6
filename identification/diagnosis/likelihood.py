"""The likelihood of a flight's poses as a regression of whitened innovations: one Gram matrix.

Everything a model may lack is a column: a unit of a coefficient, through the same causal filter as
the poses. The noise of each axis is fitted first, at maximum likelihood. With this noise the
innovations are white. Sums of products then give the log-likelihood of any set of coefficients near
the setting.
"""

import functools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from ... import _core
from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import EffectSetting, Vehicle
from ...runtime.errors import InputError
from ..findings import CHANNELS, Disturbance
from ..logs.flight_log import FlightLog, Logs
from ..logs.table import Array, Mask
from ..motion.sensing_effects import sensing_of, undo_log_sensing
from ..motion.sensor_noise import sensor_noise
from ..motion.signals import Signals, in_body, log_signals
from ..motion.smoothing import continuous, filtered, turn_between
from .causal_filter import FlightState, Poses, Track, level, run
from .column import Column, Part
from .discrepancy import (
    Columns,
    Product,
    along_axis,
    changing_columns,
    discrepancy_columns,
    joined,
    variables,
)
from .gusty_wind import gusts
from .log_offsets import (
    ATTITUDE_TIME_OFFSET,
    LAG_ASYMMETRY,
    ROTOR_TIME_OFFSET,
    with_time_offsets,
)
from .noise_search import FIRST_TIME, SETTLING_TIME, NoiseSearch
from .priors import (
    GAINS,
    MODEL_ERROR,
    Base,
    Setting,
    Starts,
    in_prior_units,
    variants_of,
)
from .regression import (
    BLOCK,
    CENTRAL,
    STEP,
    RegressedFlights,
    is_delay,
    typical_size,
    without,
)
from .rotor_innovations import DRIVEN, rotor_innovations, unrounded
from .steady_filter import OWN, PAIRS, PoseNoise, SteadyFilter, steady_filter

STATES = (0, 1, 2)  # pose, rate and disturbance of an axis
# rad of tilt for a rad/s2 of roll or pitch: the unit of gains of sideways states
SIDEWAYS = 0.01
FIRST_DISTURBANCE = 0.3  # m/s2 and rad/s2, where the search for the noise begins
# (6, 3, 4) whether an axis jumps by thrust, torque or turn, for each of thrust and torques
DRIVES = np.zeros((6, 3, len(DRIVEN)))
DRIVES[:3, 0, 0] = DRIVES[[3, 4, 5], 1, [1, 2, 3]] = 1.0
NO_SHARES, NO_SLOPES = np.empty((6, 3, 0)), np.empty((6, 7, 0))
# the state that jumps, by the gains of a pair on the rotors' innovations: thrust, torque, turn
JUMP_STATE = np.tile(STATES, 3)


class Likelihood:
    """The likelihood of flights with measured rotors near a setting of coefficients.

    Args:
        flights: the vehicle's flights.
        setting: the coefficients, about which the model is linearised.
        near: the likelihood of the same flights near another setting. The search for the noise
            begins at its noise; default: at the sensor noise of the first log.
        same_noise: take that noise without a search, and the columns any flight may have.
        gusty: a wind changes beside its mean; with ``same_noise`` as near.
    """

    def __init__(
        self,
        flights: RegressedFlights,
        setting: Setting,
        near: "Likelihood | None" = None,
        same_noise: bool = False,
        gusty: bool = False,
    ) -> None:
        self.flights = flights
        self.gusty: bool = near.gusty if near and same_noise else gusty
        self.setting = setting
        self.vehicle = flights.amended(setting)
        # of each piece: the rounding error of its logged rotor speeds (n, 4), which is added back,
        # and the rotors' innovations, by a filter that follows the pose closely
        self.finer: list[Array] = []
        if near:
            self.finer = near.finer
            self.answers: list[Array] = near.answers
            self.tracks: list[Track] = near.tracks
            self.pieces: list[Poses] = near.pieces
            self.noise: PoseNoise = near.noise
            self.gains: Array = near.gains  # on the rotors' innovations
        if not near or sensing_of(near.vehicle) != sensing_of(self.vehicle):
            finer = iter(self.finer)
            self.pieces = [
                piece
                for log in np.unique(flights.log[flights.fit_rows]).tolist()
                for piece in _read_poses(flights.logs, log, self.vehicle, finer)
            ]
        self.period = self.pieces[0].period
        self._counts = [self._counted(piece) for piece in self.pieces]  # samples in the fit
        if not near:
            self.noise = self._first_noise()
            self.gains = np.zeros((len(PAIRS), len(JUMP_STATE)))
            self._see_rotors()
        if near and (same_noise or gusty):
            self._run(self.steady, self._jumps(), self.gains)
            if np.isnan([track.predicted[-1] for track in self.tracks]).any():
                raise np.linalg.LinAlgError("the filter diverges with these effects")
        else:
            self._search_noise()
        self.signals = [_signals(piece, track) for piece, track in self._seen]
        self._base = self._accelerations(setting, self.signals)
        # the effect of a unit of each column on the accelerations, or on the measured pose (n, 6),
        # of all pieces in turn, kept once computed. Columns any flight may have change little with
        # effects
        self._acting: Columns = {}
        self._posed: Columns = {}
        if near and same_noise:
            self._acting, self._posed = (
                {c: x for c, x in part.items() if not c.effect and not c.is_unknown}
                for part in (near._acting, near._posed)
            )
        else:
            self._add_what_any_flight_may_have()
        if self.gusty:
            self._add_gusts()
            if not same_noise:
                base = self.base((), {})
                drawn = base.mode(base.plain, draw=True).items()
                blown = {c: x for c, (x, _) in drawn if c.part == Part.GUST}
                self._search_noise(self._explained(blown))

    @functools.cached_property
    def _state(self) -> tuple[FlightState, Array]:
        """All pieces, one after the other, and their ends without the last."""
        return joined(self.tracks)

    @property
    def _seen(self) -> list[tuple[Poses, Track]]:
        return list(zip(self.pieces, self.tracks, strict=True))

    def _see_rotors(self) -> None:
        nothing = [np.zeros((len(piece.t), 6, 3)) for piece in self.pieces]
        self._run(self.steady, nothing, self.gains)
        if self._rounding_std:
            self.finer = unrounded(self._seen, self.vehicle.omega_lsb)
            self.pieces = [
                replace(piece, rotor_speeds=piece.rotor_speeds + x)
                for piece, x in zip(self.pieces, self.finer, strict=True)
            ]
            self._run(self.steady, nothing, self.gains)
        self.answers = rotor_innovations(self._seen)

    @property
    def steady(self) -> SteadyFilter:
        """The filter."""
        return steady_filter(self.noise, self.period, self.vehicle.gravity)

    def _run(self, steady: SteadyFilter, jumps: Iterable[Array], gains: Array) -> None:
        each = (OWN @ gains).reshape(6, -1, len(STATES)) * self._units
        # of each piece, the jumps of the states (n, 6, 3) by the rotors' innovations
        self.known = [(x.swapaxes(0, 1) @ each).swapaxes(0, 1) for x in jumps]
        self.tracks = [
            run(piece, self.vehicle, steady, x)
            for piece, x in zip(self.pieces, self.known, strict=True)
        ]

    # Noise

    def _first_noise(self) -> PoseNoise:
        floor = sensor_noise(self.flights.logs[0], self.vehicle)
        return PoseNoise(
            np.repeat([max(floor.position, 1e-6), max(floor.attitude, 1e-6)], 3),
            np.repeat([FIRST_DISTURBANCE, 10.0 * FIRST_DISTURBANCE], 3),
            np.full(6, FIRST_TIME),
            self._rounding(),
        )

    @property
    def _rounding_std(self) -> float:
        """Standard deviation of the rounding of a rotor speed, rad/s."""
        known = self.vehicle.omega_source == "measured"
        return self.vehicle.omega_lsb / math.sqrt(12.0) if known else 0.0

    def _rounding(self) -> Array:
        """Return the standard deviation of the accelerations (6,) by the rounding of rotor
        speeds: m/s2 and rad/s2.
        """
        speeds = np.concatenate([p.rotor_speeds for p in self.pieces]).mean(axis=0)
        off = self._rounding_std * np.vstack([np.zeros(4), np.eye(4)])
        wrenches = self.vehicle.rotor_wrench(speeds + off)
        # between two samples the mean of both counts
        wrench = np.sqrt(np.sum(np.square(wrenches[1:] - wrenches[0]), axis=0) / 2.0)
        return np.maximum(np.array([0.0, 0.0, *wrench]) / self.flights.inertias, 1e-9)

    def _search_noise(self, explained: Array | None = None) -> None:
        """Take the likeliest noise, and the likeliest gains on the rotors' innovations.

        Args:
            explained: (n, 2, 6) known changes of the pose and of the acceleration beside the model.
        """
        jumps = self._jumps()
        own = np.einsum("ap,kl,s->akpls", OWN, np.eye(3), self._units).reshape(6, 3, -1)

        def see(steady: SteadyFilter, gains: Array) -> Array:
            self._run(steady, jumps, gains)
            if explained is not None:
                pose, force = map(_whole, explained.swapaxes(0, 1))
                each = self._changes(steady, jumps, [force], [pose], every=True)
                rows = np.concatenate([x for _, x in each])
                left = (rows[:, 1] - rows[:, 0]).reshape(-1, 6) @ np.linalg.inv(steady.whitening).T
                parts = zip(self.tracks, np.split(left, self._state[1]), strict=True)
                self.tracks = [replace(track, innovations=x) for track, x in parts]
            counted = np.concatenate(self._counts)
            return np.concatenate([track.innovations for track in self.tracks])[counted]

        def products(steady: SteadyFilter, slopes: Array) -> Array:
            each = self._changes(steady, jumps, shares=own, slopes=slopes)
            return functools.reduce(np.add, (x.T @ x for _, x in each))

        held = np.array(GAINS)[JUMP_STATE]
        search = NoiseSearch(see, products, held, self.period, self.vehicle.gravity)
        self.noise, self.gains = search.likeliest(self.noise, self.gains)
        self._run(self.steady, jumps, self.gains)

    def _counted(self, piece: Poses) -> Mask:
        """Return the samples of a piece in the fit, like the rows of their block."""
        rows = np.flatnonzero(self.flights.log == piece.log)
        at = np.searchsorted(self.flights.t[rows], piece.t).clip(max=len(rows) - 1)
        out: Mask = self.flights.fit_rows[rows[at]]
        out[: round(SETTLING_TIME / self.period)] = False
        return out

    def gusts(self) -> tuple[Disturbance, ...]:
        """Return the disturbance of each channel. The rotors show a part: a flight loop on a gyro
        answers most of a gust's torque before the pose shows any.
        """
        keep = self.steady.keep.tolist()
        shown = [
            np.concatenate([filtered(x[:, i, 2], (1, 0, 0, 1, -keep[i], 0)) for x in self.known])
            for i in range(6)
        ]
        size = self.flights.inertias * self.noise.disturbance
        whole = np.hypot(size, self.flights.inertias * np.std(shown, axis=1))
        each = np.transpose([whole, self.noise.time, size]).tolist()
        return tuple(Disturbance(c, *x) for c, x in zip(CHANNELS, each, strict=True))

    # Columns

    def _accelerations(self, setting: Setting, signals: Iterable[Signals]) -> Array:
        """Return the accelerations (n, 6) of a setting along the pieces' signals."""
        unit = replace(self.flights.vehicle, mass=1.0, inertia=np.eye(3))
        return np.concatenate([self.flights.acting(s, setting, body=unit) for s in signals])

    def _change(self, setting: Setting, units: float = 1.0) -> Array:
        """Return the change of the acceleration (n, 6) with a setting so many units away."""
        change = self._accelerations(setting, self.signals)
        change -= self._base
        change /= units
        return change

    def _add(self, column: Column) -> None:
        """Add a coefficient's column, unless it is there already or no such vehicle is possible."""
        effect = column.effect
        if column in self._acting or column in self._posed:
            return
        if effect and is_delay(effect):
            self._acting[column] = self._acting[ROTOR_TIME_OFFSET]
            return
        if effect and get(effect).kind == "sensing":
            self._posed[column] = _whole(self._moved(column))
            return
        with suppress(InputError, np.linalg.LinAlgError):
            change = self._slope(column)
            if effect and get(effect).role == Role.CENTRE_OF_MASS:
                self._swing(column, change)
            self._acting[column] = _whole(change)

    def _slope(self, column: Column) -> Array:
        """Return the change of the acceleration (n, 6) by a unit of a coefficient."""
        own = dict(self.flights.coefficients(self.setting, column.effect))
        if column.part == Part.AT_CENTRE:
            own[CENTRAL] = 1.0
        value, delta = self.flights.step(self.setting, column)
        own[column.coefficient] = value + delta
        return self._change({**self.setting, column.effect: own}, delta)

    def _moved(self, column: Column) -> Array:
        """Return how far a unit of a sensing effect moves the pose (n, 6), at the filter's
        predicted pose. So the column holds no noise of the measured pose.
        """
        delta = STEP * typical_size(column, self.flights.vehicle)
        setting = EffectSetting(column.effect, {column.coefficient: delta})
        vehicle = replace(self.flights.vehicle, effects=(setting,))
        out = []
        for piece, track in self._seen:
            log = FlightLog(
                piece.t, track.predicted[:, :3], track.predicted[:, 3:], piece.rotor_speeds
            )
            undone = undo_log_sensing(log, vehicle)
            moved = np.zeros((len(piece.t), 6))
            moved[:, :3] = undone.position - log.position
            if (undone.quaternion != log.quaternion).any():
                moved[:, 3:] = turn_between(log.quaternion, undone.quaternion)
            out.append(moved)
        return np.concatenate(out) / delta

    def base(self, library: Iterable[str], starts: Starts, unknown: bool = False) -> Base:
        """Return the likelihood of the coefficients of effects, and of everything any flight may
        have, with all columns of earlier calls.

        Args:
            library: names of effects. Coefficients fixed by the vehicle's file are not fitted.
            starts: columns of whole effects, with the coefficients of each.
            unknown: whether the discrepancy's columns are wanted.
        """
        acting = self._acting
        if playing(Role.LAG, among=self.setting):
            self._add(LAG_ASYMMETRY)
        if unknown and not any(c.is_unknown for c in acting):
            acting |= discrepancy_columns(*self._state, self.flights)
            self._add_changing_coefficients()
        for c, start in starts.items():
            if c not in acting:
                acting[c] = _whole(self._change({**self.setting, c.effect: dict(start)}))
        for effect in library:
            for columns in variants_of(self.flights, effect, self.setting, starts):
                for c in columns:
                    self._add(c)
        return self._products(starts)

    def _add_changing_coefficients(self) -> None:
        """Add the dictionary's columns: effects of the setting with changing coefficients."""
        parts = {}
        poses = {}
        for effect, own in self.setting.items():
            if get(effect).kind == "sensing" and not is_delay(effect):
                moved = [x * self._moved(Column(effect, name)) for name, x in own.items()]
                poses[effect] = np.sum(moved, axis=0)
            else:
                parts[effect] = -self._change(without(self.setting, effect))
        followed = variables(self._state[0])
        self._acting |= changing_columns(parts, followed)
        self._posed |= changing_columns(poses, followed)

    def _add_what_any_flight_may_have(self) -> None:
        """Add the columns of time offsets, of rotors between samples and of the model's error."""
        self._add(ROTOR_TIME_OFFSET)
        bent = []  # away from the straight line, by the second difference
        for s in self.signals:
            # the speeds are of k + 1/2: nothing later than sample k + 1
            u = np.pad(np.diff(s.rotor_speeds, 2, axis=0), ((2, 0), (0, 0)))
            bent.append(replace(s, rotor_speeds=s.rotor_speeds + u))
        change = self._accelerations(self.setting, bent) - self._base
        self._acting[Column("", "", Part.BETWEEN_SAMPLES)] = _whole(change)
        self._add_model_errors()
        self._add_answers()
        moved = []
        for track in self.tracks:
            # the rate before the sample is read: the rate after holds the sample's noise
            rate = track.angular_velocity + 0.5 * self.period * track.acceleration[:, 3:]
            rate = np.vstack([track.angular_velocity[:1], rate[:-1]])
            moved.append(np.column_stack([np.zeros_like(rate), -rate]))
        self._posed[ATTITUDE_TIME_OFFSET] = _whole(np.concatenate(moved))

    def _add_gusts(self) -> None:
        """Add the columns of a wind's changes."""
        t = self.period * np.arange(len(self._base), dtype=np.float64)
        for wind, shape in gusts(t, self.setting, self.flights).items():
            slope = self._slope(wind)[:, :3]
            for k, x in enumerate(shape.T):
                column = Column("", wind.coefficient, Part.GUST, k)
                self._acting[column] = Product(1.0, x, slope)

    def quieter(self, coefficients: Mapping[Column, float], starts: Starts) -> Base:
        """Return the likelihood of the same columns, with the likeliest noise beside them all at
        these coefficients.

        An unknown effect's deviance counts as a disturbance. Beside the whole library the noise is
        the noise of a flight without unknown effects.
        """
        out = copy(self)
        out._search_noise(self._explained(coefficients))
        out.tracks = [
            replace(
                track,
                heading=x.heading,
                innovations=x.innovations,
                disturbance=x.disturbance,
            )
            for track, x in zip(self.tracks, out.tracks, strict=True)
        ]
        return out._products(starts)

    def _explained(self, coefficients: Mapping[Column, float]) -> Array:
        """Return the change of the pose and of the acceleration (n, 2, 6)."""
        whole, _ = self._state
        x = np.zeros((len(whole.t), 2, 6))
        for i, columns in enumerate((self._posed, self._acting)):
            for c, column in columns.items():
                if c in coefficients:
                    x[:, i] += coefficients[c] * column.whole
        x[:, 1, :3] += whole.rotors[:, :1] * (
            x[:, 0, 4:5] * whole.rotation[:, :, 0] - x[:, 0, 3:4] * whole.rotation[:, :, 1]
        )
        return x

    def _swing(self, column: Column, change: Array) -> None:
        """Have a centre of mass move the measured point like a marker as far on the other side; its
        torque alone acts.

        As a force, the swing of the point about the centre would be two columns: the model's
        angular acceleration and the filter's attitude. Their difference is noise and would fit the
        poses' own noise. With equal offsets of both, only the torque of the thrust remains.
        """
        change[:, :3] = 0.0
        axis = [c.name for c in get(column.effect).coefficients].index(column.coefficient)
        (marker,) = playing(Role.MARKER)
        moved = -self._moved(Column(marker, get(marker).coefficients[axis].name))
        self._posed[column] = _whole(moved)

    def _add_model_errors(self) -> None:
        """Add the columns of slightly larger forces and torques, and of the torques expected from
        the flight loop's answer to the state.

        Rounding biases an expected torque low, by its share of the variance (errors in variables):
        a hover holds little torque, and rounding hides it.
        """
        rounded = 2.0 * np.square(self._rounding()[3:])
        whole, _ = self._state
        expected = whole.rotors[:, 1:] - np.concatenate(self.answers)[:, 1:]
        share = rounded / np.maximum(expected.var(axis=0), rounded)
        scale = np.hypot(1.0, share / MODEL_ERROR)
        for i, axis in enumerate("xyz"):
            own = along_axis(3 + i, whole.rotation)
            errors = {
                "force": Product(1.0, whole.rotors[:, 0], *along_axis(i, whole.rotation)),
                "torque": Product(1.0, whole.rotors[:, 1 + i], *own),
                "expected torque": Product(scale[i], expected[:, i], *own),
            }
            for name, x in errors.items():
                self._acting[Column("", f"{name} {axis}", Part.MODEL_ERROR)] = x

    def _add_answers(self) -> None:
        """Add the columns of a flight loop's answers to disturbances: along thrust and torques,
        their changes, and the state of each axis.

        A loop on a gyro answers a disturbance before the pose shows any. This part of the rotors'
        wrench causes no motion, and is no sign of an effect. The loop is unknown: each of its
        signals may have a share of the part, at most the disturbance's share of the variance.
        (Unknown linear feedback: L. Ljung, System Identification, 2nd edition, 1999, section 13.4.)
        """
        whole, _ = self._state
        rate = whole.angular_velocity
        body = in_body(whole.velocity, whole.rotation)
        tilt = whole.rotation[:, 2]
        states = (
            (body[:, 2],),
            (rate[:, 0], rate[:, 1] * rate[:, 2], tilt[:, 1], body[:, 1]),
            (rate[:, 1], rate[:, 2] * rate[:, 0], tilt[:, 0], body[:, 0]),
            (rate[:, 2], rate[:, 0] * rate[:, 1]),
        )
        disturbed = np.array([gust.rms for gust in self.gusts()]) / self.flights.inertias
        for axis, rotors, own in zip(DRIVEN, whole.rotors.T, states, strict=True):
            size = max(rotors.std(), 1e-9)
            answer = min((disturbed[axis] / size) ** 2, 1.0) * size
            change = np.diff(rotors, prepend=rotors[:1])
            along = along_axis(axis, whole.rotation)
            for i, x in enumerate((rotors - rotors.mean(), change, *own)):
                column = Product(answer / max(x.std(), 1e-9), x, *along)
                self._acting[Column("", f"answer {i} of axis {axis}", Part.NUISANCE)] = column

    def _jumps(self) -> list[Array]:
        """Return the accelerations (n, 6, 3) of each piece for a unit of the gains of a pair of
        axes on thrust, on torque and on the turn; ``_units`` makes jumps of the states.

        Thrust and torques inform about the axes they drive. A loop that rolls or pitches the
        vehicle has seen its position and the force aside.
        """
        out = []
        tilt = SIDEWAYS * self.flights.vehicle.gravity
        for answer, track in zip(self.answers, self.tracks, strict=True):
            # the innovation of sample k changes the state after k: the jump is before sample k + 1
            answer = np.pad(answer[:-1], ((1, 0), (0, 0)))
            x = np.zeros((len(answer), 6, 3))
            x[:, :3, 0] = answer[:, :1] * track.rotation[:, :, 2]
            x[:, 3:, 1] = level(track.heading, answer[:, 1:])
            x[:, :2, 2] = tilt * x[:, 4:2:-1, 1]
            out.append(x)
        return out

    @property
    def _units(self) -> Array:
        """The states (3,) after a period of one m/s2 or rad/s2."""
        return np.array([self.period**2, self.period, 1.0])

    def _products(self, starts: Starts) -> Base:
        moved = self._posed
        steady = self.steady
        asked = (*(c for c in self._acting if c not in moved), *moved)
        # the gains on axes the rotors do not drive stay as fitted
        drives = [
            Column("", f"axis {axis}", Part.GAIN, state) for axis in DRIVEN for state in STATES
        ]
        shares = (DRIVES[..., None] * self._units).reshape(6, 3, -1)
        n = len(self._base)
        still = Product(0.0, Product.ones(n), Product.ones(n, 1))
        x = [self._acting.get(c, still) for c in asked]
        each = self._changes(steady, self._jumps(), x, [*moved.values()], shares)
        blocks = ((log, rows.T @ rows) for log, rows in each)
        samples = np.concatenate(self._counts).sum()
        penalty = float(samples * np.linalg.slogdet(steady.covariance)[1])
        names = (*asked, *drives)
        return in_prior_units(self.flights, names, blocks, penalty, self.setting, starts)

    def _changes(
        self,
        steady: SteadyFilter,
        jumps: Sequence[Array],
        acting: Sequence[Product] = (),
        moved: Sequence[Product] = (),
        shares: Array = NO_SHARES,
        slopes: Array = NO_SLOPES,
        every: bool = False,
    ) -> Iterator[tuple[int, Array]]:
        """Yield for each block of flight the index of its log, and the change of the predictions
        with each of c columns and the innovations, whitened (6 m, c + 1), of its m samples in the
        fit.

        Args:
            steady: the filter.
            jumps: (n, 6, 3) of each piece, as of ``_jumps``.
            acting: acceleration of the model by a unit of each of the first columns.
            moved: shift of the measured pose by a unit of the last of these.
            shares: (6, 3, e) of the jumps by a unit of the next columns, of the states in turn,
                before the pose of a sample is read.
            slopes: (6, 7, m) change of the gains of each axis, in the order of
                ``SteadyFilter.gain``, and of ``keep``, by a unit of the last columns.
            every: all samples count.
        """
        count = len(acting) + shares.shape[2] + slopes.shape[2]
        length = round(BLOCK / self.period)
        end = 0
        for piece, track, counts, jump in zip(
            self.pieces, self.tracks, self._counts, jumps, strict=True
        ):
            counted = counts | every
            state = np.zeros((6, 3, count))
            begun, end = end, end + len(counts)
            for begin in range(begun, end, length):  # one block's columns are in memory at a time
                rows = slice(begin, min(begin + length, end))
                at = slice(begin - begun, rows.stop - begun)
                out = np.empty((np.count_nonzero(counted[at]), 6, count + 1))
                _core.sensitivities(
                    self.period,
                    steady.gain,
                    steady.keep,
                    track.heading[at],
                    track.rotation[at],
                    track.rotors[at],
                    track.angular_velocity[at],
                    _twist(self.vehicle),
                    [x.part(rows) for x in acting],
                    [x.part(rows) for x in moved],
                    jump[at],
                    shares,
                    np.resize(STATES, shares.shape[2]),
                    slopes,
                    track.innovations[at],
                    track.disturbance[at],
                    steady.whitening,
                    counted[at],
                    state,
                    out,
                )
                if len(out):
                    yield piece.log, out.reshape(-1, count + 1)


def _whole(column: Array) -> Product:
    """Return a column (n, 6), without channels of zeros before and after the others."""
    used = np.flatnonzero(column.any(axis=0)).tolist() or [0]
    some = column[:, used[0] : used[-1] + 1].copy()
    return Product(1.0, Product.ones(len(column)), some, used[0])


def _twist(vehicle: Vehicle) -> Array:
    """Return the derivative (3, 3, 3) of the angular acceleration by the angular velocity, for a
    velocity of one about each axis.
    """
    # -u x J v over the inertia J, of all pairs of axes u and v
    twist = -np.cross(np.eye(3)[:, None], vehicle.inertia) @ np.linalg.inv(vehicle.inertia)
    return np.swapaxes(twist + twist.swapaxes(0, 1), 1, 2)


def _read_poses(logs: Logs, at: int, vehicle: Vehicle, finer: Iterator[Array]) -> list[Poses]:
    """Return the unbroken pieces of a log as measured, with the vehicle's sensing effects undone;
    ``finer`` is added to the rotor speeds (n, 4) of each.

    For late or early poses, rotor speeds are moved instead: moved poses would lose noise.
    """
    late = [e for e in sensing_of(vehicle) if is_delay(e.name)]
    offset = sum(sum(e.coefficients.values()) for e in late)
    undone = undo_log_sensing(
        logs[at], replace(vehicle, effects=tuple(e for e in vehicle.effects if e not in late))
    )
    out = []
    for raw, smooth in zip(log_signals(undone, np.inf), log_signals(undone), strict=True):
        q = Rotation.from_matrix(raw.rotation).as_quat(scalar_first=True)
        raw = replace(raw, rotor_speeds=raw.rotor_speeds + next(finer, 0.0))
        raw = with_time_offsets(raw, {ROTOR_TIME_OFFSET.coefficient: offset})
        out.append(
            Poses(
                raw.t,
                raw.period,
                raw.position,
                continuous(q),
                raw.rotor_speeds,
                np.zeros(len(raw.t)) if raw.voltage is None else raw.voltage,
                smooth.velocity[0],
                smooth.angular_velocity[0],
                at,
            )
        )
    return out


def _signals(piece: Poses, track: Track) -> Signals:
    """Return the flight as the filter sees it between samples, for the effect models."""
    speeds = piece.rotor_speeds
    between = 0.5 * (speeds + np.vstack([speeds[1:], speeds[-1:]]))
    return Signals(
        piece.t,
        piece.period,
        track.position,
        track.rotation,
        track.velocity,
        track.acceleration[:, :3],
        track.angular_velocity,
        track.acceleration[:, 3:],
        between,
        piece.voltage if piece.voltage.any() else None,
    )
