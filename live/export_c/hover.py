"""The model at hover as tables of nonzero entries, for the filter with a constant gain."""

from typing import Any

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

from ...estimator.filter_record import N

_APART = 1e-4  # correlation by rounding alone
Entry = tuple[int, int, int, float]  # row, column, power of the time, value


def couplings(f: Any) -> list[Entry]:
    """Return the entries of an error state's transition matrix over a time, less the identity, from
    a filter's record.
    """
    out: list[Entry] = [(i, 3 + i, 1, 0.25) for i in range(3)]  # an MRP is a quarter of an angle
    out += [(6 + i, 9 + i, 1, 1.0) for i in range(3)]
    for i in range(6):
        for j in np.flatnonzero(f["hover"][i]).tolist():
            value = float(f["hover"][i, j])
            if i < 3:
                out.append((3 + i, j, 1, value))
            else:
                out += [(6 + i, j, 1, value), (3 + i, j, 2, 0.5 * value)]
    return out


def noises(f: Any) -> list[Entry]:
    """Return the entries, lower half, of the process noise over a time."""
    body = f["body"]
    period = float(f["period"])
    inverse = np.array(body["inverse_inertia"])
    com = np.array(body["com"])
    # angular and linear acceleration by each input, (27)
    by_torque = np.vstack([inverse, np.cross(com, inverse, axis=0)])
    by_thrust = np.vstack([np.zeros((3, 3)), np.eye(3) / float(body["mass"])])
    given = by_torque * f["motor_torque"] @ by_torque.T + by_thrust * f["thrust"] @ by_thrust.T
    white = period * given  # noise of accelerations; a longer step averages over more of it
    out: list[Entry] = []
    # rows of the error state, each with its acceleration, power of time and share
    rows = [(3 + i, i, 1, 1.0) for i in range(3)] + [(9 + i, 3 + i, 1, 1.0) for i in range(3)]
    rows += [(6 + i, 3 + i, 2, 0.5) for i in range(3)]
    for a, i, order_a, share_a in rows:
        for b, j, order_b, share_b in rows:
            value = share_a * share_b * float(white[i, j])
            if b <= a and value != 0.0:
                out.append((a, b, order_a + order_b - 1, value))
    walks = np.concatenate([f["torque_walk"], f["force_walk"]]) / period
    return out + [(12 + i, 12 + i, 1, float(walks[i])) for i in range(N - 12)]


def kept(f: Any) -> list[tuple[int, int]]:
    """Return rows and columns of the covariances' nonzero entries, lower half; the diagonal comes
    first.

    At hover the error state falls into independent chains (four for a symmetric vehicle: along x,
    along y, vertical, yaw); an effect may tie some together.
    """
    tied = np.abs(f["converged"]) > _APART * np.sqrt(
        np.outer(np.diag(f["converged"]), np.diag(f["converged"]))
    )
    for i, j, *_ in couplings(f) + noises(f):
        tied[i, j] = True
    chain = connected_components(csr_array(tied), directed=False)[1]
    pairs = [(i, j) for i in range(N) for j in range(i) if chain[i] == chain[j]]
    return [(i, i) for i in range(N)] + pairs
