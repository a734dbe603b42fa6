"""The rotor or side that changed between two sets of flights, with its probability.

Each flight has four numbers: the differences of left and right, of front and rear, and of the
diagonals, each in parts of the total, and the logarithm of the total. Between flights of one
unchanged vehicle they scatter, from session to session more than within one (``sessions``). The
battery acts on the total, too. A rotor's thrust for a request follows a power of the voltage. The
power depends on the motor controllers, and on whether the firmware makes up for the battery. A
difference of voltage therefore makes the total less certain.

Possible changes, each by any amount (integrated out):

* nothing;
* a rotor delivers less than before for the same command (a cut propeller, a weak motor): its own
  thrust is asked to rise, alone;
* the vehicle weighs more near a rotor or at a side: the centre of mass moves there;
* all rotors are asked for more (the vehicle is heavier, the air thinner, the battery weaker);
* something else: the four numbers moved in a way of their own (two rotors at once, a bent arm).

A weaker rotor and a weight under this rotor move the centre of thrust alike. They differ in the
diagonals, but a real rotor near its limit fits neither; so the place has a probability of its own,
summed over the kinds.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from scipy.special import log_softmax, logsumexp, softmax

from ...runtime.arrays import Array
from ...runtime.errors import InputError
from ..logs.table import ArrayPair
from .sessions import difference
from .trim import FEATURES, Trim, features_of

NOWHERE = "nowhere"
SOMETHING_ELSE = "something else"
# places, rotors first: unit vectors to the left and the front
_PLACES = {
    "rotor 1 (front-left)": (1.0, 1.0),
    "rotor 2 (rear-left)": (1.0, -1.0),
    "rotor 3 (rear-right)": (-1.0, -1.0),
    "rotor 4 (front-right)": (-1.0, 1.0),
    "left": (1.0, 0.0),
    "rear": (0.0, -1.0),
    "right": (-1.0, 0.0),
    "front": (0.0, 1.0),
    "all rotors": (0.0, 0.0),
}
# prior probabilities by place and kind: a comparison has a reason, and all ten places are alike
_CHANGES = {
    (NOWHERE, ""): 0.4,
    **{(place, "weaker"): 0.03 for place in _PLACES if "rotor " in place},
    **{(place, "carries more"): 0.03 if "rotor " in place else 0.06 for place in _PLACES},
    (SOMETHING_ELSE, ""): 0.06,
}

# usual amount of a change, as a share of the weight or of one rotor's thrust: the scale of a
# half-normal prior
_USUAL_AMOUNT = 0.15
_AMOUNTS = np.linspace(0.02, 4.0, 80) * _USUAL_AMOUNT  # in the sum of a change's evidence
# standard deviation of the power of the battery's voltage in the request for one thrust: 0 if the
# firmware makes up for the battery, up to 2 if rotor speed follows the voltage
_VOLTAGE_POWER = 0.5
# distance of a real rotor's request from a linear one's, as a share of the change. A bent curve
# changes the rise of one rotor's request, and moves all four numbers alike. Drag and thrust of a
# cut propeller do not shrink alike, so the diagonals move.
# Cuts of 2 to 4 mm moved the diagonals 0.9, and the total 1.0 times as much as the sides
_BEND = (0.1, 0.1, 0.25, 0.25)
SURE = 0.95  # least probability of a place named without a doubt


class Change(NamedTuple):
    """The change from the flights ``before`` to the flights ``after``."""

    # "nowhere", each rotor, each side, "all rotors" and "something else"; sum: 1
    probabilities: dict[str, float]
    place: str  # the likeliest
    sure: bool  # at least ``SURE``
    # probabilities of either kind there, if a rotor: weaker, or a weight
    weaker: float
    carries_more: float
    amount: float  # share of one rotor's thrust, or of the weight: mean, given place and kind
    amount_std: float
    difference: dict[str, float]  # by ``FEATURES``
    difference_std_if_unchanged: dict[str, float]
    before: Sequence[Trim]
    after: Sequence[Trim]


def compare(after: Sequence[Trim], before: Sequence[Trim]) -> Change:
    """Find the change between two sets of flights of one vehicle.

    Args:
        after: the flights in question.
        before: the reference flights.

    Raises:
        InputError: a set is empty.
    """
    if not (after and before):
        raise InputError("compare: expected at least one flight in each of the two sets")
    mean, unchanged, ways = difference(after, before)
    # a correction of the total by the voltage would hide a change: a heavier vehicle draws more and
    # pulls its battery down
    late, early = (np.log([trim.voltage for trim in group]).mean() for group in (after, before))
    unchanged[:, 3] += (_VOLTAGE_POWER * np.nan_to_num(late - early)) ** 2
    shares = np.mean([trim.thrust_share for trim in before], axis=0)
    logs = []
    for (place, kind), chance in _CHANGES.items():
        means, spread = _moved(place, kind, shares)
        variance = unchanged[:, None] + spread**2
        off = (mean[:, None] - means) ** 2 / variance + np.log(variance)
        logs.append(logsumexp(ways[:, None] - 0.5 * off.sum(axis=2), axis=0) + math.log(chance))
    prior = log_softmax(-0.5 * (_AMOUNTS / _USUAL_AMOUNT) ** 2)
    chances = softmax(np.array(logs) + prior)  # each change by each amount
    at, kinds = np.array([*_CHANGES]).T
    places = {place: float(chances[at == place].sum()) for place in at.tolist()}
    place = max(places, key=places.__getitem__)
    weaker, carries_more = (
        float(chances[(at == place) & (kinds == kind)].sum()) / places[place]
        for kind in ("weaker", "carries more")
    )
    amounts, weights = _AMOUNTS * (place != NOWHERE), max(chances[at == place], key=np.sum)
    amount = np.average(amounts, weights=weights)
    return Change(
        places,
        place,
        places[place] >= SURE,
        weaker,
        carries_more,
        amount,
        math.sqrt(np.average((amounts - amount) ** 2, weights=weights)),
        dict(zip(FEATURES, np.exp(ways) @ mean, strict=True)),
        dict(zip(FEATURES, np.sqrt(np.exp(ways) @ unchanged), strict=True)),
        before,
        after,
    )


def _moved(place: str, kind: str, shares: Array) -> ArrayPair:
    """Return how the four numbers move (a, 4) by each of ``_AMOUNTS``, and the standard deviations
    beside the scatter: (a, 4), or one for all four.
    """
    amounts = _AMOUNTS[:, None]
    if not kind:
        return np.zeros(4), amounts * (place == SOMETHING_ELSE)
    if kind == "weaker":
        lost = np.minimum(amounts, 0.9) * (np.arange(4) == [*_PLACES].index(place))
        means = features_of(shares / (1.0 - lost)) - features_of(shares)
    else:
        # a weight m at a rotor moves the centre of mass by m / (1 + m) of the way there
        way = amounts / (1.0 + amounts) * [*_PLACES[place], 0.0]
        means = np.hstack([way, np.log1p(amounts)])
    return means, np.linalg.norm(means, axis=1, keepdims=True) * _BEND
