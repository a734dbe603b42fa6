"""Facts of flights with rotors known by commands, before effects are asked about: calibrations of
any such vehicle, and the delay shown by its turns.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from ...dynamics.effects import Role, get, playing
from ..findings import NamedEffect
from ..logs.table import NamedNumbers
from .coefficients import CENTRAL
from .commanded_rotors import THRUST_FACTORS
from .regression import RegressedFlights


@dataclass(frozen=True, eq=False)
class Given:
    """Facts without need of evidence."""

    library: list[str]  # effects to ask about
    first: dict[str, NamedNumbers]  # in every set; with coefficients where a fit begins
    fixed: dict[str, NamedNumbers]  # known from elsewhere, with their coefficients
    # the delay of commands, from the vehicle's turns and not from a force; None if unknown
    late: NamedEffect | None


def what_commands_show(flights: RegressedFlights, library: Sequence[str]) -> Given:
    """Return the facts of flights before effects of a library are asked about; nothing for measured
    rotor speeds.

    Fitted in every set, and no discovery: a command's thrust and delay, the curve of thrust, and
    its change with voltage and time. A flight shows only the ratio of thrust to mass: one of them
    is enough.
    """
    library = list(library)
    if not flights.commanded:
        return Given(library, {}, {}, None)
    late = None
    seen = [p.signals for p in flights.pieces({}) if flights.fit_rows[flights.log == p.log].any()]
    delays = playing(Role.DELAY, among=library)
    delay = next((effect for effect in delays if get(effect).kind == "rotor input"), None)
    if delay:
        # a lag delays slow changes as much, and a wrong clock of the log looks like late commands
        same = [x for x in playing(Role.LAG, Role.DELAY, among=library) if x != delay]
        library = [e for e in library if e not in same]
        from .turning_delay import turning_delay  # needs much of SciPy

        if shown := turning_delay(seen, flights.vehicle, flights.logs[0].period):
            library.remove(delay)
            seconds, std, ratio = shown
            c = get(delay).coefficients[0]
            late = NamedEffect(
                name=delay,
                coefficients={c.name: seconds},
                std={c.name: std},
                units={c.name: c.unit},
                tentative=False,
                indistinguishable_from=tuple(same),
                evidence={"log_bayes_factor": 0.5 * ratio},
                channels=("attitude", "motor commands"),
            )
    thrust = playing(Role.THRUST, among=library) or playing(Role.MASS, among=library)
    roles = (Role.THRUST_CURVE, Role.THRUST_OVER_VOLTAGE, Role.THRUST_OVER_TIME)
    first = {
        e: {c.name: 0.0 for c in get(e).coefficients if c.name != CENTRAL}
        | dict(flights.coefficients({}, e))
        for e in (*thrust, *playing(*roles, among=library), *(e for e in library if e == delay))
    }
    if thrust:  # only thrust over mass is known
        library = [e for e in library if e in first or get(e).role not in THRUST_FACTORS]
    return Given(library, first, {late.name: dict(late.coefficients)} if late else {}, late)
