"""Flight logs in other conventions than they declare, and the words by which each is named."""

from dataclasses import replace
from functools import partial
from math import nan

import numpy as np
import yaml
from scipy.spatial.transform import Rotation

from tests.support.paths import ROOT

ONE = np.eye(3)
DOWN = np.diag([1.0, -1.0, -1.0])  # forward, left, up to forward, right, down


def framed(log, position=ONE, world=ONE, body=ONE):
    """The log with positions times a matrix, and attitudes seen from another world and body."""
    quaternion = log.quaternion
    if world is not ONE or body is not ONE:
        quaternion = np.full_like(quaternion, nan)
        seen = log.valid & np.isfinite(log.quaternion).all(axis=1)
        R = Rotation.from_quat(log.quaternion[seen], scalar_first=True).as_matrix()
        quaternion[seen] = Rotation.from_matrix(world @ R @ body).as_quat(scalar_first=True)
    return replace(log, position=log.position @ np.transpose(position), quaternion=quaternion)


def placed(log, order, signs=(1.0, 1.0, 1.0)):
    """The log with the columns of its position in another order and of other signs."""
    return replace(log, position=log.position[:, order] * signs)


def scaled(log, **factors):
    """The log with channels in other units."""
    return replace(log, **{name: factor * getattr(log, name) for name, factor in factors.items()})


def reordered(log, order):
    """The log with the columns of its quaternion in another order."""
    return replace(log, quaternion=log.quaternion[:, order])


def permuted(log, order):
    return replace(log, rotor_speeds=log.rotor_speeds[:, order])


def shifted(log, seconds):
    rotors = [np.interp(log.t - seconds, log.t, column) for column in log.rotor_speeds.T]
    return replace(log, rotor_speeds=np.column_stack(rotors))


def conjugate(log):
    return replace(log, quaternion=log.quaternion * [1, -1, -1, -1])


def changed(log, changes):
    """The log after one change after another: a function of this file and its arguments."""
    for change in changes:
        for name, arguments in change.items():
            log = globals()[name](log, **arguments)
    return log


HOSTILE = {
    name: (partial(changed, changes=changes), words)
    for name, (*changes, words) in yaml.safe_load(
        (ROOT / "tests/data/hostile.yaml").read_text(encoding="utf-8")
    )["hostile"].items()
}
