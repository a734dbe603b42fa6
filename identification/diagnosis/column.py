"""The columns of a likelihood."""

from enum import IntEnum, auto
from typing import NamedTuple

import numpy as np

from ..logs.table import Array


class Part(IntEnum):
    """The part of a model that a column changes."""

    COEFFICIENT = auto()  # a coefficient of an effect
    AT_CENTRE = auto()  # the same, of an effect that acts at the centre, without a moment
    START = auto()  # a whole effect at coefficients of its own: the column is a multiple of it
    OFFSET = auto()  # an error of a log's signal, in its unit
    NUISANCE = auto()  # an error of any flight, in standard deviations of its prior
    GUST = auto()  # a wind's change beside its mean, likewise
    BETWEEN_SAMPLES = auto()  # rotor speeds off a straight line between samples
    MODEL_ERROR = auto()  # a share of the rotors' wrench
    GAIN = auto()  # of a state on the rotors' innovations
    UNKNOWN = auto()  # a column of the dictionary
    CHANGING = auto()  # the same: an effect of the set whose coefficients change


class Column(NamedTuple):
    """What a column of a likelihood is of.

    Attributes:
        effect: name of an effect; empty for the parts from ``OFFSET`` on.
        coefficient: name of its coefficient, or of the error or variable.
        part: what changes.
        number: channel of a column of the dictionary, state of a gain, number of a start or gust.
        group: of a column of the dictionary.
    """

    effect: str
    coefficient: str
    part: Part = Part.COEFFICIENT
    number: int = 0
    group: str = ""

    @property
    def is_unknown(self) -> bool:
        """Whether the column belongs to the dictionary."""
        return self.part >= Part.UNKNOWN


class Product(NamedTuple):
    """A column (n, 6), multiplied out a part at a time: ten minutes of 150 columns would take 0.9
    GB.
    """

    scale: float
    x: Array  # (n,)
    y: Array  # (n, k)
    first: int = 0  # channel of y's first column; the other channels are zero

    @classmethod
    def of(cls, column: Array) -> "Product":
        """Return a column (n, 6), without channels of zeros before and after the others."""
        used = np.flatnonzero(column.any(axis=0)).tolist() or [0]
        some = column[:, used[0] : used[-1] + 1].copy()
        return cls(1.0, cls.ones(len(column)), some, used[0])

    @staticmethod
    def ones(*shape: int) -> Array:
        """Return ones without memory of their own."""
        return np.broadcast_to(1.0, shape)

    def part(self, rows: slice) -> "Product":
        """Return some rows."""
        return Product(self.scale, self.x[rows], self.y[rows], self.first)

    @property
    def whole(self) -> Array:
        """All rows and channels (n, 6)."""
        out = np.zeros((len(self.x), 6))
        out[:, self.first : self.first + self.y.shape[1]] = self.scale * self.x[:, None] * self.y
        return out


Columns = dict[Column, Product]


def along_axis(axis: int, rotation: Array) -> tuple[Array, int]:
    """Return the last two fields of a product along an axis of the body, three of force and three
    of torque.
    """
    return (rotation[:, :, axis], 0) if axis < 3 else (Product.ones(len(rotation), 1), axis)
