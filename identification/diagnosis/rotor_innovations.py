"""The rotors' innovations: thrust and torques not predicted by the flight's past.

A flight loop with a gyro answers a gust before the pose shows it, and a measured rotor speed has
noise and rounding. Both reach the likelihood through the rotors' own innovations: the part of
thrust and torques predicted neither by past rotor speeds nor by the filter's state. The pose
confirms a share of it later, as a gust or as an error of measurement. This share is the gain of the
joint filter of rotors and pose. Like the loop it is unknown, so it is fitted beside the effects: an
effect shows in the predictable part of the rotors alone. (Joint input-output identification: L.
Ljung, System Identification, 2nd edition, 1999, section 13.5.)
"""

import math

import numpy as np
from scipy.special import ndtr

from ..logs.table import Array
from ..motion.signals import in_body
from .causal_filter import Poses, Track, level

Seen = list[tuple[Poses, Track]]  # pieces, as measured and as the filter sees them
# past samples of the rotors in a prediction: a loop's own filter has a memory. Of 23 flights whose
# loops saw more than their logs, 7 got a wrong probable set with 4 samples, and 4 with 20
LAGS = 20
# of a regression on rounded speeds. Of 34 hovers, half by a foreign simulator, the likeliest set is
# the true one on 16 without rounds, and on 19 with 5. More rounds come nearer to the true speeds,
# but the rest of the error then follows the loop: with 12, fewer sets were right
ROUNDS = 5
# share of a predictor's square added to it, against predictors nearly alike, and constant ones
RIDGE = 1e-6
# the axis of the pose driven by each of thrust and torques
DRIVEN = (2, 3, 4, 5)


def rotor_innovations(pieces: Seen) -> list[Array]:
    """Return the rotors' innovations (n, 4) of each piece, as accelerations: along body z (m/s2)
    and about the body's axes (rad/s2). The first samples, with too short a past, have none.

    Args:
        pieces: as measured, and as the filter sees them.
    """
    rotors = [_accelerations(poses, track) for poses, track in pieces]
    return [
        np.pad(now[LAGS:] - expected, ((len(now) - len(expected), 0), (0, 0)))
        for now, expected in zip(rotors, _predicted(pieces, rotors), strict=True)
    ]


def unrounded(pieces: Seen, step: float) -> list[Array]:
    """Return the corrections of rotor speeds (n, 4) of each piece, rad/s, from the log's multiples
    of ``step`` to the expected speeds.

    In hover a rotor speed moves by less than a step, and its rounding follows the flight loop like
    a damping. The prediction from the past, within the logged step, is most of the speed: a
    regression on intervals, by expectation and maximisation (M. D. Burridge, Journal of the Royal
    Statistical Society B 43 (1981), 41-45).
    """
    logged = [poses.rotor_speeds for poses, _ in pieces]
    speeds = [x.copy() for x in logged]
    variance = [np.zeros_like(x) for x in logged]
    for _ in range(ROUNDS):
        each = list(zip(logged, speeds, variance, _predicted(pieces, speeds), strict=True))
        left = [np.square(now[LAGS:] - z) + v[LAGS:] for _, now, v, z in each]
        std = np.maximum(np.sqrt(np.concatenate(left).mean(axis=0)), 1e-6 * step)
        for log, now, v, z in each:
            low, high = ((log[LAGS:] + x * step - z) / std for x in (-0.5, 0.5))
            mass = np.maximum(ndtr(high) - ndtr(low), 1e-12)
            a, b = (np.exp(-0.5 * x * x) / math.sqrt(2.0 * math.pi) for x in (low, high))
            # of a normal density between two bounds
            mean = np.clip((a - b) / mass, low, high)
            now[LAGS:] = z + std * mean
            spread = 1.0 + (low * a - high * b) / mass - mean**2
            v[LAGS:] = np.square(std) * np.clip(spread, 0.0, 1.0)
    return [now - log for log, now in zip(logged, speeds, strict=True)]


def _predicted(pieces: Seen, rotors: list[Array]) -> list[Array]:
    """Return the least-squares predictions (n - LAGS, 4) of each piece's rotors (n, 4)."""
    each = zip(pieces, rotors, strict=True)
    z = np.concatenate([_known_before(track, now) for (_, track), now in each])
    later = [now[LAGS:] for now in rotors]
    y = np.concatenate(later)
    # in place: ten minutes take 0.1 GB
    z -= z.mean(axis=0)
    z /= np.maximum(np.sqrt(np.einsum("ij,ij->j", z, z) / len(z)), 1e-12)
    normal = z.T @ z
    normal += RIDGE * len(z) * np.eye(len(normal))
    predicted = z @ np.linalg.solve(normal, z.T @ y)
    predicted += y.mean(axis=0) / (1.0 + RIDGE)
    return np.split(predicted, np.cumsum([len(part) for part in later])[:-1])


def _accelerations(poses: Poses, track: Track) -> Array:
    """Return the accelerations by the rotors at the samples (n, 4)."""
    # the track has the rotors between samples; the accelerations are linear in squared speeds
    effectiveness = np.linalg.lstsq(
        np.square(0.5 * (poses.rotor_speeds[:-1] + poses.rotor_speeds[1:])),
        track.rotors[:-1],
        rcond=None,
    )[0]
    return np.asarray(np.square(poses.rotor_speeds) @ effectiveness)


def _known_before(track: Track, rotors: Array) -> Array:
    """Return everything known before a sample's rotors (n - LAGS, c): their past, ``rotors`` (n,
    4), and the filter's state. A piece shorter than the lags has no row.
    """
    count = max(len(rotors) - LAGS, 0)
    known = [rotors[i : i + count] for i in reversed(range(LAGS))]
    before = slice(LAGS - 1, LAGS - 1 + count)
    turn = track.rotation[before]
    body = in_body(track.velocity[before], turn)
    state = np.hstack([turn[:, 2, :2], body, track.angular_velocity[before]])
    i, j = np.triu_indices(state.shape[1])
    # along the heading and to its left, and about the body's axes
    back = track.heading * [1.0, -1.0]
    seen = np.hstack([level(back, x) for x in np.hsplit(track.innovations, 2)])
    known += [
        state,
        track.position[before],
        track.acceleration[before] - track.model[before],
        seen[before],
        # the loop may have read this sample's pose before the rotors were logged
        seen[LAGS:],
        state[:, i] * state[:, j],
    ]
    return np.column_stack(known)
