"""The posterior over sets of effects, and the fit of the likeliest set.

Before the flight every effect of the library is equally likely, and one is expected to be missing.
The likelihood is of the poses where poses and rotors are as measured, else of the balance of forces
and torques.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from ..findings import Disturbance, Ranking
from ..logs.table import Names, Pair
from .coefficients import Setting
from .pose_search import search_by_poses
from .regression import RegressedFlights
from .row_search import search_by_rows
from .sets import Posterior

Report = Callable[[str], None]  # takes a line of progress


@dataclass(frozen=True, eq=False)
class FittedPosterior:
    """The posterior of flights, and the fit of the likeliest set."""

    posterior: Posterior
    ranking: Ranking
    needed: Setting  # coefficients of the likeliest set's needed effects
    gains: Mapping[str, Pair]  # as of ``Posterior.leave_out_needless``
    # of each channel, for a likelihood with a noise of the motion; none for a force balance
    gusts: tuple[Disturbance, ...]
    # biases and time offsets of the sensors, with their standard deviations
    sensors: Mapping[str, Pair]
    # for each effect of the set: effects hidden in these logs that do as well in its place
    behind: Mapping[str, Names]


def rank(
    flights: RegressedFlights,
    library: Sequence[str],
    report: Report,
    first: Setting | None = None,
    fixed: Setting | None = None,
) -> FittedPosterior:
    """Return the posterior over sets of effects of a library.

    Args:
        flights: the vehicle's flights.
        library: names of effects shown by these flights, with ``first``.
        report: called with a line of progress.
        first: effects of every set, with coefficients for the start of a fit; none with measured
            rotors.
        fixed: effects known from elsewhere, with their coefficients; likewise.
    """
    if flights.has_raw_poses:
        poses, posterior, quieter = search_by_poses(flights, library, report)
        ranking = posterior.ranking(quieter)
        setting, gains = posterior.leave_out_needless(ranking.probability)
        known = posterior.nuisances().items()
        late = {c.coefficient: x for c, x in known if c in flights.offsets}
        return FittedPosterior(posterior, ranking, setting, gains, poses.gusts(), late, {})
    rows, best, posterior = search_by_rows(
        flights.of_the_fit(), library, first or {}, fixed or {}, report
    )
    ranking = posterior.ranking(None)
    setting, gains = posterior.leave_out_needless(ranking.probability)
    setting = best if setting.keys() == best.keys() else rows.fitted(setting)
    sensors, behind = rows.sensors(setting), rows.behind(setting)
    return FittedPosterior(posterior, ranking, setting, gains, (), sensors, behind)
