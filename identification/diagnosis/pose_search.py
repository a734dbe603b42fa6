"""The search for the likeliest sets by poses and rotors as measured.

A set has the evidence of the likelier noise of two: beside no effect, and beside the best set. The
reason: an unexplained force counts as a disturbance.
"""

import math
from collections.abc import Callable, Sequence
from functools import partial
from itertools import chain

import numpy as np

from ...dynamics.effects import get
from .climbing import Height, linearised, mode
from .coefficients import Effects, Setting
from .column import Column
from .likelihood import Likelihood
from .priors import Base, Starts, prior_size
from .regression import RegressedFlights
from .sets import Posterior
from .starting_points import starts_of

ROUNDS = 6  # fits of the noise beside the best set
# standard deviations of its prior: largest step of a coefficient in the last of these rounds
CLOSE = 0.1


def search_by_poses(
    flights: RegressedFlights, library: Sequence[str], report: Callable[[str], None]
) -> tuple[Likelihood, Posterior, Base | None]:
    """Return the likelihood about the likeliest set of a library, the posterior, and the likelihood
    with a noise beside the column of largest gain (see ``Posterior.structure``).
    """

    def starts(setting: Setting) -> Starts:
        return starts_of(flights, library, setting, *([{}] if setting else []))

    def around(best: Likelihood) -> Posterior:
        return Posterior(flights, library, (loud, best.base(library, starts(best.setting))))

    def tried(setting: Setting, near: Likelihood) -> Likelihood:
        report(f"trying {', '.join(setting)}")
        begun[frozenset(setting)] = setting
        return _fitted(setting, near)

    # made anew at the end if no set is likeliest: its columns of ten minutes take 0.5 GB
    best = Likelihood(flights, {})
    still = starts({})
    loud = best.base(library, still)
    everything = loud.mode(np.append(loud.plain, loud.at(loud.asked)))
    beside = {c: x for c, (x, _) in everything.items()}
    posterior = Posterior(flights, library, (loud, best.quieter(beside, still)))
    # settings as asked for: beside the end of a fit, a little of other effects moves the request
    begun: dict[Effects, Setting] = {frozenset(): {}}
    # the best effect first, alone: another set's columns are of the model with that effect
    if setting := posterior.best_setting(1):
        best = tried(setting, best)
        posterior = around(best)
        # a similar effect counts as a disturbance: each is judged beside its own noise
        # one after the other: each holds a tenth of a diagnosis' memory
        each = (tried(rival, best) for rival in posterior.rivals(setting))
        best = max(chain([best], each), key=_score)
        if best.setting.keys() != setting.keys():
            posterior = around(best)
    for _ in range(ROUNDS):
        # the columns of the same set change with its coefficients, if these have moved far
        setting = posterior.best_setting()
        if not posterior.is_elsewhere(setting, begun):
            break
        best = tried(setting, best)
        posterior = around(best)
    # once more, with the dictionary's costly columns, beside the likeliest set
    setting = posterior.best_setting()
    if setting.keys() != best.setting.keys():
        near, gusty = (best, best.gusty) if setting else (None, False)
        best = Likelihood(flights, setting, near, gusty=gusty)
    still = starts(best.setting)
    whole = best.base(library, still, unknown=True)
    posterior = Posterior(flights, library, (loud, whole), posterior.tempering())
    column, size, gained = posterior.strangest()
    # among so many columns one explains as much by chance, with no likelier noise
    by_chance = 2.0 * math.log(len(whole.dictionary))
    return best, posterior, best.quieter({column: size}, still) if gained > by_chance else None


def _fitted(setting: Setting, near: Likelihood) -> Likelihood:
    """Return the likelihood about the mode of a setting's effects; a wind is steady or gusty, as is
    likelier.
    """
    steady = _settled(setting, near)
    if not any(get(e).sets_wind for e in setting):
        return steady
    return max(steady, _settled(steady.setting, steady, gusty=True), key=_score)


def _settled(setting: Setting, near: Likelihood, gusty: bool = False) -> Likelihood:
    """Return the likelihood about the mode of a setting's effects, with the noise beside it."""
    flights = near.flights
    # a slow disturbance resembles a steady effect: each is fitted beside the other
    for _ in range(ROUNDS):
        try:
            near = Likelihood(flights, setting, near, gusty=gusty)
        except np.linalg.LinAlgError:  # the filter diverges: halfway to the declared vehicle
            setting = {e: {n: 0.5 * x for n, x in own.items()} for e, own in setting.items()}
            continue
        begun = setting
        setting = mode(begun, partial(_height, near))
        moved = (
            abs(x - begun[e].get(n, 0.0)) / prior_size(Column(e, n), flights)
            for e, own in setting.items()
            for n, x in own.items()
        )
        if max(moved) < CLOSE:
            break
    return Likelihood(flights, setting, near, same_noise=True)


def _height(near: Likelihood, x: Setting) -> Height:
    here = near if x is near.setting else Likelihood(near.flights, x, near, same_noise=True)
    return linearised(near.flights, here.base(x, {}), x)


def _score(best: Likelihood) -> float:
    """Return the logarithm of the probability of a likelihood's own set, up to a constant."""
    bases = [best.base(best.setting, {})] * 2
    scores = Posterior(best.flights, [*best.setting], bases).scores
    return scores.get(frozenset(best.setting), -math.inf)
