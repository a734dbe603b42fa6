"""The likelihood of a flight's poses as a regression of whitened innovations: one Gram matrix.

Everything that a model may lack is a column: a unit of a coefficient, through the same causal
filter as the poses. The noise of each axis is fitted first, at maximum likelihood. With it the
innovations are white, and the log-likelihood of any set of coefficients near the setting follows
from sums of products alone.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.spatial.transform import Rotation

from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import EffectSetting, Vehicle
from ...runtime.errors import InputError
from ..findings import CHANNELS, Disturbance
from ..logs.flight_log import FlightLog
from ..motion.sensing_effects import undo_log_sensing
from ..motion.sensor_noise import sensor_noise
from ..motion.signals import Signals, log_signals
from ..motion.smoothing import continuous, turn_between, turned
from .axis_filter import AXIS, AxisFlight, AxisNoise, likeliest_noise, steady_noise
from .causal_filter import Poses, Track, run, sensitivities
from .discrepancy import changing_columns, discrepancy_columns, variables
from .log_offsets import (
    ATTITUDE_TIME_OFFSET,
    LAG_ASYMMETRY,
    ROTOR_TIME_OFFSET,
    with_time_offsets,
)
from .priors import (
    BETWEEN,
    GAIN,
    MODEL_ERROR,
    PRIORS,
    UNKNOWN,
    WHOLE_PREFIX,
    Base,
    Setting,
    Starts,
    in_prior_units,
    variants_of,
)
from .regression import (
    CENTRAL,
    REGRESSION,
    STEP,
    Column,
    Flights,
    is_delay,
    typical_size,
    without,
)
from .rotor_innovations import DRIVEN, rotor_innovations

Array = NDArray[np.float64]

STATES = (0, 1, 2)  # of an axis: pose, rate, disturbance
# rad of tilt for a rad/s2 of roll or pitch: the unit of gains of sideways states
SIDEWAYS = 0.01


# of the noise and of the flight as it is seen with it, where no noise is known and where one is
NOISE_ROUNDS = 3, 2
FIRST_DISTURBANCE = 0.3  # m/s2 and rad/s2, at which the search for the noise begins


class Likelihood:
    """The likelihood of flights with measured rotors near a setting of coefficients.

    Args:
        flights: of the vehicle.
        setting: the coefficients about which all is linear.
        near: the likelihood of the same flights near another setting, whose noise is where the
            search for this one's begins; default: it begins with what any flight may have.
        same_noise: whether that noise is taken as it is, and the columns of what any flight may
            have.
    """

    def __init__(
        self,
        flights: Flights,
        setting: Setting,
        near: "Likelihood | None" = None,
        same_noise: bool = False,
    ) -> None:
        self.flights, self.setting = flights, setting
        self.vehicle = flights.amended(setting)
        self.pieces: list[Poses]
        self._fit: list[NDArray[np.bool_]]
        if near is not None and _sensing(near.vehicle) == _sensing(self.vehicle):
            self.pieces, self._fit = near.pieces, near._fit
        else:
            found = [
                (i, piece)
                for i, log in enumerate(flights.logs)
                if flights.fit_rows[flights.log == i].any()  # no test log
                for piece in read_poses(log, self.vehicle)
            ]
            self.pieces = [piece for _, piece in found]
            self._fit = [_in_fit(flights, i, piece.t) for i, piece in found]
        self.period = self.pieces[0].period
        self.inertias = flights.inertias
        lengths = [len(piece.t) for piece in self.pieces]
        if near is not None and [len(piece.t) for piece in near.pieces] != lengths:
            near = None
        same = near if same_noise else None
        self.noise: tuple[AxisNoise, ...] = near.noise if near else self._first_noise()
        # (n, 6, 3) of each piece, what rotors' innovations say of it
        self.known: list[Array] = near.known if near else [np.zeros((n, 6, 3)) for n in lengths]
        # what an attitude's innovation says of the position's filter
        self.aside: Array = near.aside if near else np.zeros((2, 3))
        self.tracks = self._run()
        self.answers: list[Array] = same.answers if same else self._rotor_innovations()
        for i in range(0 if same else NOISE_ROUNDS[near is not None]):
            self.noise, self.aside, self.known = self._likeliest(begun=near is not None or i > 0)
            self.tracks = self._run()
            self.answers = self._rotor_innovations()
        self.signals = [
            _signals(piece, track) for piece, track in zip(self.pieces, self.tracks, strict=True)
        ]
        self._base = self._accelerations(setting, self.signals)
        # what a unit of each column adds to the accelerations, or to the measured pose; a column
        # that was asked for once is kept. What any flight may have changes little with effects
        self._acting: dict[Column, list[Array]] = {}
        self._posed: dict[Column, list[Array]] = {}
        if same:
            self._acting, self._posed = (
                {c: x for c, x in part.items() if not c[0] and not c[1].startswith(UNKNOWN)}
                for part in (same._acting, same._posed)
            )
        if not self._acting:
            self._add_what_any_flight_may_have()

    def _run(self) -> list[Track]:
        return [
            run(piece, self.vehicle, self.noise, self.aside, known)
            for piece, known in zip(self.pieces, self.known, strict=True)
        ]

    def _rotor_innovations(self) -> list[Array]:
        return rotor_innovations(list(zip(self.pieces, self.tracks, strict=True)))

    # Noise

    @property
    def _units(self) -> Array:
        """What a unit of acceleration makes of an axis' states in a period."""
        return np.array([self.period**2, self.period, 1.0])

    def _first_noise(self) -> tuple[AxisNoise, ...]:
        floor = sensor_noise(self.flights.logs[0], self.vehicle)
        out = []
        for axis in range(6):
            pose = max(floor.position if axis < 3 else floor.attitude, 1e-6)
            size = FIRST_DISTURBANCE * (1.0 if axis < 3 else 10.0)
            white = float(self._rounding()[axis])
            out.append(steady_noise(pose, size, AXIS.first_time, white, self.period))
        return tuple(out)

    @property
    def _rounding_std(self) -> float:
        """Standard deviation of the rounding of a rotor speed, rad/s."""
        known = self.vehicle.omega_source == "measured"
        return self.vehicle.omega_lsb / math.sqrt(12.0) if known else 0.0

    def _rounding(self) -> Array:
        """Return the standard deviation of the accelerations (6,) that the rotor speeds' rounding
        makes: m/s2 and rad/s2.
        """
        speeds = np.concatenate([p.rotor_speeds for p in self.pieces]).mean(axis=0)
        off = self._rounding_std * np.vstack([np.zeros(4), np.eye(4)])
        wrenches = self.vehicle.rotor_wrench(speeds + off)
        steps = wrenches[1:] - wrenches[0]
        # between two samples the mean of both counts
        wrench = np.sqrt(np.sum(np.square(steps), axis=0) / 2.0)
        out = np.array([0.0, 0.0, *wrench]) / self.inertias
        return np.asarray(np.maximum(out, 1e-9))

    def _likeliest(
        self, explained: Sequence[Array] | None = None, begun: bool = True
    ) -> tuple[tuple[AxisNoise, ...], Array, list[Array]]:
        """Return the likeliest noise of each axis, the gains of an attitude's innovations on the
        motion aside (``causal_filter.run``), and what the rotors' innovations add to the states of
        each piece (n, 6, 3); ``explained`` (n, 2, 6) is what is known to move the pose, and to
        accelerate, beside the model. ``begun``: whether this noise is roughly known.
        """
        angles = [np.vstack([np.zeros(3), turned(piece.quaternion)]) for piece in self.pieces]
        out = []
        white = self._rounding()
        # rotors that answer a gust before the pose shows it leave less of it unknown
        _, jumps, jump_state = self._jumps()
        known = [np.zeros((len(x), 6, 3)) for x in jumps]
        aside = np.zeros((2, 3))
        for axis in range(6):
            say = [j for j in range(len(jump_state)) if any(x[:, axis, j].any() for x in jumps)]
            measured = [
                np.ascontiguousarray(p.position[:, axis] if axis < 3 else angle[:, axis - 3])
                for p, angle in zip(self.pieces, angles, strict=True)
            ]
            drives = [np.ascontiguousarray(track.model[:, axis]) for track in self.tracks]
            if explained is not None:
                measured = [y + x[:, 0, axis] for y, x in zip(measured, explained, strict=True)]
                drives = [y + x[:, 1, axis] for y, x in zip(drives, explained, strict=True)]
            rates = [
                float(p.velocity[axis] if axis < 3 else p.angular_velocity[axis - 3])
                for p in self.pieces
            ]
            now = self.noise[axis]
            own = [np.ascontiguousarray(x[:, axis, say]) for x in jumps]
            held = now.innovation / np.array(PRIORS.gains)[jump_state[say]]
            flight = AxisFlight(measured, drives, rates, self.period, own, jump_state[say], held)
            found, gains = likeliest_noise(
                flight, replace(now, white=max(float(white[axis]), now.white)), begun
            )
            out.append(found)
            every = np.zeros(len(jump_state))
            every[say] = gains
            if axis < 2:
                aside[axis] = every[-3:] * self._units
            every[-3:] = 0.0
            for x, jump in zip(known, jumps, strict=True):
                for state in STATES:
                    at = jump_state == state
                    x[:, axis, state] = jump[:, axis, at] @ every[at]
        return tuple(out), aside, known

    def gusts(self) -> tuple[Disturbance, ...]:
        """Return the disturbance of each channel, of which the rotors show a part: a flight loop
        that reads a gyro answers most of a gust's torque before the pose shows it.
        """
        out = []
        for axis, (own, size) in enumerate(zip(self.noise, self.inertias.tolist(), strict=True)):
            keep = math.exp(-self.period / own.time)
            shown = [lfilter([1.0], [1.0, -keep], known[:, axis, 2]) for known in self.known]
            rms = size * math.hypot(own.disturbance, float(np.concatenate(shown).std()))
            out.append(Disturbance(CHANNELS[axis], rms, own.time, size * own.disturbance))
        return tuple(out)

    # Columns

    def _accelerations(self, setting: Setting, signals: Iterable[Signals]) -> list[Array]:
        """Return the accelerations (n, 6) that a setting makes along each piece's signals."""
        vehicle, out = self.flights.vehicle, []
        for s in signals:
            wrench = self.flights.acting(s, setting)
            turning = np.linalg.solve(vehicle.inertia, wrench[:, 3:].T).T
            out.append(np.column_stack([wrench[:, :3] / vehicle.mass, turning]))
        return out

    def _change(
        self, setting: Setting, step: float = 1.0, signals: Iterable[Signals] | None = None
    ) -> list[Array]:
        """Return what another setting, and other signals, add to the acceleration (n, 6) of each
        piece, over a step.
        """
        found = self._accelerations(setting, self.signals if signals is None else signals)
        return [(x - base) / step for x, base in zip(found, self._base, strict=True)]

    def _add(self, column: Column) -> None:
        """Add what a unit of a coefficient does, but where it is known already, or where no vehicle
        can be like that.
        """
        effect, name = column
        if column in self._acting or column in self._posed:
            return
        if effect and is_delay(effect):
            self._acting[column] = self._acting[ROTOR_TIME_OFFSET]
            return
        if effect and get(effect).kind == "sensing":
            self._posed[column] = self._moved(column)
            return
        own = dict(self.flights.coefficients(self.setting, effect))
        if name.startswith(WHOLE_PREFIX):
            own[CENTRAL] = 1.0
        name = name.removeprefix(WHOLE_PREFIX)
        value, delta = self.flights.step(self.setting, (effect, name))
        there = {**self.setting, effect: {**own, name: value + delta}}
        with suppress(InputError, np.linalg.LinAlgError):
            self._acting[column] = self._change(there, delta)
            if effect and get(effect).role == Role.CENTRE_OF_MASS:
                self._swing(column)

    def _moved(self, column: Column) -> list[Array]:
        """Return by how much a unit of a sensing effect moves the pose (n, 6), at the pose that the
        filter predicts: so the pose's own noise is no part of it.
        """
        effect, name = column
        delta = STEP * typical_size(column, self.flights.vehicle)
        own = EffectSetting(effect, {name: delta})
        vehicle = replace(self.flights.vehicle, effects=(own,))
        out = []
        for piece, track in zip(self.pieces, self.tracks, strict=True):
            log = FlightLog(
                piece.t, track.predicted[:, :3], track.predicted[:, 3:], piece.rotor_speeds
            )
            undone = undo_log_sensing(log, vehicle)
            shift = undone.position - track.predicted[:, :3]
            turn = turn_between(track.predicted[:, 3:], undone.quaternion)
            out.append(np.column_stack([shift, turn]) / delta)
        return out

    def base(self, library: Iterable[str], starts: Starts, unknown: bool = False) -> Base:
        """Return the likelihood of the coefficients of effects, and of what any flight may have.

        All columns that were asked for before are in it as well.

        Args:
            library: names of effects. What the vehicle's file fixes of them is not asked.
            starts: columns of whole effects, with the coefficients of each.
            unknown: whether the discrepancy's columns are wanted.
        """
        acting = self._acting
        if playing(Role.LAG, among=self.setting):
            self._add(LAG_ASYMMETRY)
        if unknown and not any(name.startswith(UNKNOWN) for _, name in acting):
            acting |= discrepancy_columns(self.tracks, self.flights)
            self._add_changing_coefficients()
        for c, start in starts.items():
            if c not in acting:
                acting[c] = self._change({**self.setting, c[0]: dict(start)})
        for effect in library:
            for _, columns in variants_of(self.flights, effect, self.setting, starts):
                for c in columns:
                    if c[1].removeprefix(WHOLE_PREFIX) not in self.flights.stated(effect):
                        self._add(c)
        return self._products(starts)

    def _add_changing_coefficients(self) -> None:
        """Add the dictionary's columns of effects of the setting whose coefficients change."""
        parts, poses = {}, {}
        for effect, own in self.setting.items():
            if get(effect).kind == "sensing" and not is_delay(effect):
                moved = [(x, self._moved((effect, name))) for name, x in own.items()]
                poses[effect] = [
                    np.sum([x * column[i] for x, column in moved], axis=0)
                    for i in range(len(self.pieces))
                ]
            else:
                parts[effect] = self._change(without(self.setting, effect), -1.0)
        found = variables(self.tracks)
        self._acting |= changing_columns(parts, found)
        self._posed |= changing_columns(poses, found)

    def _add_what_any_flight_may_have(self) -> None:
        """Add the columns of time offsets, of rotors between samples and of the model's error."""
        self._add(ROTOR_TIME_OFFSET)
        bent = map(_bent_rotors, self.signals)
        self._acting["", BETWEEN] = self._change(self.setting, signals=bent)
        self._add_model_errors()
        moved = self._posed[ATTITUDE_TIME_OFFSET] = []
        for track in self.tracks:
            # the rate before the sample is read: after it, it knows that sample's noise
            rate = track.angular_velocity + 0.5 * self.period * track.acceleration[:, 3:]
            rate = np.vstack([track.angular_velocity[:1], rate[:-1]])
            moved.append(np.column_stack([np.zeros_like(rate), -rate]))

    def quieter(self, coefficients: Mapping[Column, float], starts: Starts) -> Base:
        """Return the likelihood of the same columns with the noise that is likeliest beside them
        all, at these coefficients.

        What an effect explains counts as a disturbance where the effect is not known. Beside the
        whole library the noise is that of a flight of which everything is known.
        """
        out = copy(self)
        out.noise, out.aside, out.known = self._likeliest(self._explained(coefficients))
        heard = out._run()
        out.tracks = [
            replace(track, innovations=x.innovations)
            for track, x in zip(self.tracks, heard, strict=True)
        ]
        out.answers = out._rotor_innovations()
        return out._products(starts)

    def _explained(self, coefficients: Mapping[Column, float]) -> list[Array]:
        """Return what the columns move the pose of each piece by, and accelerate (n, 2, 6)."""
        explained = []
        for i, track in enumerate(self.tracks):
            x = np.zeros((len(track.position), 2, 6))
            for c, column in self._acting.items():
                x[:, 1] += coefficients.get(c, 0.0) * column[i]
            for c, column in self._posed.items():
                x[:, 0] += coefficients.get(c, 0.0) * column[i]
            x[:, 1, :3] += track.rotors[:, :1] * (
                x[:, 0, 4:5] * track.rotation[:, :, 0] - x[:, 0, 3:4] * track.rotation[:, :, 1]
            )
            explained.append(x)
        return explained

    def _swing(self, column: Column) -> None:
        """Have a centre of mass move the measured point as a marker does that lies as far on the
        other side; its torque alone acts.

        That the point swings about the centre would else be two columns, of the model's angular
        acceleration and of the filter's attitude, and their difference, which is noise, would fit
        the poses' own noise: of equal offsets of both only the torque of the thrust is left.
        """
        for slope in self._acting[column]:
            slope[:, :3] = 0.0
        axis = [c.name for c in get(column[0]).coefficients].index(column[1])
        (marker,) = playing(Role.MARKER)
        place = self._moved((marker, get(marker).coefficients[axis].name))
        self._posed[column] = [-x for x in place]

    def _add_model_errors(self) -> None:
        """Add the columns of forces and torques that are a small share larger, and of what of a
        torque the flight loop's answer to the state predicts.

        The latter may be too small by the share of it that is rounding (errors in variables): a
        hover holds little torque, and rounding hides it.
        """
        rounded = 2.0 * np.square(self._rounding()[3:])
        known = [
            track.rotors[:, 1:] - x[:, 1:]
            for track, x in zip(self.tracks, self.answers, strict=True)
        ]
        share = rounded / np.maximum(np.concatenate(known).var(axis=0), rounded)
        scale = np.hypot(1.0, share / PRIORS.model_error)
        for track, expected in zip(self.tracks, known, strict=True):
            for i, axis in enumerate("xyz"):
                force, torque, hidden = np.zeros((3, len(track.t), 6))
                force[:, :3] = track.rotors[:, :1] * track.rotation[:, :, i]
                torque[:, 3 + i] = track.rotors[:, 1 + i]
                hidden[:, 3 + i] = scale[i] * expected[:, i]
                errors = {"force": force, "torque": torque, "expected torque": hidden}
                for name, x in errors.items():
                    self._acting.setdefault(("", f"{MODEL_ERROR} of {name} {axis}"), []).append(x)

    def _jumps(self) -> tuple[list[Column], list[Array], NDArray[np.intp]]:
        """Return the columns of the gains on innovations of rotors and attitude, their jumps
        (n, 6, e) of each piece, and which state jumps.

        Thrust and torques say something of the axes that they drive. And a loop that rolls or
        pitches the vehicle has seen where it is, and what pushes it aside. Last, a tilt that the
        pose corrects has pulled the vehicle aside before; what it does to the height is too little
        to fit a gain to.
        """
        kinds = (*(f"axis {axis}" for axis in DRIVEN), "roll aside", "pitch aside", "tilt")
        names: list[Column] = [("", f"{GAIN} {kind} {state}") for kind in kinds for state in STATES]
        out = []
        tilt = SIDEWAYS * self.flights.vehicle.gravity
        for found, track in zip(self.answers, self.tracks, strict=True):
            rotation = track.rotation
            # an innovation of sample k changes the state after it: the jump is before sample k + 1
            found = np.vstack([np.zeros(4), found[:-1]])
            directions = np.zeros((len(found), 6, len(kinds)))
            for i, axis in enumerate(DRIVEN):
                if axis == 2:
                    directions[:, :3, i] = found[:, i, None] * rotation[:, :, 2]
                else:
                    directions[:, axis, i] = found[:, i]
            for i, axis in ((1, 1), (2, 0)):
                directions[:, :3, 3 + i] = tilt * found[:, i, None] * rotation[:, :, axis]
            pull = track.rotors[:, :1, None] * rotation[:, :, 1::-1] * [-1.0, 1.0]
            off = np.einsum("nij,nj->ni", pull, track.innovations[:, 3:5])
            directions[1:, :2, -1] = off[:-1, :2]
            jumps = directions[..., None] * self._units
            out.append(jumps.reshape(len(found), 6, len(names)))
        return names, out, np.tile(STATES, len(kinds))

    def _products(self, starts: Starts) -> Base:
        acting, moved = self._acting, self._posed
        gains, jumps, jump_state = self._jumps()
        own = len(STATES) * len(DRIVEN)  # what the rotors say of other axes stays as it was fitted
        gains, jump_state, jumps = gains[:own], jump_state[:own], [x[:, :, :own] for x in jumps]
        asked = (*(c for c in acting if c not in moved), *moved)
        names = (*asked, *gains)
        gain = np.array([x.gain for x in self.noise])
        keep = np.exp(-self.period / np.array([x.time for x in self.noise]))
        std = np.array([x.innovation for x in self.noise])
        length = round(REGRESSION.block / self.period)
        skip = round(AXIS.settling_time / self.period)
        blocks, samples = [], 0
        for i, track in enumerate(self.tracks):
            state = np.zeros((6, 3, len(names)))
            pull = track.rotors[:, :1, None] * track.rotation[:, :, 1::-1] * [-1.0, 1.0]
            for begin in range(0, len(track.position), length):
                at = slice(begin, min(begin + length, len(track.position)))
                rows = at.stop - at.start
                x, y = np.zeros((rows, 6, len(asked))), np.zeros((rows, 6, len(moved)))
                for j, c in enumerate(asked):
                    if c in acting:
                        x[:, :, j] = acting[c][i][at]
                for j, column in enumerate(moved.values()):
                    y[:, :, j] = column[i][at]
                out = np.empty((rows, 6, len(names) + 1))
                sensitivities(
                    self.period,
                    gain,
                    keep,
                    self.aside,
                    pull[at],
                    track.angular_velocity[at],
                    x,
                    y,
                    np.ascontiguousarray(jumps[i][at]),
                    jump_state,
                    state,
                    out,
                )
                out[:, :, -1] = track.innovations[at]
                out /= std[None, :, None]
                fit = self._fit[i][at].copy()
                fit[: max(skip - begin, 0)] = False
                samples += int(fit.sum())
                kept = out[fit].reshape(-1, len(names) + 1)
                if len(kept):
                    blocks.append(kept.T @ kept)
        penalty = 2.0 * samples * float(np.log(std).sum())
        return in_prior_units(self.flights, names, np.array(blocks), penalty, self.setting, starts)


def _bent_rotors(s: Signals) -> Signals:
    """Return signals whose rotor speeds move between samples by their second difference beside the
    straight line.
    """
    u = s.rotor_speeds  # of k + 1/2: nothing later than sample k + 1
    bent = np.zeros_like(u)
    bent[2:] = u[2:] - 2.0 * u[1:-1] + u[:-2]
    return replace(s, rotor_speeds=u + bent)


def _in_fit(flights: Flights, log: int, t: Array) -> NDArray[np.bool_]:
    """Return which samples of a log, at times ``t`` (n,) s, the fit may see: those of whose block
    the rows are.
    """
    rows = flights.log == log
    at = np.searchsorted(flights.t[rows], t).clip(max=int(rows.sum()) - 1)
    return np.asarray(flights.fit_rows[rows][at])


def _sensing(vehicle: Vehicle) -> tuple[EffectSetting, ...]:
    """Return the effects that change what a log's poses are."""
    return tuple(e for e in vehicle.effects if get(e.name).kind == "sensing")


def read_poses(log: FlightLog, vehicle: Vehicle) -> list[Poses]:
    """Return the unbroken pieces of a log as they were measured, without what the vehicle's sensing
    effects did to them.

    Where poses are late or early, rotor speeds are moved instead: poses would lose of their noise.
    """
    late = [e for e in vehicle.effects if is_delay(e.name) and get(e.name).kind == "sensing"]
    offset = sum(sum(e.coefficients.values()) for e in late)
    undone = undo_log_sensing(
        log, replace(vehicle, effects=tuple(e for e in vehicle.effects if e not in late))
    )
    out = []
    for raw, smooth in zip(log_signals(undone, np.inf), log_signals(undone), strict=True):
        q = Rotation.from_matrix(raw.rotation).as_quat(scalar_first=True)
        raw = with_time_offsets(raw, {ROTOR_TIME_OFFSET[1]: offset})
        out.append(
            Poses(
                raw.t,
                raw.period,
                np.ascontiguousarray(raw.position),
                continuous(q),
                raw.rotor_speeds,
                np.zeros(len(raw.t)) if raw.voltage is None else raw.voltage,
                smooth.velocity[0],
                smooth.angular_velocity[0],
            )
        )
    return out


def _signals(piece: Poses, track: Track) -> Signals:
    """Return the flight as the filter sees it between samples, as the effect models are asked."""
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
