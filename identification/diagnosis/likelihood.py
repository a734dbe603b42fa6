"""The likelihood of a flight's poses as a regression of whitened innovations: one Gram matrix.

Everything that a model may lack is a column: a unit of a coefficient, through the same causal
filter as the poses. The noise of each axis is fitted first, at maximum likelihood. With it the
innovations are white, and the log-likelihood of any set of coefficients near the setting follows
from sums of products alone.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import EffectSetting, Vehicle
from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog
from ..motion.residual import acting_wrench
from ..motion.sensing_effects import undo_log_sensing
from ..motion.sensor_noise import sensor_noise
from ..motion.signals import Signals, log_signals
from ..motion.smoothing import continuous, turn_between, turned
from .axis_filter import AXIS, AxisNoise, likeliest_noise, steady_noise
from .causal_filter import Poses, Track, run, sensitivities
from .discrepancy import changing_columns, discrepancy_columns, variables
from .regression import (
    CENTRAL,
    START_PREFIX,
    Column,
    Flights,
    Setting,
    coefficient,
    is_delay,
    typical_size,
)
from .rotor_innovations import DRIVEN, rotor_innovations
from .time_offsets import (
    ATTITUDE_TIME_OFFSET,
    LAG_ASYMMETRY,
    ROTOR_TIME_OFFSET,
    TIMING,
    with_time_offsets,
    with_uneven_lag,
)

Array = NDArray[np.float64]

WHOLE_PREFIX = "whole "  # a coefficient of an effect that acts at the centre, without a moment
BETWEEN = "rotors between samples"
STATES = (0, 1, 2)  # of an axis: pose, rate, disturbance
# rad of tilt for a rad/s2 of roll or pitch: the unit of gains of sideways states
SIDEWAYS = 0.01
MODEL_ERROR, GAIN, UNKNOWN, NUISANCE = "model error", "rotor gain of", "unknown ", "nuisance "
ROUNDED = "rounding of torque "


@dataclass(frozen=True)
class LikelihoodSettings:
    """What the likelihood allows for beside effects."""

    step: float = 0.1  # typical sizes, over which derivatives are taken
    # share of an axis' force or torque by which any model is wrong: of thrust along its axis and
    # across it, and of the torques. Propellers and bearings are not stable to less
    model_error: float = 0.003
    # standard deviations of the gains on the rotors' innovations, by which pose, rate and
    # disturbance answer them, in what one period of such an acceleration makes. They are to leave
    # the gains free: a loop that shows the tilt that it sees has gains of some 3,000, 100 and 1
    gains: tuple[float, float, float] = (1e4, 1e3, 1e2)
    # second differences of the rotor speeds, the standard deviation of what they may do between
    # samples beside a straight line
    between_samples: float = 0.5
    noise_rounds: int = 2  # of the noise and of the flight as it is seen with it
    block: float = 3.0  # s, of the sums by which the likelihood's scatter is judged
    first_disturbance: float = 0.3  # m/s2 and rad/s2, at which the search for the noise begins


LIKELIHOOD = LikelihoodSettings()


@dataclass(frozen=True, eq=False)
class Sums:
    """Sums of products over blocks, of columns and of the innovations (last), whitened."""

    columns: tuple[Column, ...]
    blocks: Array  # (blocks, c + 1, c + 1)
    value: Array  # (c,) the coefficients' values at the setting
    penalty: float  # twice the sum over samples of the logarithm of innovation deviations

    def deviance(self) -> float:
        """Return -2 log-likelihood at the setting."""
        return float(self.blocks[:, -1, -1].sum()) + self.penalty


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

    axes: tuple[int, ...] = (0, 1, 2, 3, 4, 5)  # whose innovations count

    def __init__(
        self,
        flights: Flights,
        setting: Setting,
        near: "Likelihood | None" = None,
        same_noise: bool = False,
    ) -> None:
        self.flights, self.setting = flights, setting
        self.vehicle = flights.amended({k: v for k, v in setting.items() if k})
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
        inertia = flights.vehicle.inertia
        self.inertias = np.array([flights.vehicle.mass] * 3 + np.diagonal(inertia).tolist())
        # tracks, and the rotors' innovations of them
        self._answers: tuple[list[Track], list[Array]] = [], []
        self.known: list[Array]  # (n, 6, 3) of each piece, what rotors' innovations say of it
        lengths = [len(piece.t) for piece in self.pieces]
        if near is None or [len(piece.t) for piece in near.pieces] != lengths:
            near = None
            self.noise = self._first_noise()
            self.known = [np.zeros((n, 6, 3)) for n in lengths]
        else:
            self.noise, self.known = near.noise, near.known
        self.tracks = self._run(self.noise, self.known)
        rounds = 0 if near and same_noise else 1 if near else LIKELIHOOD.noise_rounds
        for i in range(rounds):
            self.noise, self.known = self._likeliest(begun=near is not None or i > 0)
            self.tracks = self._run(self.noise, self.known)
        self.signals = [
            _signals(piece, track) for piece, track in zip(self.pieces, self.tracks, strict=True)
        ]
        self._base = [self._acceleration(s, self.vehicle) for s in self.signals]
        # what a unit of each column adds to the accelerations, or to the measured pose; a column
        # that was asked for once is kept
        self._columns: tuple[dict[Column, list[Array]], dict[Column, list[Array]]] = {}, {}
        if near is not None and same_noise:  # what any flight may have changes little with effects
            self._columns = near.nuisances()
            self._answers = self.tracks, near._rotor_innovations()

    def _run(self, noise: tuple[AxisNoise, ...], known: Sequence[Array]) -> list[Track]:
        return [
            run(piece, self.vehicle, noise, x) for piece, x in zip(self.pieces, known, strict=True)
        ]

    # Noise

    def _first_noise(self) -> tuple[AxisNoise, ...]:
        floor = sensor_noise(self.flights.logs[0], self.vehicle)
        out = []
        for axis in range(6):
            pose = max(floor.position if axis < 3 else floor.attitude, 1e-6)
            size = LIKELIHOOD.first_disturbance * (1.0 if axis < 3 else 10.0)
            white = float(self._rounding()[axis])
            out.append(steady_noise(pose, size, AXIS.first_time, white, self.period))
        return tuple(out)

    @property
    def _rounding_std(self) -> float:
        """Standard deviation of the rounding of a rotor speed, rad/s."""
        known = self.vehicle.omega_source == "measured"
        return self.vehicle.omega_lsb / math.sqrt(12.0) if known else 0.0

    def _rounded_torques(self) -> list[list[Array]]:
        """Return for each axis what another rounding of the rotor speeds would add to the angular
        acceleration (n, 6) of each piece.
        """
        generator = np.random.default_rng(0)
        out: list[list[Array]] = [[], [], []]
        for s in self.signals:
            off = self._rounding_std * math.sqrt(3.0) * generator.uniform(-1.0, 1.0, (len(s.t), 4))
            off = 0.5 * (off + np.vstack([off[1:], off[-1:]]))  # as the speeds between samples
            wrench = self.vehicle.rotor_wrench
            torque = (wrench(s.rotor_speeds + off) - wrench(s.rotor_speeds))[:, 1:]
            for i in range(3):
                column = np.zeros((len(s.t), 6))
                column[:, 3 + i] = torque[:, i] / self.inertias[3 + i]
                out[i].append(column)
        return out

    def _rounding(self) -> Array:
        """Return the standard deviation of the accelerations (6,) that the rotor speeds' rounding
        makes: m/s2 and rad/s2.
        """
        vehicle, std = self.vehicle, self._rounding_std
        speeds = np.concatenate([p.rotor_speeds for p in self.pieces]).mean(axis=0)
        base = vehicle.rotor_wrench(speeds[None])[0]
        steps = [
            vehicle.rotor_wrench((speeds + std * np.eye(4)[i])[None])[0] - base for i in range(4)
        ]
        # between two samples the mean of both counts
        wrench = np.sqrt(np.sum(np.square(steps), axis=0) / 2.0)
        out = np.array([0.0, 0.0, wrench[0], *wrench[1:]]) / self.inertias
        return np.asarray(np.maximum(out, 1e-9))

    def _likeliest(
        self, explained: Sequence[Array] | None = None, begun: bool = True
    ) -> tuple[tuple[AxisNoise, ...], list[Array]]:
        """Return the likeliest noise of each axis, and what the rotors' innovations add to the
        states of each piece (n, 6, 3); ``explained`` (n, 2, 6) is what is known to move the pose,
        and to accelerate, beside the model. ``begun``: whether this noise is roughly known.
        """
        angles = [np.vstack([np.zeros(3), turned(piece.quaternion)]) for piece in self.pieces]
        out = []
        white = self._rounding()
        # rotors that answer a gust before the pose shows it leave less of it unknown
        _, jumps, jump_state = self._jumps()
        known = [np.zeros((len(x), 6, 3)) for x in jumps]
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
            found, gains = likeliest_noise(
                measured,
                drives,
                rates,
                self.period,
                max(float(white[axis]), now.white),
                now.pose,
                now.disturbance,
                own,
                jump_state[say],
                now.time if begun else None,
            )
            out.append(found)
            for x, jump in zip(known, own, strict=True):
                for state in STATES:
                    at = jump_state[say] == state
                    x[:, axis, state] = jump[:, at] @ gains[at]
        return tuple(out), known

    # Columns

    def _acceleration(self, signals: Signals, vehicle: Vehicle) -> Array:
        wrench, _ = acting_wrench(signals, vehicle, self.flights.vehicle)
        return np.column_stack(
            [
                wrench[:, :3] / self.flights.vehicle.mass,
                np.linalg.solve(self.flights.vehicle.inertia, wrench[:, 3:].T).T,
            ]
        )

    def _slope(self, column: Column) -> list[Array] | None:
        """Return what a unit of a coefficient adds to the acceleration (n, 6) of each piece; None
        where no vehicle can be like that.
        """
        effect, name = column
        whole = name.startswith(WHOLE_PREFIX)
        name = name.removeprefix(WHOLE_PREFIX)
        own = dict(self.flights.coefficients(self.setting, effect))
        if whole:
            own[CENTRAL] = 1.0
        value = own.get(name, 0.0)
        c = coefficient((effect, name))
        delta = LIKELIHOOD.step * typical_size((effect, name), self.flights.vehicle)
        if not c.minimum <= value + delta <= c.maximum:
            delta = -delta
        after = {k: v for k, v in self.setting.items() if k}
        after[effect] = {**own, name: value + delta}
        try:
            vehicle = self.flights.amended(after)
            return [
                (self._acceleration(s, vehicle) - base) / delta
                for s, base in zip(self.signals, self._base, strict=True)
            ]
        except (InputError, np.linalg.LinAlgError):
            return None

    def _start(self, effect: str, coefficients: Mapping[str, float]) -> list[Array]:
        after = {k: v for k, v in self.setting.items() if k}
        after[effect] = dict(coefficients)
        vehicle = self.flights.amended(after)
        return [
            self._acceleration(s, vehicle) - base
            for s, base in zip(self.signals, self._base, strict=True)
        ]

    def _later_rotors(self) -> list[Array]:
        """Return what rotor speeds that act a second later add, by the derivative."""
        delta, out = 0.001, []
        for s, base in zip(self.signals, self._base, strict=True):
            at = np.arange(len(s.t)) - delta / s.period
            ends = np.arange(len(s.t))
            moved = np.column_stack([np.interp(at, ends, x) for x in s.rotor_speeds.T])
            shifted = replace(s, rotor_speeds=moved)
            out.append((self._acceleration(shifted, self.vehicle) - base) / delta)
        return out

    def _uneven_lag(self) -> list[Array]:
        """Return what a second of the lag's asymmetry adds, by the derivative."""
        delta = LIKELIHOOD.step * TIMING.lag_asymmetry_size
        return [
            (self._acceleration(with_uneven_lag(s, self.vehicle, delta), self.vehicle) - base)
            / delta
            for s, base in zip(self.signals, self._base, strict=True)
        ]

    def _bent_rotors(self) -> list[Array]:
        """Return what rotor speeds add that move between samples by their second difference beside
        the straight line.
        """
        out = []
        for s, base in zip(self.signals, self._base, strict=True):
            u = s.rotor_speeds  # of k + 1/2: nothing later than sample k + 1
            bent = np.zeros_like(u)
            bent[2:] = u[2:] - 2.0 * u[1:-1] + u[:-2]
            moved = replace(s, rotor_speeds=u + bent)
            out.append(self._acceleration(moved, self.vehicle) - base)
        return out

    def _moved(self, column: Column) -> list[Array]:
        """Return by how much a unit of a sensing effect moves the pose (n, 6), at the pose that the
        filter predicts: so the pose's own noise is no part of it.
        """
        effect, name = column
        delta = LIKELIHOOD.step * typical_size(column, self.flights.vehicle)
        bare = replace(self.flights.vehicle, effects=())
        vehicle = replace(bare, effects=self.flights.amended({effect: {name: delta}}).effects[-1:])
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

    def sums(
        self,
        wanted: Iterable[Column],
        starts: Mapping[Column, Mapping[str, float]],
        unknown: bool = True,
    ) -> Sums:
        """Return the sums of products of these columns, of what any flight may have beside them,
        and of the innovations.

        All columns that were asked for before are in them as well.

        Args:
            wanted: coefficients of effects.
            starts: columns of whole effects, with the coefficients of each.
            unknown: whether the discrepancy's columns are wanted.
        """
        acting, moved = self._columns
        if not acting:
            self._add_what_any_flight_may_have()
        if playing(Role.LAG, among=[e for e in self.setting if e]) and LAG_ASYMMETRY not in acting:
            acting[LAG_ASYMMETRY] = self._uneven_lag()
        if unknown and not any(name.startswith(UNKNOWN) for _, name in acting):
            found = discrepancy_columns(
                self.tracks,
                [p.t for p in self.pieces],
                self.flights.vehicle.weight,
                self.flights.vehicle.arm_l,
                self.inertias,
            )
            for (group, name), column in found.items():
                acting["", f"{UNKNOWN}{group}: {name}"] = column
            self._add_changing_coefficients()
        for c, start in starts.items():
            if c not in acting:
                acting[c] = self._start(c[0], start)
        for c in wanted:
            if c in acting or c in moved or c[1].startswith(START_PREFIX):
                continue
            if is_delay(c[0]):
                acting[c] = acting[ROTOR_TIME_OFFSET]
            elif get(c[0]).kind == "sensing" and not is_delay(c[0]):
                moved[c] = self._moved(c)
            elif (slope := self._slope(c)) is not None:
                acting[c] = slope
                if get(c[0]).role == Role.CENTRE_OF_MASS:
                    self._swing(c)
        return self._products(acting, moved)

    def nuisances(self) -> tuple[dict[Column, list[Array]], dict[Column, list[Array]]]:
        """Return the columns of what any flight may have beside effects: what a unit of each adds
        to the accelerations, and to the pose.
        """
        if not self._columns[0]:
            self._add_what_any_flight_may_have()
        acting, moved = (
            {c: x for c, x in part.items() if not c[0] and not c[1].startswith(UNKNOWN)}
            for part in self._columns
        )
        return acting, moved

    def _add_changing_coefficients(self) -> None:
        """Add the dictionary's columns of effects of the setting whose coefficients change."""
        acting, moved = self._columns
        effects = [e for e in self.setting if e]
        parts, poses = {}, {}
        for effect in effects:
            if get(effect).kind == "sensing" and not is_delay(effect):
                own = self.setting[effect].items()
                poses[effect] = [
                    np.sum([value * self._moved((effect, name))[i] for name, value in own], axis=0)
                    for i in range(len(self.pieces))
                ]
                continue
            vehicle = self.flights.amended({e: self.setting[e] for e in effects if e != effect})
            parts[effect] = [
                base - self._acceleration(s, vehicle)
                for s, base in zip(self.signals, self._base, strict=True)
            ]
        found = variables(self.tracks, [p.t for p in self.pieces])
        for columns, of in ((acting, parts), (moved, poses)):
            for (group, name), column in changing_columns(of, found).items():
                columns["", f"{UNKNOWN}{group}: {name}"] = column

    def _add_what_any_flight_may_have(self) -> None:
        """Add the columns of time offsets, of rotors between samples and of the model's error."""
        acting, moved = self._columns
        acting[ROTOR_TIME_OFFSET] = self._later_rotors()
        acting["", BETWEEN] = self._bent_rotors()
        for name, column in self._model_errors().items():
            acting["", f"{MODEL_ERROR} {name}"] = column
        if self._rounding_std > 0.0:
            for axis, column in zip("xyz", self._rounded_torques(), strict=True):
                acting["", ROUNDED + axis] = column
        moved[ATTITUDE_TIME_OFFSET] = []
        for track in self.tracks:
            # the rate before the sample is read: after it, it knows that sample's noise
            rate = track.angular_velocity + self.period * track.acceleration[:, 3:]
            rate = np.vstack([track.angular_velocity[:1], rate[:-1]])
            moved[ATTITUDE_TIME_OFFSET].append(np.column_stack([np.zeros_like(rate), -rate]))

    def quieter(self, coefficients: Mapping[Column, float]) -> Sums:
        """Return the sums of the same columns with the noise that is likeliest beside them all, at
        these coefficients.

        What an effect explains counts as a disturbance where the effect is not known. Beside the
        whole library the noise is that of a flight of which everything is known.
        """
        noise, tracks = self.noise, self.tracks
        self.noise, known = self._likeliest(self._explained(coefficients))
        heard = [track.innovations for track in self._run(self.noise, known)]
        self.tracks = [
            replace(track, innovations=x) for track, x in zip(self.tracks, heard, strict=True)
        ]
        out = self._products(*self._columns)
        self.noise, self.tracks = noise, tracks
        return out

    def _explained(self, coefficients: Mapping[Column, float]) -> list[Array]:
        """Return what the columns move the pose of each piece by, and accelerate (n, 2, 6)."""
        acting, moved = self._columns
        explained = []
        for i, track in enumerate(self.tracks):
            x = np.zeros((len(track.position), 2, 6))
            for c, column in acting.items():
                x[:, 1] += coefficients.get(c, 0.0) * column[i]
            for c, column in moved.items():
                x[:, 0] += coefficients.get(c, 0.0) * column[i]
            specific = track.rotors[:, :1] / self.vehicle.mass
            x[:, 1, :3] += specific * (
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
        acting, moved = self._columns
        for slope in acting[column]:
            slope[:, :3] = 0.0
        axis = [c.name for c in get(column[0]).coefficients].index(column[1])
        (marker,) = playing(Role.MARKER)
        place = self._moved((marker, get(marker).coefficients[axis].name))
        moved[column] = [-x for x in place]

    def _model_errors(self) -> dict[str, list[Array]]:
        parts: dict[str, list[Array]] = {}
        answers = self._rotor_innovations()
        for track, answer in zip(self.tracks, answers, strict=True):
            specific = track.rotors[:, 0] / self.vehicle.mass
            for i, axis in enumerate("xyz"):
                force, torque = np.zeros((len(specific), 6)), np.zeros((len(specific), 6))
                force[:, :3] = specific[:, None] * track.rotation[:, :, i]
                torque[:, 3 + i] = track.rotors[:, 1 + i] / self.inertias[3 + i]
                parts.setdefault(f"of force {axis}", []).append(force)
                parts.setdefault(f"of torque {axis}", []).append(torque)
                # of rounded rotor speeds the flight loop's answer to the state shows too little,
                # and what answers the state stands for it
                expected = np.zeros_like(torque)
                expected[:, 3 + i] = torque[:, 3 + i] - answer[:, 1 + i]
                parts.setdefault(f"of expected torque {axis}", []).append(expected)
        return parts

    def _rotor_innovations(self) -> list[Array]:
        tracks, found = self._answers
        if tracks is not self.tracks:
            pairs = list(zip(self.pieces, self.tracks, strict=True))
            found = rotor_innovations(pairs, self.inertias[2:])
            self._answers = self.tracks, found
        return found

    def _jumps(self) -> tuple[list[Column], list[Array], NDArray[np.intp]]:
        """Return the columns of the gains on the rotors' innovations, their jumps (n, 6, e) of each
        piece, and which state jumps.

        Thrust and torques say something of the axes that they drive. And a loop that rolls or
        pitches the vehicle has seen where it is, and what pushes it aside.
        """
        rotors = self._rotor_innovations()
        kinds = (*(f"axis {axis}" for axis in DRIVEN), "roll aside", "pitch aside")
        names: list[Column] = [("", f"{GAIN} {kind} {state}") for kind in kinds for state in STATES]
        out = []
        units = np.array([self.period**2, self.period, 1.0])
        tilt = SIDEWAYS * self.flights.vehicle.gravity
        for found, track in zip(rotors, self.tracks, strict=True):
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
            jumps = directions[..., None] * units
            out.append(jumps.reshape(len(found), 6, len(names)))
        return names, out, np.tile(STATES, len(kinds))

    def _products(
        self, acting: Mapping[Column, list[Array]], moved: Mapping[Column, list[Array]]
    ) -> Sums:
        gains, jumps, jump_state = self._jumps()
        own = len(STATES) * len(DRIVEN)  # what the rotors say of other axes stays as it was fitted
        gains, jump_state, jumps = gains[:own], jump_state[:own], [x[:, :, :own] for x in jumps]
        names = (*(c for c in acting if c not in moved), *moved, *gains)
        count = len(names)
        gain = np.array([x.gain for x in self.noise])
        keep = np.exp(-self.period / np.array([x.time for x in self.noise]))
        std = np.array([x.innovation for x in self.noise])
        use = list(self.axes)
        length = round(LIKELIHOOD.block / self.period)
        skip = round(AXIS.settling_time / self.period)
        blocks, samples = [], 0
        for i, track in enumerate(self.tracks):
            state = np.zeros((6, 3, count))
            specific = track.rotors[:, 0] / self.vehicle.mass
            pull = np.stack(
                [
                    -specific[:, None] * track.rotation[:, :, 1],
                    specific[:, None] * track.rotation[:, :, 0],
                ],
                axis=2,
            )
            for begin in range(0, len(track.position), length):
                at = slice(begin, min(begin + length, len(track.position)))
                rows = at.stop - at.start
                asked = names[: count - len(gains)]
                x, y = np.zeros((rows, 6, len(asked))), np.zeros((rows, 6, len(moved)))
                for j, c in enumerate(asked):
                    if c in acting:
                        x[:, :, j] = acting[c][i][at]
                for j, column in enumerate(moved.values()):
                    y[:, :, j] = column[i][at]
                out = np.empty((rows, 6, count + 1))
                inner = np.empty((rows, 6, count))
                sensitivities(
                    self.period,
                    gain,
                    keep,
                    pull[at],
                    track.angular_velocity[at],
                    x,
                    y,
                    np.ascontiguousarray(jumps[i][at]),
                    jump_state,
                    state,
                    inner,
                )
                out[:, :, :count] = inner
                out[:, :, count] = track.innovations[at]
                out /= std[None, :, None]
                fit = self._fit[i][at].copy()
                fit[: max(skip - begin, 0)] = False
                kept = out[fit][:, use].reshape(-1, count + 1)
                if len(kept):
                    samples += len(kept) // len(use)
                    blocks.append(kept.T @ kept)
        value = np.array(
            [
                0.0
                if not effect or name.startswith((START_PREFIX, WHOLE_PREFIX))
                else self.flights.coefficients(self.setting, effect).get(name, 0.0)
                - declared((effect, name), self.flights)
                for effect, name in names
            ]
        )
        penalty = 2.0 * samples * float(np.log(std[use]).sum())
        return Sums(names, np.array(blocks), value, penalty)


def declared(column: Column, flights: Flights) -> float:
    """Return what the vehicle's file states of a column's coefficient, from which a coefficient of
    the likelihood counts; 0 where it states nothing.
    """
    effect, name = column
    if not effect or name.startswith(START_PREFIX):
        return 0.0
    return flights.coefficients({}, effect).get(name.removeprefix(WHOLE_PREFIX), 0.0)


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
