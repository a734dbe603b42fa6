"""What is known of flights before effects are asked about, where the rotors are known by commands:
calibrations, which any such vehicle has, and the delay that its turns show.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ...dynamics.effects import get, playing
from ..findings import NamedEffect
from .commanded_rotors import THRUST_FACTORS, thrust_is_assumed
from .regression import CENTRAL, Flights, coefficient
from .row_nuisances import calibrations
from .turning_delay import Delay, rotor_delay, same_delays, turning_delay


@dataclass(frozen=True)
class Given:
    """What needs no evidence.

    Attributes:
        library: effects that are asked about.
        first: effects that any set has, with coefficients about which a fit begins.
        fixed: effects that are known from elsewhere, with their coefficients.
        late: the effect that delays the rotors; empty where no delay is known.
        same: effects that show the same delay.
        delay: that is known.
        assumed: whether how much thrust a command makes is an assumption.
    """

    library: list[str]
    first: dict[str, dict[str, float]]
    fixed: dict[str, dict[str, float]]
    late: str = ""
    same: tuple[str, ...] = ()
    delay: Delay | None = None
    assumed: bool = False

    def late_name(self, tentative: bool) -> NamedEffect:
        """Return the delay of commands, which the vehicle's turns show and no force."""
        assert self.delay is not None
        values = self.delay.setting(self.late)[self.late]
        return NamedEffect(
            name=self.late,
            coefficients=values,
            std=dict.fromkeys(values, self.delay.std),
            units={name: coefficient((self.late, name)).unit for name in values},
            tentative=tentative,
            indistinguishable_from=self.same,
            evidence={"log_bayes_factor": 0.5 * self.delay.log_likelihood_ratio},
            channels=("attitude", "motor commands"),
        )


def what_commands_show(flights: Flights, library: Sequence[str]) -> Given:
    """Return what is known of flights before effects of a library are asked about; nothing where
    rotor speeds were measured.
    """
    library = list(library)
    if not flights.commanded:
        return Given(library, {}, {})
    late = rotor_delay(library)
    same = same_delays(late, library) if late else []
    seen = [p.signals for p in flights.pieces({}) if flights.fit_rows[flights.log == p.log].any()]
    delay = turning_delay(seen, flights.vehicle) if late else None
    fixed = delay.setting(late) if delay else {}
    library = [e for e in library if not late or (e not in same and e not in fixed)]
    first = {
        e: {c.name: 0.0 for c in get(e).coefficients if c.name != CENTRAL}
        | dict(flights.coefficients({}, e))
        for e in calibrations(library)
    }
    if playing(*THRUST_FACTORS, among=first):  # thrust over mass is known, and neither alone
        library = [e for e in library if e in first or get(e).role not in THRUST_FACTORS]
    assumed = thrust_is_assumed(flights.logs, flights.vehicle)
    return Given(library, first, fixed, late if delay else "", tuple(same), delay, assumed)
