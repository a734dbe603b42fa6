"""By how much an effect must pay to be named, and from where on two are told apart: where rotor
speeds and poses were measured, where the pose was filtered, and where rotor speeds are worked out
from commands.

Commands leave forces alone, by a thrust that is a guess, and no innovations to contradict an effect
that cannot be there. So an effect must explain more of what is left, and another one more of the
effect; but a thrust scale, a sag of the battery, a delay and a tilt are there as a rule.
"""

from dataclasses import dataclass, replace

import numpy as np


@dataclass(frozen=True)
class SelectionSettings:
    """The rules of one kind of flights. Deviances are on left-out blocks."""

    # deviance that an effect must explain; a spurious effect explains about 10 where rotors are
    # measured. Effects that cannot be there explain up to 25 of real flights known from commands
    least_deviance_reduction: float = 40.0
    # share of the deviance that is left unexplained, which an effect must explain as well; of real
    # flights known from commands, effects that cannot be there explain 0.01
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
    # coefficients; default: all that the residual holds. Noise in commands makes a lag too long if
    # fast changes weigh much
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
    # again and again, a transient disturbance once; more where innovations confirm nothing
    least_spread: float = 1.5


MEASURED = SelectionSettings()
FILTERED_POSE = replace(MEASURED, selection_band_hz=(1.0, 2.0))
COMMANDED_ROTORS = SelectionSettings(
    least_deviance_reduction=25.0,
    least_share_of_deviance=0.018,
    least_share_of_nonlinear=0.15,
    largest_size=6.0,
    second_choice_factor=0.8,
    most_effects=8,
    rounds=1,
    selection_band_hz=(1.0, 2.0),
    estimation_band_hz=(0.2, 0.5),
    least_share_apart=0.005,
    least_linear_share=0.3,
    most_linear_deviance_ratio=6.0,
    most_share_without=0.4,
    least_spread=2.0,
)
