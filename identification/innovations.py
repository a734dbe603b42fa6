"""Whether what seems to explain a residual acts on the vehicle, or is the flight loop's answer to gusts.

A flight loop works against every gust, so rotors, attitude and velocity follow it, and a law of one of these seems to explain
it. Looked at from the past alone it does not: what no past pose foretells of the next one, the innovation of a filter that
knows how gusts last, no answer can have followed yet. So a change of the model is asked how much of itself the innovations
confirm: all of it if it is a law, nothing if it is an answer, unknown as the loop is. (With a model of the noise, prediction
errors identify in closed loop: L. Ljung, System Identification, 2nd edition, 1999, section 13.4.)
"""

import itertools
from collections.abc import Callable, Sequence
from functools import cache, lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.linalg import expm, solve_discrete_are
from scipy.signal import lfilter, ss2tf
from scipy.spatial.transform import Rotation

from .regression import SHIFT, Flights, Piece, Setting
from .sensing import undo_log_sensing
from .signals import log_signals

Array = NDArray[np.float64]

_SHARE = 0.5  # laws have 0.8 to 1.4, answers -5 to 0.2
_ENERGY = 20.0  # twice the gain of the likelihood's logarithm, that it must have: chance has one an axis
_AT_ODDS, _SURELY = 0.1, 2.0  # of a share beside one, and of its standard deviations; 200 true effects had up to 0.05
_SETTLED = 1.0  # s, from the start of a piece to the first innovation that counts
_STRENGTHS = 2.0 ** np.arange(-10, 47)  # of gusts, as ``_filters`` has them
_TIMES = 0.25 * 1.5 ** np.arange(-6, 6)  # s, of gusts
_GUSTS = (24, 6)  # where among these the search begins
_STRIDES = (4, 2, 1)  # of that search
_TINY = 1e-300
_CLOCK = "clock_offset", "dt"


class Innovations:
    """What flights confirm of changes of a model.

    Args:
        flights: whose rotors are measured.
        setting: the effects of the model.
    """

    def __init__(self, flights: Flights, setting: Setting) -> None:
        self._flights, self._setting = flights, setting
        self._poses: dict[int, tuple[Piece, Array]] = {}
        self._motions = self._seen(setting)
        self._counts = []
        rows = np.split(flights.fit, np.flatnonzero(flights.start)[1:])
        for piece, fit in zip(flights.pieces(setting), rows, strict=True):
            t, k = piece.signals.t, np.arange(len(piece.signals.t))
            near = fit[np.searchsorted(piece.rows, k).clip(max=len(fit) - 1)]
            self._counts.append(near & (t > t[0] + _SETTLED) & (k <= piece.rows[-1]))

    def confirm(self, after: Setting) -> bool:
        """Return whether innovations confirm the change to the effects ``after``."""
        return _confirmed(*self.share(after))

    def share(self, after: Setting) -> tuple[float, float]:
        """Return the share of that change which makes the innovations least, and the energy that it then explains."""
        return self._share([new - old for old, new in zip(self._motions, self._seen(self._timed(after)), strict=True)])

    def confirm_column(self, column: Array) -> bool:
        """Return whether they confirm a change of the model's force (N, world) and torque (Nm, body) at the rows (rows, 6)."""
        changes = []
        parts = np.split(column, np.flatnonzero(self._flights.start)[1:])
        for motion, piece, part in zip(self._motions, self._flights.pieces(self._setting), parts, strict=True):
            change = np.zeros_like(motion)
            at = np.arange(motion.shape[1]).clip(piece.rows[0], piece.rows[-1])
            change[1] = self._accelerations(CubicSpline(piece.rows, part)(at))
            changes.append(change)
        return _confirmed(*self._share(changes))

    def _share(self, changes: Sequence[Array]) -> tuple[float, float]:
        """Return the share of changes of the motions that makes the innovations least, of all axes together, and its energy.

        Each axis has gusts of its own, an Ornstein-Uhlenbeck acceleration. Their strength and time are those that make its
        innovations least (maximum likelihood), once together with a share and once without any: the energy is what the share
        gains over other gusts.
        """
        axes = [self._axis([np.stack([-motion[..., axis], change[..., axis]], axis=-1)
                            for motion, change in zip(self._motions, changes, strict=True)])
                for axis in range(6) if any(np.any(change[..., axis]) for change in changes)]
        cross, square = (sum(n * x[row, 1] / _left(x) for n, x, _ in axes) for row in (0, 1))
        share = float(cross / max(square, _TINY))
        rest = np.array([-1.0, share])
        energy = sum(n * float(np.log(max(without[0, 0], _TINY) / max(rest @ x @ rest, _TINY))) for n, x, without in axes)
        return share, energy

    def _axis(self, both: Sequence[Array]) -> tuple[int, Array, Array]:
        """Return how many innovations one axis has and their sums of products (2, 2), with those of a change.

        Once with the gusts that suit both, once with those that suit the innovations alone. Each piece is (2, n, 2).
        """
        counts, pieces = self._counts, self._flights.pieces(self._setting)

        @cache
        def products(strength: int, time: int) -> Array:
            found = [_innovations(pose, drive, float(_STRENGTHS[strength]), float(_TIMES[time]), piece.signals.period)[counted]
                     for (pose, drive), piece, counted in zip(both, pieces, counts, strict=True)]
            return np.asarray(sum(x.T @ x for x in found))

        found = [products(*_least(lambda *gusts: _left(products(*gusts)))),
                 products(*_least(lambda *gusts: float(products(*gusts)[0, 0])))]
        return sum(int(np.count_nonzero(x)) for x in counts), min(found, key=_left), min(found, key=lambda x: float(x[0, 0]))

    def _timed(self, after: Setting) -> Setting:
        """Return ``after`` with a change of the clock made by moving the turn rates: moved poses take their noise along."""
        effect, name = _CLOCK
        if effect not in after:
            return after
        own = self._setting.get(effect, {})
        shifts = dict(after.get(SHIFT[0], {}))
        shifts[SHIFT[1]] = shifts.get(SHIFT[1], 0.0) + after[effect][name] - own.get(name, 0.0)
        return {**{k: v for k, v in after.items() if k != effect}, SHIFT[0]: shifts, **({effect: own} if own else {})}

    def _seen(self, setting: Setting) -> list[Array]:
        """Return of each piece (2, n, 6) the pose as measured, and the model's acceleration, linear (world) and angular (body).

        The pose's angle (rad) is what the body rates add up to. The attitude is always the same: a gain of it would make the
        innovations small by taking their own noise away.
        """
        out = []
        pieces = self._flights.pieces(setting)
        for piece, like, model in zip(pieces, self._flights.pieces(self._setting), self._flights.model(setting), strict=True):
            pose = np.column_stack([self._raw(setting, piece)[:, :3], self._raw(self._setting, like)[:, 3:]])
            begun = np.concatenate([like.signals.velocity[0], like.signals.rate[0]])
            fallen = self._flights.vehicle.gravity * np.array([0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
            out.append(np.stack([pose - np.outer(piece.signals.t - piece.signals.t[0], begun),
                                 self._accelerations(model) - fallen]))
        return out

    def _raw(self, setting: Setting, piece: Piece) -> Array:
        """Return the pose (n, 6) of a piece, from its start, without the low-pass that knows of the future."""
        if id(piece) not in self._poses:
            log = undo_log_sensing(self._flights.logs[piece.log], self._flights.amended(setting))
            signals = next(s for s in log_signals(log, np.inf) if s.t[0] == piece.signals.t[0])
            turned = Rotation.from_matrix(signals.rotation)
            angle = np.vstack([np.zeros(3), np.cumsum((turned[:-1].inv() * turned[1:]).as_rotvec(), axis=0)])
            self._poses[id(piece)] = piece, np.column_stack([signals.position - signals.position[0], angle])
        return self._poses[id(piece)][1]

    def _accelerations(self, wrench: Array) -> Array:
        """Return the linear and the angular acceleration (n, 6) of a force and a torque (n, 6)."""
        vehicle = self._flights.vehicle
        return np.column_stack([wrench[:, :3] / vehicle.mass, np.linalg.solve(vehicle.inertia, wrench[:, 3:].T).T])


def _confirmed(share: float, energy: float) -> bool:
    return share > _SHARE and energy > _ENERGY


def at_odds(flights: Flights, setting: Setting) -> list[str]:
    """Return, in words, which effects of a fitted setting are not what the innovations make of them.

    A law is the same below 5 Hz, from both sides, as it is from the past alone and at all frequencies; what merely stands for
    another one seldom is. (Two estimates that must agree: J. A. Hausman, Econometrica 46 (1978), 1251-1271.)
    """
    out = []
    for effect in filter(None, setting):
        share, energy = Innovations(flights, {k: v for k, v in setting.items() if k != effect}).share(setting)
        if abs(share - 1.0) > max(_AT_ODDS, _SURELY * abs(share) / np.sqrt(max(energy, _TINY))):
            out.append(f"{effect}: what no past pose foretells bears out {share:.0%} of it: another effect may be behind it")
    return out


def _least(loss: Callable[[int, int], float]) -> tuple[int, int]:
    """Return which strength and time of gusts make a loss least, by steps to the best neighbour, large ones first."""
    known = {_GUSTS: loss(*_GUSTS)}
    at = _GUSTS
    for stride in _STRIDES:
        while True:
            for i, j in itertools.product((-stride, 0, stride), repeat=2):
                near = (int(np.clip(at[0] + i, 0, len(_STRENGTHS) - 1)), int(np.clip(at[1] + j, 0, len(_TIMES) - 1)))
                if near not in known:
                    known[near] = loss(*near)
            best = min(known, key=known.__getitem__)
            if best == at:
                break
            at = best
    return at


def _left(products: Array) -> float:
    """Return the energy that the best multiple of a change leaves of innovations, of their sums of products (2, 2)."""
    return max(float(products[0, 0] - products[0, 1] ** 2 / max(products[1, 1], _TINY)), _TINY)


def _innovations(pose: Array, drive: Array, strength: float, time: float, period: float) -> Array:
    """Return the innovations (n, c) of a pose (n, c) of one axis that an acceleration (n, c) drives, and gusts.

    ``strength`` is the gusts' variance, in the acceleration's unit squared, over that of the pose's noise; ``time`` (s) theirs.
    """
    poles, from_pose, from_drive = _filters(strength, time, period)
    acting = 0.5 * (drive + np.concatenate([drive[1:], drive[-1:]]))  # until the next pose
    return np.asarray(lfilter(from_pose, poles, pose, axis=0) + lfilter(from_drive, poles, acting, axis=0))


@lru_cache(maxsize=4096)
def _filters(strength: float, time: float, period: float) -> tuple[Array, Array, Array]:
    """Return the denominator (4,) and the numerators (4,) of the innovations' filters, of the pose and of what drives it.

    Those of the steady Kalman filter with the states pose, velocity (a period) and gust (a period squared).
    """
    rate = period / time
    A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -rate]])
    # C. F. Van Loan, IEEE Transactions on Automatic Control 23 (1978): what the gusts add over a period
    both = np.zeros((6, 6))
    both[:3, :3], both[3:, 3:], both[2, 5] = -A, A.T, 2.0 * rate * strength * period**4
    both = expm(both)
    F = both[3:, 3:].T
    Q = F @ both[:3, 3:]
    H, B = np.eye(1, 3), np.array([[0.5], [1.0], [0.0]]) * period**2
    P = solve_discrete_are(F.T, H.T, 0.5 * (Q + Q.T), np.eye(1))
    K = P @ H.T / (H @ P @ H.T + 1.0)
    after = F @ (np.eye(3) - K @ H)
    from_pose, poles = ss2tf(after, F @ K, -H, np.eye(1))
    from_drive, _ = ss2tf(after, B, -H, np.zeros((1, 1)))
    return poles, from_pose[0], from_drive[0]
