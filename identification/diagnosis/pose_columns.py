"""Columns of a likelihood of poses: the effect of a unit of everything a model may lack."""

import math
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ...dynamics.effects import Role, get, playing
from ...dynamics.vehicle import EffectSetting
from ...runtime.errors import InputError
from ..logs.flight_log import FlightLog
from ..logs.table import Array
from ..motion.sensing_effects import undo_log_sensing
from ..motion.signals import Signals, in_body
from ..motion.smoothing import turn_between
from .causal_filter import Track
from .coefficients import CENTRAL, STEP, Setting, is_delay, typical_size, without
from .column import Column, Columns, Part, Product, along_axis
from .discrepancy import changing_columns, discrepancy_columns, variables
from .gusty_wind import gusts
from .log_offsets import ATTITUDE_TIME_OFFSET, LAG_ASYMMETRY, ROTOR_TIME_OFFSET
from .priors import MODEL_ERROR, Starts, variants_of
from .raw_poses import Poses
from .regression import RegressedFlights
from .rotor_innovations import DRIVEN


class PoseColumns:
    """The columns of flights near a setting of effects, kept once computed.

    ``acting`` has accelerations by a unit of each column, and ``posed`` shifts of the measured pose
    (n, 6), of all pieces in turn.

    Args:
        flights: the vehicle's flights.
        setting: the coefficients, about which the model is linearised.
        poses: the pieces as measured.
        track: as the filter sees them.
    """

    def __init__(
        self, flights: RegressedFlights, setting: Setting, poses: Poses, track: Track
    ) -> None:
        self.flights = flights
        self.setting = setting
        self.poses = poses
        self.track = track
        # each piece as the filter sees the flight between samples
        later = np.roll(poses.rotor_speeds, -1, axis=0)
        later[poses.begins - 1] = poses.rotor_speeds[poses.begins - 1]
        names = ("t", "position", "rotation", "velocity", "angular_velocity")
        self.whole = whole = Signals(
            **{name: getattr(track, name) for name in names},
            period=poses.period,
            acceleration=track.acceleration[:, :3],
            angular_acceleration=track.acceleration[:, 3:],
            rotor_speeds=0.5 * (poses.rotor_speeds + later),
            voltage=poses.voltage if poses.voltage.any() else None,
        )
        self.signals = [whole.at(at) for at in poses.pieces]
        self._base = self._accelerations(setting, self.signals)
        self.acting: Columns = {}
        self.posed: Columns = {}

    def take(self, other: "PoseColumns") -> None:
        """Take the columns of any flight; they change little with effects."""
        self.acting, self.posed = (
            {c: x for c, x in part.items() if not c.effect and not c.is_unknown}
            for part in (other.acting, other.posed)
        )

    def add(self, library: Iterable[str], starts: Starts, unknown: bool) -> None:
        """Add the columns of effects, of whole effects, and, if ``unknown``, of the dictionary."""
        if playing(Role.LAG, among=self.setting):
            self._add(LAG_ASYMMETRY)
        if unknown and not any(c.is_unknown for c in self.acting):
            self.acting |= discrepancy_columns(
                self.whole, self.track.rotors, self.poses.begins[1:], self.flights
            )
            self._add_changing_coefficients()
        for c, start in starts.items():
            if c not in self.acting:
                self.acting[c] = Product.of(self._change({**self.setting, c.effect: dict(start)}))
        for effect in library:
            for columns in variants_of(self.flights, effect, self.setting, starts):
                for c in columns:
                    self._add(c)

    def add_what_any_flight_may_have(
        self, answers: Array, disturbed: Array, rounding: Array
    ) -> None:
        """Add the columns of time offsets, of rotors between samples, of the model's error, and of
        a flight loop's answers.

        Args:
            answers: (n, 4) the rotors' innovations.
            disturbed: (6,) standard deviations of the disturbances, m/s2 and rad/s2.
            rounding: (6,) likewise, of the accelerations by the rounding of rotor speeds.
        """
        self._add(ROTOR_TIME_OFFSET)
        # away from the straight line, by the second difference. The speeds are of k + 1/2: nothing
        # later than sample k + 1
        bent = [
            replace(s, rotor_speeds=s.rotor_speeds + np.pad(u, ((2, 0), (0, 0))))
            for s in self.signals
            for u in [np.diff(s.rotor_speeds, 2, axis=0)]
        ]
        change = self._accelerations(self.setting, bent) - self._base
        self.acting[Column("", "", Part.BETWEEN_SAMPLES)] = Product.of(change)
        self._add_model_errors(answers, rounding)
        self._add_answers(disturbed)
        # the rate before the sample is read: the rate after holds the sample's noise
        after = (
            self.track.angular_velocity + 0.5 * self.poses.period * self.track.acceleration[:, 3:]
        )
        rate = np.roll(after, 1, axis=0)
        rate[self.poses.begins] = self.track.angular_velocity[self.poses.begins]
        self.posed[ATTITUDE_TIME_OFFSET] = Product.of(np.hstack([np.zeros_like(rate), -rate]))

    def add_gusts(self) -> None:
        """Add the columns of a wind's changes."""
        t = self.poses.period * np.arange(len(self._base), dtype=np.float64)
        for wind, shape in gusts(t, self.setting, self.flights).items():
            slope = self._slope(wind)[:, :3]
            for k, x in enumerate(shape.T):
                column = Column("", wind.coefficient, Part.GUST, k)
                self.acting[column] = Product(1.0, x, slope)

    def explained(self, coefficients: Mapping[Column, float]) -> Array:
        """Return the change of the pose and of the acceleration (2, n, 6)."""
        turn = self.track.rotation
        pose, force = x = np.zeros((2, len(turn), 6))
        for change, columns in ((pose, self.posed), (force, self.acting)):
            for c, column in columns.items():
                if c in coefficients:
                    change += coefficients[c] * column.whole
        tilt = pose[:, 4:5] * turn[:, :, 0] - pose[:, 3:4] * turn[:, :, 1]
        force[:, :3] += self.track.rotors[:, :1] * tilt
        return x

    def _accelerations(self, setting: Setting, signals: Iterable[Signals]) -> Array:
        """Return the accelerations (n, 6) of a setting along the pieces' signals."""
        unit = replace(self.flights.vehicle, mass=1.0, inertia=np.eye(3))
        return np.concatenate([self.flights.acting(s, setting, body=unit) for s in signals])

    def _change(self, setting: Setting, units: float = 1.0) -> Array:
        """Return the change of the acceleration (n, 6) with a setting so many units away."""
        return (self._accelerations(setting, self.signals) - self._base) / units

    def _add(self, column: Column) -> None:
        """Add a coefficient's column, unless there already or no such vehicle is possible."""
        effect = column.effect
        if column in self.acting or column in self.posed:
            return
        if effect and is_delay(effect):
            self.acting[column] = self.acting[ROTOR_TIME_OFFSET]
            return
        if effect and get(effect).kind == "sensing":
            self.posed[column] = Product.of(self._moved(column))
            return
        with suppress(InputError, np.linalg.LinAlgError):
            change = self._slope(column)
            if effect and get(effect).role == Role.CENTRE_OF_MASS:
                self._swing(column, change)
            self.acting[column] = Product.of(change)

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
        self.posed[column] = Product.of(moved)

    def _add_changing_coefficients(self) -> None:
        """Add the dictionary's columns: effects of the setting with changing coefficients."""
        followed = variables(self.whole, self.track.rotors)
        for effect, own in self.setting.items():
            if get(effect).kind == "sensing" and not is_delay(effect):
                moved = [x * self._moved(Column(effect, name)) for name, x in own.items()]
                self.posed |= changing_columns({effect: np.sum(moved, axis=0)}, followed)
            else:
                change = -self._change(without(self.setting, effect))
                self.acting |= changing_columns({effect: change}, followed)

    def _add_model_errors(self, answers: Array, rounding: Array) -> None:
        """Add the columns of slightly larger forces and torques, and of the torques expected from
        the flight loop's answer to the state.

        Rounding biases an expected torque low, by its share of the variance (errors in variables):
        in a hover rounding hides the little torque.
        """
        rounded = 2.0 * np.square(rounding[3:])
        rotation = self.track.rotation
        thrust, *torques = self.track.rotors.T
        for i, torque in enumerate(torques):
            expected = torque - answers[:, 1 + i]
            share = rounded[i] / max(expected.var(), rounded[i])
            own = along_axis(3 + i, rotation)
            errors = {
                "force": Product(1.0, thrust, *along_axis(i, rotation)),
                "torque": Product(1.0, torque, *own),
                "expected torque": Product(math.hypot(1.0, share / MODEL_ERROR), expected, *own),
            }
            for name, x in errors.items():
                self.acting[Column("", f"{name} {'xyz'[i]}", Part.MODEL_ERROR)] = x

    def _add_answers(self, disturbed: Array) -> None:
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
        for axis, rotors, own in zip(DRIVEN, whole.rotors.T, states, strict=True):
            size = max(rotors.std(), 1e-9)
            answer = min((disturbed[axis] / size) ** 2, 1.0) * size
            change = np.diff(rotors, prepend=rotors[:1])
            along = along_axis(axis, whole.rotation)
            for i, x in enumerate((rotors - rotors.mean(), change, *own)):
                column = Product(answer / max(x.std(), 1e-9), x, *along)
                self.acting[Column("", f"answer {i} of axis {axis}", Part.NUISANCE)] = column
