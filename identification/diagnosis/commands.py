"""What is known of flights before effects are asked about, where the rotors are known by commands:
calibrations, which any such vehicle has, and the delay that its turns show.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ...dynamics.effects import get, playing
from ..findings import NamedEffect
from .commanded_rotors import THRUST_FACTORS, thrust_is_assumed
from .regression import CENTRAL, Flights
from .row_nuisances import calibrations
from .turning_delay import rotor_delay, same_delays, turning_delay


@dataclass(frozen=True)
class Given:
    """What needs no evidence.

    Attributes:
        library: effects that are asked about.
        first: effects that any set has, with coefficients about which a fit begins.
        fixed: effects that are known from elsewhere, with their coefficients.
        late: the delay of commands, which the vehicle's turns show and no force; None where no
            delay is known.
        assumed: whether how much thrust a command makes is an assumption.
    """

    library: list[str]
    first: dict[str, dict[str, float]]
    fixed: dict[str, dict[str, float]]
    late: NamedEffect | None = None
    assumed: bool = False


def what_commands_show(flights: Flights, library: Sequence[str]) -> Given:
    """Return what is known of flights before effects of a library are asked about; nothing where
    rotor speeds were measured.
    """
    library = list(library)
    if not flights.commanded:
        return Given(library, {}, {})
    effect, late = rotor_delay(library), None
    same = same_delays(effect, library) if effect else []
    seen = [p.signals for p in flights.pieces({}) if flights.fit_rows[flights.log == p.log].any()]
    if effect:
        library = [e for e in library if e not in same]
        if delay := turning_delay(seen, flights.vehicle):
            library.remove(effect)
            c = get(effect).coefficients[0]
            late = NamedEffect(
                name=effect,
                coefficients={c.name: delay.seconds},
                std={c.name: delay.std},
                units={c.name: c.unit},
                tentative=False,
                indistinguishable_from=tuple(same),
                evidence={"log_bayes_factor": 0.5 * delay.log_likelihood_ratio},
                channels=("attitude", "motor commands"),
            )
    first = {
        e: {c.name: 0.0 for c in get(e).coefficients if c.name != CENTRAL}
        | dict(flights.coefficients({}, e))
        for e in calibrations(library)
    }
    if playing(*THRUST_FACTORS, among=first):  # thrust over mass is known, and neither alone
        library = [e for e in library if e in first or get(e).role not in THRUST_FACTORS]
    assumed = thrust_is_assumed(flights.logs, flights.vehicle)
    fixed = {late.name: dict(late.coefficients)} if late else {}
    return Given(library, first, fixed, late, assumed)
