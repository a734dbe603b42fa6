"""One step back in time: the link between two estimates of a filter, and the smoother's use of it.

Rauch, Tung and Striebel, *Maximum likelihood estimates of linear dynamic systems*, AIAA Journal
3(8), 1965; for sigma points Sarkka, *Unscented Rauch-Tung-Striebel smoother*, IEEE TAC 53(3), 2008.
With the covariance P of the filter before a prediction, P- after it, and the cross covariance C of
both errors, the estimate before, given the one after, has

    gain G = C P-^-1 and covariance K = P - G P- G',

    x_s = x + G (x_s' - x-'),  P_s = K + G P_s' G',

a prime being the later time. Differences of states are error states (rho, omega, x, v, torque,
force) with the world-frame MRP of (24) and (25). K is a conditional covariance and P_s a sum of
two positive matrices, so nothing is subtracted on the way back. C comes from the sigma points of
the very prediction that the filter makes: with the columns S of the root of P and half differences
H after the step, it is ``S' H`` plus the linear part ``M A'``, exactly what 61 points would give.

``G = 0, K = P`` cuts: nothing that is seen later says anything about earlier. That is done where
the filter restarts, and where its covariance was held at a bound, since it is then no longer that
of one probability distribution with the covariance before.
"""

import math

import numpy as np

from ..dynamics.rotation import normalise
from ..runtime.compiled import Record, compiled, compiled_for_vectors, compiled_inline
from .covariance import add_squares
from .error_state import displace, error_from
from .estimate import NIS, STATE_SIZE, Array
from .filter_record import N
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
        ("C", "f8", (N, N)),  # working memory
    ]
)
WORK = (N + 2, N)  # shape of the working memory


@compiled_for_vectors
def cross_covariance(f: Record, C: Array) -> None:
    """Write the cross covariance (18, 18) of the errors before (rows) and after (columns) the
    prediction that ``f`` has just made into ``C``.
    """
    S, H, Y = f.S, f.H, f.Y
    for i in range(N):
        for j in range(N):
            C[i, j] = 0.0
    for i in range(6, N):
        for j in range(N):
            C[i, j] = Y[j, i - 6]
    for r in range(6 if f.wrench_count == 0 else 12):
        for i in range(N):
            a = S[r, i]
            for j in range(N):
                C[i, j] += a * H[r, j]


@compiled_for_vectors
def link_back(P: Array, C: Array, after: Array, G: Array, K: Array) -> None:
    """Write the gain, transposed, into ``G`` and the conditional covariance into ``K``, all
    (18, 18).

    Args:
        P: covariance before the prediction.
        C: cross covariance; it is overwritten.
        after: covariance after the prediction; its root overwrites ``K`` on the way.
        G: the gain's transpose: row j is what an error in number j afterwards says.
        K: covariance of the estimate before, given the one after.
    """
    L = K
    possible = _root(after, L)
    # W = L^-1 C', row by row into G; then K = P - W' W and G' = L^-T W
    for i in range(N):
        for j in range(N):
            G[i, j] = C[j, i]
    for i in range(N):
        for k in range(i):
            a = L[i, k]
            for j in range(N):
                G[i, j] -= a * G[k, j]
        scale = 1.0 / L[i, i]
        for j in range(N):
            G[i, j] *= scale
    W = C
    for i in range(N):
        for j in range(N):
            W[i, j] = G[i, j]
    for i in range(N - 1, -1, -1):
        scale = 1.0 / L[i, i]
        for j in range(N):
            G[i, j] *= scale
        for k in range(i):
            a = L[i, k]
            for j in range(N):
                G[k, j] -= a * G[i, j]
    for i in range(N):
        for j in range(N):
            K[i, j] = P[i, j]
    for k in (0, 6, 12):
        add_squares(K, W, k, -1.0)
    for i in range(N):
        for j in range(i):
            K[i, j] = K[j, i] = 0.5 * (K[i, j] + K[j, i])
    if not (possible and _hold_positive(K, P, W)):
        cut(P, G, K)


@compiled_inline
def cut(P: Array, G: Array, K: Array) -> None:
    """Make a link across which nothing passes."""
    for i in range(N):
        for j in range(N):
            G[i, j], K[i, j] = 0.0, P[i, j]


@compiled_inline
def _root(A: Array, L: Array) -> bool:
    """Write the lower Cholesky factor of ``A`` (18, 18) into ``L``; False if A is not finite."""
    finite = True
    for i in range(N):
        for j in range(i + 1):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            if j < i:
                L[i, j] = total / L[j, j]
            else:
                finite = finite and math.isfinite(total)
                L[i, i] = math.sqrt(max(total, _ROUNDING * A[i, i] + 1e-300))
    return finite


@compiled_inline
def _hold_positive(K: Array, P: Array, L: Array) -> bool:
    """Add to the diagonal of ``K`` what rounding took off, so that it has a root; False if far more
    is missing.

    ``P`` gives the size of what K was left from; ``L`` is working memory.
    """
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
def step_with_link(
    f: Record, z: Array, parts: int, dt: float, voltage: float, link: Record, work: Array
) -> int:
    """Do what ``ukf.step`` does, and write the link back to the estimate before it into ``link``
    (``LINK``); ``work`` (20, 18) is overwritten.
    """
    usable: int = check_sample(f, z, parts)
    if usable < 0:
        return usable
    sample = undo_sensing(f, z, usable, dt)
    P, before, G, K, restarts = f.P, work[0:N], link.G, link.K, f.restarts
    for i in range(N):
        for j in range(N):
            before[i, j] = P[i, j]
            G[i, j], K[i, j] = 0.0, 0.0
        G[i, i] = 1.0  # without a prediction both estimates are of one state
    if dt > 0.0:
        predict(f, sample[0:4], dt, voltage)
        cross_covariance(f, link.C)
        link_back(before, link.C, P, G, K)
        if lost_position(f) or lost_attitude(f):  # held, and no longer predicted
            cut(before, G, K)
    for i in range(STATE_SIZE):
        link.predicted[i] = f.x[i]
    correct_parts(f, sample, usable)
    if f.restarts > restarts:
        cut(before, G, K)
    for i in range(STATE_SIZE):
        link.x[i] = f.x[i]
    return usable


@compiled
def step_back(x: Array, P: Array, link: Record, earlier: Array, work: Array) -> None:
    """Replace the smoothed state ``x`` (20,) and its covariance ``P`` (18, 18) by those one link
    earlier, where the filter had the state ``earlier`` (20,); ``work`` (20, 18) is overwritten.
    """
    error, difference, rest, G = work[N], work[N + 1], work[0], link.G
    error_from(x, link.predicted, difference)
    for i in range(N):
        error[i] = 0.0
    for k in range(N):
        a = difference[k]
        for i in range(N):
            error[i] += a * G[k, i]
    displace(earlier, error, 1.0, rest[0:3], rest[4:8], x)
    normalise(x[3:7])
    x[NIS] = earlier[NIS]
    _congruence(P, G, link.K, work[0:N])


@compiled_for_vectors
def _congruence(P: Array, G: Array, K: Array, T: Array) -> None:
    """Replace ``P`` by ``K + G' P G``, three rows at a time for speed."""
    _product(P, G, T)
    for i in range(0, N, 3):
        for j in range(N):
            P[i, j], P[i + 1, j], P[i + 2, j] = K[i, j], K[i + 1, j], K[i + 2, j]
        for k in range(N):
            a, b, c = G[k, i], G[k, i + 1], G[k, i + 2]
            for j in range(N):
                P[i, j] += a * T[k, j]
                P[i + 1, j] += b * T[k, j]
                P[i + 2, j] += c * T[k, j]
    for i in range(N):
        for j in range(i):
            P[i, j] = P[j, i] = 0.5 * (P[i, j] + P[j, i])


@compiled_inline
def _product(A: Array, B: Array, out: Array) -> None:
    """Write ``A B`` of (18, 18) matrices into ``out``, for a symmetric A."""
    for i in range(0, N, 3):
        for j in range(N):
            out[i, j], out[i + 1, j], out[i + 2, j] = 0.0, 0.0, 0.0
        for k in range(N):
            a, b, c = A[k, i], A[k, i + 1], A[k, i + 2]
            for j in range(N):
                out[i, j] += a * B[k, j]
                out[i + 1, j] += b * B[k, j]
                out[i + 2, j] += c * B[k, j]
