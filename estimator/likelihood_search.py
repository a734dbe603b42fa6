"""The likeliest parameters of innovations: Fisher scoring within bounds.

Newton's method with the expected information in place of the Hessian (Gupta and Mehra,
*Computational aspects of maximum likelihood estimation and reduction in sensitivity function
calculations*, IEEE Trans. Automatic Control 19, 1974). Scoring needs a tenth of the passes of a
quasi-Newton method, and leaves the covariance of the parameters.
"""

from collections.abc import Callable
from concurrent.futures import Executor

import numpy as np

from .estimate import Array
from .innovations import Innovations, fisher_information

_DIFFERENCE = 1e-3  # in a parameter, for slopes
_LONGEST = 1.5  # largest step of a parameter
_TOLERANCE = 0.2  # expected gain of log-likelihood at which the search ends
_MOST = 40  # steps
_RIDGE = 1e-2  # least information on a parameter: without any, its value stays


def climb(
    evaluate: Callable[[Array], Innovations], start: Array, bounds: Array, threads: Executor
) -> tuple[Array, Array]:
    """Return the likeliest parameters (n,) near a start, and their standard deviations (n,), NaN on
    a bound.

    Args:
        evaluate: the pass with parameters (n,); called in several threads at once.
        start: (n,), within the bounds.
        bounds: (n, 2).
        threads: for the slopes.
    """
    x, low, high = start, *bounds.T
    here = evaluate(x)
    damping = 1e-3
    deviation = np.full(len(x), np.nan)
    for _ in range(_MOST):
        # towards the middle, within the bounds
        steps = np.where(x < 0.5 * (low + high), _DIFFERENCE, -_DIFFERENCE)
        moved = list(threads.map(evaluate, x + np.diag(steps)))
        total = here.log_likelihood.sum()
        slope = np.array([m.log_likelihood.sum() - total for m in moved]) / steps
        sign = np.sign(steps)
        information = fisher_information(here, moved, _DIFFERENCE) * np.outer(sign, sign)
        information += _RIDGE * np.eye(len(x))
        free = ~(((x <= low) & (slope < 0.0)) | ((x >= high) & (slope > 0.0)))
        inverse = np.linalg.inv(information[np.ix_(free, free)])
        deviation[:] = np.nan
        deviation[free] = np.sqrt(np.diagonal(inverse))
        if 0.5 * slope[free] @ inverse @ slope[free] < _TOLERANCE:
            break
        better = False
        while not better and damping < 1e6:
            damped = information + damping * np.diag(np.diagonal(information))
            step = np.zeros(len(x))
            step[free] = np.linalg.solve(damped[np.ix_(free, free)], slope[free])
            ahead = np.clip(x + np.clip(step, -_LONGEST, _LONGEST), low, high)
            there = evaluate(ahead)
            gain = float(there.log_likelihood.sum() - total)
            better = gain > 0.0
            damping = max(0.1 * damping, 1e-6) if better else 10.0 * damping
        if not better:
            break
        x, here = ahead, there
    return x, deviation
