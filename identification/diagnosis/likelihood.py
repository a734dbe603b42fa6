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
from ..logs.flight_log import FlightLog
from ..logs.table import Array
from ..motion.sensing_effects import sensing_of, undo_log_sensing
from ..motion.sensor_noise import sensor_noise
from ..motion.signals import Signals, in_body, log_signals
from ..motion.smoothing import continuous, filtered, turn_between
from .causal_filter import Poses, level, run
from .column import Column, Part
from .discrepancy import (
    Columns,
    Product,
    along_axis,
    changing_columns,
    discrepancy_columns,
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
# shares of thrust, torque and turn in the jumps of an axis, by a unit of the gains: (6, 3, 9) of
# each pair on each of the three, and (6, 3, 4) of the axes driven by thrust and torques
OF_PAIRS = np.einsum("ap,kl->akpl", OWN, np.eye(3)).reshape(6, 3, -1)
OF_DRIVEN = np.zeros((6, 3, len(DRIVEN)))
OF_DRIVEN[:3, 0, 0] = OF_DRIVEN[[3, 4, 5], 1, [1, 2, 3]] = 1.0
NO_SLOPES = np.empty((6, 7, 0))
# the state that jumps, by the gains of a pair on the rotors' innovations: thrust, torque, turn
JUMP_STATE = np.tile(STATES, 3)
HELD = np.array(GAINS)[JUMP_STATE]  # standard deviations of these gains


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
        # the rounding error of the logged rotor speeds of each piece (n, 4), which is added back
        self.finer: list[Array] = []
        if near:
            vars(self).update(vars(near))
        self.flights = flights
        self.gusty: bool = near.gusty if near and same_noise else gusty
        self.setting = setting
        self.vehicle = flights.amended(setting)
        if not near or sensing_of(near.vehicle) != sensing_of(self.vehicle):
            self.poses = self._read_poses()
        # the states (3,) after a period of one m/s2 or rad/s2
        self._units = np.array([self.period**2, self.period, 1.0])
        if not near:
            self.noise = self._first_noise()
            # on the rotors' innovations
            self.gains: Array = np.zeros((len(PAIRS), len(JUMP_STATE)))
            self.steady = steady_filter(self.noise, self.period, self.vehicle.gravity)
            self._see_rotors()
        self.jumps = self._jumps()
        if near and (same_noise or gusty):
            self._run()
            if np.isnan(self.track.predicted).any():
                raise np.linalg.LinAlgError("the filter diverges with these effects")
        else:
            self._search_noise()
        self.signals = self._signals()
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

    def _read_poses(self) -> Poses:
        """Return the unbroken pieces of the flights in the fit as measured. The vehicle's sensing
        effects are undone, and the rotor speeds of each are made finer.

        For late or early poses, rotor speeds are moved instead: moved poses would lose noise.
        """
        flights = self.flights
        late = [e for e in sensing_of(self.vehicle) if is_delay(e.name)]
        offset = sum(x for e in late for x in e.coefficients.values())
        on_time = replace(
            self.vehicle, effects=tuple(e for e in self.vehicle.effects if e not in late)
        )
        finer = iter(self.finer)
        out = []
        for at in np.unique(flights.log[flights.fit_rows]).tolist():
            rows = np.flatnonzero(flights.log == at)
            undone = undo_log_sensing(flights.logs[at], on_time)
            for raw, smooth in zip(log_signals(undone, np.inf), log_signals(undone), strict=True):
                raw = replace(raw, rotor_speeds=raw.rotor_speeds + next(finer, 0.0))
                raw = with_time_offsets(raw, {ROTOR_TIME_OFFSET.coefficient: offset})
                q = Rotation.from_matrix(raw.rotation).as_quat(scalar_first=True)
                n = len(raw.t)
                near = np.searchsorted(flights.t[rows], raw.t).clip(max=len(rows) - 1)
                counted = flights.fit_rows[rows[near]]
                counted[: round(SETTLING_TIME / raw.period)] = False
                out.append(
                    (
                        raw.t,
                        raw.position,
                        continuous(q),
                        raw.rotor_speeds,
                        np.zeros(n) if raw.voltage is None else raw.voltage,
                        np.hstack([smooth.velocity[:1], smooth.angular_velocity[:1]]),
                        np.arange(n),
                        np.full(n, at),
                        counted,
                    )
                )
        self.period = raw.period
        return Poses(*map(np.concatenate, zip(*out, strict=True)))

    def _signals(self) -> list[Signals]:
        """Return each piece as the filter sees it between samples, for the effect models."""
        out = []
        for at in self.poses.pieces:
            speeds = self.poses.rotor_speeds[at]
            voltage = self.poses.voltage[at]
            seen = self.track
            out.append(
                Signals(
                    seen.t[at],
                    self.period,
                    seen.position[at],
                    seen.rotation[at],
                    seen.velocity[at],
                    seen.acceleration[at, :3],
                    seen.angular_velocity[at],
                    seen.acceleration[at, 3:],
                    0.5 * (speeds + np.vstack([speeds[1:], speeds[-1:]])),
                    voltage if voltage.any() else None,
                )
            )
        return out

    def _see_rotors(self) -> None:
        """Take the rotors' innovations by a filter that follows the pose closely."""
        self.jumps = np.zeros((len(self.poses.t), 6, 3))
        self._run()
        if self._rounding_std:
            finer = unrounded(self.poses, self.track, self.vehicle.omega_lsb)
            self.finer = np.split(finer, self.poses.begins[1:])
            self.poses = replace(self.poses, rotor_speeds=self.poses.rotor_speeds + finer)
            self._run()
        self.answers = rotor_innovations(self.poses, self.track)

    def _run(self) -> None:
        each = (OWN @ self.gains).reshape(6, -1, len(STATES)) * self._units
        # the jumps of the states (n, 6, 3) by the rotors' innovations
        self.known = (self.jumps.swapaxes(0, 1) @ each).swapaxes(0, 1)
        self.track = run(self.poses, self.period, self.vehicle, self.steady, self.known)

    # Noise

    def _first_noise(self) -> PoseNoise:
        floor = sensor_noise(self.flights.logs[0], self.vehicle)
        return PoseNoise(
            np.repeat(np.maximum([floor.position, floor.attitude], 1e-6), 3),
            np.repeat([FIRST_DISTURBANCE, 10.0 * FIRST_DISTURBANCE], 3),
            np.full(6, FIRST_TIME),
            self._rounding(),
        )

    @property
    def _rounding_std(self) -> float:
        """Standard deviation of the rounding of a rotor speed, rad/s."""
        return (self.vehicle.omega_source == "measured") * self.vehicle.omega_lsb / math.sqrt(12.0)

    def _rounding(self) -> Array:
        """Return the standard deviation of the accelerations (6,) by the rounding of rotor
        speeds: m/s2 and rad/s2.
        """
        speeds = self.poses.rotor_speeds.mean(axis=0)
        # of no rotor, and of each
        wrenches = self.vehicle.rotor_wrench(speeds + self._rounding_std * np.eye(5, 4, -1))
        # between two samples the mean of both counts
        wrench = np.sqrt(np.square(wrenches[1:] - wrenches[0]).sum(axis=0) / 2.0)
        return np.maximum(np.array([0.0, 0.0, *wrench]) / self.flights.inertias, 1e-9)

    def _search_noise(self, explained: Array | None = None) -> None:
        """Take the likeliest noise, and the likeliest gains on the rotors' innovations.

        Args:
            explained: (2, n, 6) known changes of the pose and of the acceleration beside the model.
        """

        def see(steady: SteadyFilter, gains: Array) -> Array:
            self.steady = steady
            self.gains = gains
            self._run()
            if explained is not None:
                pose, force = map(_whole, explained)
                each = self._changes([force], [pose], every=True)
                left = np.diff(np.concatenate([x for _, x in each])).reshape(-1, 6)
                left = left @ np.linalg.inv(steady.whitening).T
                self.track = replace(self.track, innovations=left)
            return self.track.innovations[self.poses.counted]

        def products(slopes: Array) -> Array:
            each = self._changes(shares=OF_PAIRS, slopes=slopes)
            return functools.reduce(np.add, (x.T @ x for _, x in each))

        search = NoiseSearch(see, products, HELD, self.period, self.vehicle.gravity)
        self.noise, self.gains = search.likeliest(self.noise, self.gains)
        self.steady = steady_filter(self.noise, self.period, self.vehicle.gravity)
        self._run()

    def gusts(self) -> tuple[Disturbance, ...]:
        """Return the disturbance of each channel. The rotors show a part: a flight loop on a gyro
        answers most of a gust's torque before the pose shows any.
        """
        jumps = np.split(self.known[:, :, 2], self.poses.begins[1:])
        shown = [
            np.concatenate([filtered(x[:, i], (1, 0, 0, 1, -keep, 0)) for x in jumps])
            for i, keep in enumerate(self.steady.keep.tolist())
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
        return (self._accelerations(setting, self.signals) - self._base) / units

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
        position, quaternion = np.hsplit(self.track.predicted, [3])
        out = np.zeros((len(position), 6))
        for at in self.poses.pieces:
            log = FlightLog(
                self.track.t[at], position[at], quaternion[at], self.poses.rotor_speeds[at]
            )
            undone = undo_log_sensing(log, vehicle)
            out[at, :3] = undone.position - log.position
            if (undone.quaternion != log.quaternion).any():
                out[at, 3:] = turn_between(log.quaternion, undone.quaternion)
        return out / delta

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
            acting |= discrepancy_columns(self.track, self.poses.begins[1:], self.flights)
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
        followed = variables(self.track)
        for effect, own in self.setting.items():
            if get(effect).kind == "sensing" and not is_delay(effect):
                moved = [x * self._moved(Column(effect, name)) for name, x in own.items()]
                self._posed |= changing_columns({effect: np.sum(moved, axis=0)}, followed)
            else:
                change = -self._change(without(self.setting, effect))
                self._acting |= changing_columns({effect: change}, followed)

    def _add_what_any_flight_may_have(self) -> None:
        """Add the columns of time offsets, of rotors between samples and of the model's error."""
        self._add(ROTOR_TIME_OFFSET)
        # away from the straight line, by the second difference. The speeds are of k + 1/2: nothing
        # later than sample k + 1
        bent = [
            replace(s, rotor_speeds=s.rotor_speeds + np.pad(u, ((2, 0), (0, 0))))
            for s in self.signals
            for u in [np.diff(s.rotor_speeds, 2, axis=0)]
        ]
        change = self._accelerations(self.setting, bent) - self._base
        self._acting[Column("", "", Part.BETWEEN_SAMPLES)] = _whole(change)
        self._add_model_errors()
        self._add_answers()
        # the rate before the sample is read: the rate after holds the sample's noise
        after = self.track.angular_velocity + 0.5 * self.period * self.track.acceleration[:, 3:]
        rate = np.roll(after, 1, axis=0)
        rate[self.poses.begins] = self.track.angular_velocity[self.poses.begins]
        self._posed[ATTITUDE_TIME_OFFSET] = _whole(np.hstack([np.zeros_like(rate), -rate]))

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
        out.track = replace(
            self.track,
            heading=out.track.heading,
            innovations=out.track.innovations,
            disturbance=out.track.disturbance,
        )
        return out._products(starts)

    def _explained(self, coefficients: Mapping[Column, float]) -> Array:
        """Return the change of the pose and of the acceleration (2, n, 6)."""
        turn = self.track.rotation
        pose, force = x = np.zeros((2, len(turn), 6))
        for change, columns in ((pose, self._posed), (force, self._acting)):
            for c, column in columns.items():
                if c in coefficients:
                    change += coefficients[c] * column.whole
        tilt = pose[:, 4:5] * turn[:, :, 0] - pose[:, 3:4] * turn[:, :, 1]
        force[:, :3] += self.track.rotors[:, :1] * tilt
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
        rotation = self.track.rotation
        thrust, *torques = self.track.rotors.T
        for i, torque in enumerate(torques):
            expected = torque - self.answers[:, 1 + i]
            share = rounded[i] / max(expected.var(), rounded[i])
            own = along_axis(3 + i, rotation)
            errors = {
                "force": Product(1.0, thrust, *along_axis(i, rotation)),
                "torque": Product(1.0, torque, *own),
                "expected torque": Product(math.hypot(1.0, share / MODEL_ERROR), expected, *own),
            }
            for name, x in errors.items():
                self._acting[Column("", f"{name} {'xyz'[i]}", Part.MODEL_ERROR)] = x

    def _add_answers(self) -> None:
        """Add the columns of a flight loop's answers to disturbances: along thrust and torques,
        their changes, and the state of each axis.

        A loop on a gyro answers a disturbance before the pose shows any. This part of the rotors'
        wrench causes no motion, and is no sign of an effect. The loop is unknown: each of its
        signals may have a share of the part, at most the disturbance's share of the variance.
        (Unknown linear feedback: L. Ljung, System Identification, 2nd edition, 1999, section 13.4.)
        """
        whole = self.track
        p, q, r = whole.angular_velocity.T
        ahead, left, up = in_body(whole.velocity, whole.rotation).T
        pitch, roll, _ = whole.rotation[:, 2].T
        states = (up,), (p, q * r, roll, left), (q, r * p, pitch, ahead), (r, p * q)
        disturbed = np.array([gust.rms for gust in self.gusts()]) / self.flights.inertias
        for axis, rotors, own in zip(DRIVEN, whole.rotors.T, states, strict=True):
            size = max(rotors.std(), 1e-9)
            answer = min((disturbed[axis] / size) ** 2, 1.0) * size
            change = np.diff(rotors, prepend=rotors[:1])
            along = along_axis(axis, whole.rotation)
            for i, x in enumerate((rotors - rotors.mean(), change, *own)):
                column = Product(answer / max(x.std(), 1e-9), x, *along)
                self._acting[Column("", f"answer {i} of axis {axis}", Part.NUISANCE)] = column

    def _jumps(self) -> Array:
        """Return the accelerations (n, 6, 3) for a unit of the gains of a pair of axes on thrust,
        on torque and on the turn. ``_units`` makes jumps of the states.

        Thrust and torques inform about the axes they drive. A loop that rolls or pitches the
        vehicle has seen its position and the force aside.
        """
        # the innovation of sample k changes the state after k: the jump is before sample k + 1
        answer = np.roll(self.answers, 1, axis=0)
        answer[self.poses.begins] = 0.0
        x = np.zeros((len(answer), 6, 3))
        x[:, :3, 0] = answer[:, :1] * self.track.rotation[:, :, 2]
        x[:, 3:, 1] = level(self.track.heading, answer[:, 1:])
        x[:, :2, 2] = SIDEWAYS * self.flights.vehicle.gravity * x[:, 4:2:-1, 1]
        return x

    def _products(self, starts: Starts) -> Base:
        self.jumps = self._jumps()
        moved = self._posed
        asked = (*(c for c in self._acting if c not in moved), *moved)
        # the gains on axes the rotors do not drive stay as fitted
        drives = [
            Column("", f"axis {axis}", Part.GAIN, state) for axis in DRIVEN for state in STATES
        ]
        n = len(self._base)
        still = Product(0.0, Product.ones(n), Product.ones(n, 1))
        x = [self._acting.get(c, still) for c in asked]
        each = self._changes(x, [*moved.values()], OF_DRIVEN)
        blocks = ((log, rows.T @ rows) for log, rows in each)
        penalty = float(self.poses.counted.sum() * np.linalg.slogdet(self.steady.covariance)[1])
        names = (*asked, *drives)
        return in_prior_units(self.flights, names, blocks, penalty, self.setting, starts)

    def _changes(
        self,
        acting: Sequence[Product] = (),
        moved: Sequence[Product] = (),
        shares: Array = OF_DRIVEN[:, :, :0],
        slopes: Array = NO_SLOPES,
        every: bool = False,
    ) -> Iterator[tuple[int, Array]]:
        """Yield for each block of flight the index of its log, and the change of its predictions
        with each of c columns. The innovations stand last; all are whitened (6 m, c + 1), of the m
        samples in the fit.

        Args:
            acting: acceleration of the model by a unit of each of the first columns.
            moved: shift of the measured pose by a unit of the last of these.
            shares: (6, 3, e) ``OF_PAIRS`` or ``OF_DRIVEN``: of the jumps by a unit of the next 3 e
                columns, of the states in turn, before the pose of a sample is read.
            slopes: (6, 7, m) change of the gains of each axis, in the order of
                ``SteadyFilter.gain``, and of ``keep``, by a unit of the last columns.
            every: all samples count.
        """
        shares = (shares[..., None] * self._units).reshape(6, 3, -1)
        count = len(acting) + shares.shape[2] + slopes.shape[2]
        length = round(BLOCK / self.period)
        track = self.track
        counted = self.poses.counted | every
        for piece in self.poses.pieces:
            state = np.zeros((6, 3, count))
            # one block's columns are in memory at a time
            for begin in range(piece.start, piece.stop, length):
                at = slice(begin, min(begin + length, piece.stop))
                out = np.empty((counted[at].sum(), 6, count + 1))
                _core.sensitivities(
                    self.period,
                    self.steady.gain,
                    self.steady.keep,
                    track.heading[at],
                    track.rotation[at],
                    track.rotors[at],
                    track.angular_velocity[at],
                    _twist(self.vehicle),
                    [x.part(at) for x in acting],
                    [x.part(at) for x in moved],
                    self.jumps[at],
                    shares,
                    np.resize(STATES, shares.shape[2]),
                    slopes,
                    track.innovations[at],
                    track.disturbance[at],
                    self.steady.whitening,
                    counted[at],
                    state,
                    out,
                )
                if len(out):
                    yield int(self.poses.log[begin]), out.reshape(-1, count + 1)


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
