"""Sizes of arrays."""

import numpy as np


def rms(values, axis=None):
    """Return the root of the mean square, of all values or along an axis."""
    return np.sqrt(np.mean(np.square(values), axis=axis))
