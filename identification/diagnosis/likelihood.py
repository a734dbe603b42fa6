"""The likelihood of a flight's poses as a regression of whitened innovations: one Gram matrix.

Everything a model may lack is a column: a unit of a coefficient, through the same causal filter as
the poses. The noise of each axis is fitted first, at maximum likelihood. With this noise the
innovations are white. Sums of products then give the log-likelihood of any set of coefficients near
the setting.
"""

import functools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import replace

import numpy as np

from ... import _core
from ...dynamics.vehicle import Vehicle
from ..findings import CHANNELS, Disturbance
from ..logs.table import Array
from ..motion.sensing_effects import sensing_of
from ..motion.sensor_noise import sensor_noise
from ..motion.smoothing import filtered
from .causal_filter import Track, level
from .coefficients import Setting
from .column import Column, Part, Product
from .flight_rows import BLOCK
from .noise_search import FIRST_TIME, NoiseSearch
from .pose_columns import PoseColumns
from .priors import GAINS, Base, Starts, in_prior_units
from .raw_poses import Poses
from .regression import RegressedFlights
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
            self.poses = Poses.read(flights, self.vehicle, self.finer)
        # the states (3,) after a period of one m/s2 or rad/s2
        period = self.poses.period
        self._units = np.array([period**2, period, 1.0])
        if not near:
            self.noise = self._first_noise()
            # on the rotors' innovations
            self.gains: Array = np.zeros((len(PAIRS), len(JUMP_STATE)))
            self.steady = steady_filter(self.noise, period, self.vehicle.gravity)
            self._see_rotors()
        self.jumps = self._jumps()
        if near and (same_noise or gusty):
            self._run()
            if np.isnan(self.track.predicted).any():
                raise np.linalg.LinAlgError("the filter diverges with these effects")
        else:
            self._search_noise()
        columns = PoseColumns(flights, setting, self.poses, self.track)
        if near and same_noise:
            columns.take(near.columns)
        else:
            disturbed = np.array([gust.rms for gust in self.gusts()]) / flights.inertias
            columns.add_what_any_flight_may_have(self.answers, disturbed, self._rounding())
        self.columns: PoseColumns = columns
        if self.gusty:
            columns.add_gusts()
            if not same_noise:
                base = self.base((), {})
                drawn = base.mode(base.plain, draw=True).items()
                blown = {c: x for c, (x, _) in drawn if c.part == Part.GUST}
                self._search_noise(columns.explained(blown))

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
        self.track = Track.of(self.poses, self.vehicle, self.steady, self.known)

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
                pose, force = map(Product.of, explained)
                each = self._changes([force], [pose], every=True)
                left = np.diff(np.concatenate([x for _, x in each])).reshape(-1, 6)
                left = left @ np.linalg.inv(steady.whitening).T
                self.track = replace(self.track, innovations=left)
            return self.track.innovations[self.poses.counted]

        def products(slopes: Array) -> Array:
            each = self._changes(shares=OF_PAIRS, slopes=slopes)
            return functools.reduce(np.add, (x.T @ x for _, x in each))

        search = NoiseSearch(see, products, HELD, self.poses.period, self.vehicle.gravity)
        self.noise, self.gains = search.likeliest(self.noise, self.gains)
        self.steady = steady_filter(self.noise, self.poses.period, self.vehicle.gravity)
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

    # Products

    def base(self, library: Iterable[str], starts: Starts, unknown: bool = False) -> Base:
        """Return the likelihood of the coefficients of effects, and of everything any flight may
        have, with all columns of earlier calls.

        Args:
            library: names of effects. Coefficients fixed by the vehicle's file are not fitted.
            starts: columns of whole effects, with the coefficients of each.
            unknown: whether the discrepancy's columns are wanted.
        """
        self.columns.add(library, starts, unknown)
        return self._products(starts)

    def quieter(self, coefficients: Mapping[Column, float], starts: Starts) -> Base:
        """Return the likelihood of the same columns, with the likeliest noise beside them all at
        these coefficients.

        An unknown effect's deviance counts as a disturbance. Beside the whole library the noise is
        the noise of a flight without unknown effects.
        """
        out = copy(self)
        out._search_noise(self.columns.explained(coefficients))
        out.track = replace(
            self.track,
            heading=out.track.heading,
            innovations=out.track.innovations,
            disturbance=out.track.disturbance,
        )
        return out._products(starts)

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
        acting, moved = self.columns.acting, self.columns.posed
        asked = (*(c for c in acting if c not in moved), *moved)
        # the gains on axes the rotors do not drive stay as fitted
        drives = [
            Column("", f"axis {axis}", Part.GAIN, state) for axis in DRIVEN for state in STATES
        ]
        n = len(self.poses.t)
        still = Product(0.0, Product.ones(n), Product.ones(n, 1))
        x = [acting.get(c, still) for c in asked]
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
        length = round(BLOCK / self.poses.period)
        track = self.track
        counted = self.poses.counted | every
        for piece in self.poses.pieces:
            state = np.zeros((6, 3, count))
            # one block's columns are in memory at a time
            for begin in range(piece.start, piece.stop, length):
                at = slice(begin, min(begin + length, piece.stop))
                out = np.empty((counted[at].sum(), 6, count + 1))
                _core.sensitivities(
                    self.poses.period,
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


def _twist(vehicle: Vehicle) -> Array:
    """Return the derivative (3, 3, 3) of the angular acceleration by the angular velocity, for a
    velocity of one about each axis.
    """
    # -u x J v over the inertia J, of all pairs of axes u and v
    twist = -np.cross(np.eye(3)[:, None], vehicle.inertia) @ np.linalg.inv(vehicle.inertia)
    return np.swapaxes(twist + twist.swapaxes(0, 1), 1, 2)
