"""The columns of a likelihood."""

from enum import IntEnum, auto
from typing import NamedTuple


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
