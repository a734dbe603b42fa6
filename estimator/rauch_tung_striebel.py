"""One step back in time: the link between two estimates of a filter, and the smoother's use of it.

Rauch, Tung and Striebel, *Maximum likelihood estimates of linear dynamic systems*, AIAA Journal
3(8), 1965; for sigma points Sarkka, *Unscented Rauch-Tung-Striebel smoother*, IEEE TAC 53(3), 2008.
With the covariance P of the filter before a prediction, P- after it, and the cross covariance C of
both errors, the estimate before, given the one after, has

    gain G = C P-^-1 and covariance K = P - G P- G',

    x_s = x + G (x_s' - x-'),  P_s = K + G P_s' G',

a prime being the later time. Differences of states are error states (rho, omega, x, v, torque,
force) with the world-frame MRP of (24) and (25). K is a conditional covariance and P_s a sum of two
positive matrices, so nothing is subtracted on the way back. C comes from the sigma points of the
filter's own prediction. With the columns S of the root of P and half differences H after the step,
C is ``S' H`` plus the linear part ``M A'``, exactly as of 61 points.

``G = 0, K = P`` cuts: later measurements say nothing about earlier states. A restart cuts. A
covariance held at a bound cuts, too: it shares no probability distribution with the covariance
before.
"""

import math

import numpy as np

from ..dynamics.rotation import normalise
from ..runtime.compiled import Record, compiled
from .covariance import divide, divide_transposed, root_of
from .error_state import displace, error_from
from .estimate import NIS, STATE_SIZE, Array
from .filter_record import N
from .model_uncertainty import LOAD
from .recovery import lost_attitude, lost_position
from .sample import check_sample, undo_sensing
from .ukf import correct_parts, predict

_ROUNDING = 1e-13  # of a variance: the smallest that is left of it
# of a variance: P and P- that leave less than minus this have no joint distribution; rounding
# stays four orders below
_NO_JOINT = 1e-8

# An estimate of the filter, and what leads from it back to the one before
LINK = np.dtype(
    [
        ("x", "f8", (STATE_SIZE,)),  # the estimate
        ("predicted", "f8", (STATE_SIZE,)),  # the same before its measurement
        ("G", "f8", (N, N)),  # gain, transposed
        ("K", "f8", (N, N)),  # covariance of the estimate before, given this one
        ("load", "f8", LOAD),  # as of the filter
        ("passed", "f8", (6,)),  # of torque and force, share of a change that the one before makes
    ]
)


@compiled
def cross_covariance(f: Record) -> Array:
    """Return the cross covariance (18, 18) of the errors before (rows) and after (columns) the
    prediction that ``f`` has just made.
    """
    pairs = 6 if f.wrench_count == 0 else 12
    C: Array = f.S[:pairs].T @ f.H[:pairs]
    C[6:] += f.Z
    return C


@compiled
def link_back(P: Array, C: Array, after: Array, G: Array, K: Array) -> None:
    """Write the gain, transposed, into ``G`` and the conditional covariance into ``K``, all
    (18, 18).

    Args:
        P: covariance before the prediction.
        C: cross covariance.
        after: covariance after the prediction.
        G: the gain's transpose: row j is what an error in number j afterwards says.
        K: covariance of the estimate before, given the one after.
    """
    L = root_of(after)
    W = divide(L, C.T)
    left = P - W.T @ W
    K[:] = 0.5 * (left + left.T)
    G[:] = W
    divide_transposed(L, G)
    if not (math.isfinite(np.trace(L)) and _hold_positive(K, P)):
        cut(P, G, K)


@compiled
def cut(P: Array, G: Array, K: Array) -> None:
    """Make a link across which nothing passes."""
    G[:], K[:] = 0.0, P


@compiled
def _hold_positive(K: Array, P: Array) -> bool:
    """Restore on the diagonal of ``K`` the loss by rounding, for a root; False if far more is
    missing. ``P`` gives the scale of rounding.
    """
    L = np.empty((N, N))
    for i in range(N):
        for j in range(i + 1):
            total = K[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if j < i:
                L[i, j] = total / L[j, j]
            else:
                floor = _ROUNDING * P[i, i] + 1e-300
                if not total > -_NO_JOINT * P[i, i]:
                    return False
                if total < floor:
                    K[i, i] += floor - total
                    total = floor
                L[i, i] = math.sqrt(total)
    return True


@compiled
def step_with_link(f: Record, z: Array, parts: int, dt: float, voltage: float, link: Record) -> int:
    """Do what ``ukf.step`` does, and write the link back to the estimate before it into ``link``
    (``LINK``).
    """
    usable: int = check_sample(f, z, parts)
    if usable < 0:
        return usable
    sample = undo_sensing(f, z, usable, dt)
    before, G, K, restarts = f.P.copy(), link.G, link.K, f.restarts
    G[:], K[:] = np.eye(N), 0.0  # without a prediction both estimates are of one state
    link.passed[:] = 1.0
    if dt > 0.0:
        predict(f, sample[0:4], dt, voltage)
        link.passed[:] = np.diag(before)[12:] / np.diag(f.P)[12:]
        link_back(before, cross_covariance(f), f.P, G, K)
        if lost_position(f) or lost_attitude(f):  # held, and no longer predicted
            cut(before, G, K)
    link.predicted[:] = f.x
    correct_parts(f, sample, usable)
    if f.restarts > restarts:
        cut(before, G, K)
        link.passed[:] = 0.0
    link.x[:], link.load[:] = f.x, f.load
    return usable


@compiled
def step_back(x: Array, P: Array, link: Record, earlier: Array) -> None:
    """Replace the smoothed state ``x`` (20,) and its covariance ``P`` (18, 18) by those one link
    earlier, where the filter had the state ``earlier`` (20,).
    """
    difference, G = np.empty(N), link.G
    error_from(x, link.predicted, difference)
    displace(earlier, difference @ G, 1.0, np.empty(3), np.empty(4), x)
    normalise(x[3:7])
    x[NIS] = earlier[NIS]
    smoothed = link.K + G.T @ (P @ G)
    P[:] = 0.5 * (smoothed + smoothed.T)
