"""By how much an effect must pay to be named, and from where on two are told apart: where rotor
speeds and poses were measured, where the pose was filtered, and where rotor speeds are worked out
from commands.

Commands leave forces alone, by a thrust that is a guess, and no innovations to contradict an effect
that cannot be there. So an effect must explain more of what is left, and another one more of the
effect; but a thrust scale, a sag of the battery, a delay and a tilt are there as a rule.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SelectionSettings:
    """Where rotors and pose were measured. Deviances are on left-out blocks."""

    # deviance that an effect must explain; a spurious effect explains about 10
    least_deviance_reduction: float = 40.0
    # share of the deviance that is left unexplained, which an effect must explain as well
    least_share_of_deviance: float = 0.01
    least_share_of_nonlinear: float = 0.0  # the same, of an effect with nonlinear coefficients
    # typical sizes of any effect but the first; a larger one takes up what a thrust curve lacks
    largest_size: float = np.inf
    # factor on what an effect explains that is not the usual cause of its trace: a force beside an
    # error of measurement, a mass beside the scale of thrust, which is known to be unknown
    second_choice_factor: float = 1.0
    most_effects: int = 4
    rounds: int = 2  # of adding and pruning; what changes further stands for an unlisted effect
    # Hz: the band that weighs effects when they are selected, and the one that weighs their
    # coefficients; none: all that the residual holds
    selection_band_hz: tuple[float, float] | None = None
    estimation_band_hz: tuple[float, float] | None = None
    # of an effect's own deviance, by which two explanations must differ: effect models are true to
    # that
    least_share_apart: float = 0.001
    # share of the effect's deviance that another one must explain, linearised, to be worth a refit
    least_linear_share: float = 0.1
    # times the limit, which the linear fit of another one may leave of it to be worth a refit
    most_linear_deviance_ratio: float = 40.0
    # share of what is left without the effect, which is the limit at most
    most_share_without: float = np.inf
    # gain of a candidate regressor over the root of the blocks' summed squares: an effect acts
    # again and again, a transient disturbance once
    least_spread: float = 1.5


@dataclass(frozen=True)
class FilteredSelectionSettings(SelectionSettings):
    """Where the pose was filtered before it was logged; what it says of fast motion is lost."""

    selection_band_hz: tuple[float, float] | None = (1.0, 2.0)  # well below any filter


@dataclass(frozen=True)
class CommandedSelectionSettings(SelectionSettings):
    """Where rotor speeds are worked out from commands."""

    least_deviance_reduction: float = 25.0  # what cannot be there explains up to that
    least_share_of_deviance: float = 0.018  # the same explains 0.01
    least_share_of_nonlinear: float = 0.15  # such effects imitate what the thrust curve lacks
    largest_size: float = 6.0
    second_choice_factor: float = 0.8
    most_effects: int = 8  # thrust, battery, delay and tilt come on top of what other flights have
    rounds: int = 1
    # noise in commands makes a lag too long if fast changes weigh much
    selection_band_hz: tuple[float, float] | None = (1.0, 2.0)
    estimation_band_hz: tuple[float, float] | None = (0.2, 0.5)
    # they tell less: another effect must explain most of one to stand for it
    least_share_apart: float = 0.005
    least_linear_share: float = 0.3
    most_linear_deviance_ratio: float = 6.0
    most_share_without: float = 0.4
    least_spread: float = 2.0  # innovations confirm nothing


MEASURED = SelectionSettings()
FILTERED_POSE = FilteredSelectionSettings()
COMMANDED_ROTORS = CommandedSelectionSettings()
