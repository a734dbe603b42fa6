"""Sentences beside a diagnosis' findings: other possible causes, flight outside the range of the
fit, and flights to fly next.
"""

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence

import numpy as np

from ...dynamics.effects import Need, Role, get, needing, playing
from ...dynamics.vehicle import Vehicle
from ..findings import CHANNELS, NamedEffect
from ..logs.table import Array, Pair, Values
from ..motion.inertial_signals import pose_rate
from .coefficients import CENTRAL, moves_time, unit_of_change
from .column import Column
from .log_offsets import ROTOR_TIME_OFFSET
from .regression import RegressedFlights
from .worth import BY_CHANCE

FILTERED = (
    "the pose was filtered before the log was written. Whether the named effects act on the "
    "vehicle, or follow from feedback-induced correlation, shows only in the sensors' own noise, "
    "so all names are tentative. Log the pose as it was measured"
)
LEAST_ROTOR_TIME_OFFSET = 0.001  # s, worth a note
# when two changes are alike: most standard deviations between any two components, and the share of
# the changes to which effect models agree
MOST_APART = 2.5
SHARE = 0.1
# quantile of the fitted rows up to which the fit knows a quantity, and the least share of other
# rows beyond it for a note
KNOWN = 0.995
OUTSIDE = 0.05
FEW = 3  # effects whose flights an advice describes


def composites(vehicle: Vehicle, found: Mapping[str, tuple[Values, Values]]) -> Iterator[str]:
    """Yield the single effect as a possible cause of two found effects.

    Only the ratios of thrust to mass and to inertia show. So of mass, inertia and a scale of thrust
    any two with like changes equal the third with the opposite change.

    Args:
        vehicle: as declared.
        found: coefficients of effects, and their standard deviations.
    """
    roles = (Role.MASS, Role.THRUST, Role.INERTIA)
    for third in roles:
        pair = [playing(role, among=found) for role in roles if role != third]
        for a, b in itertools.product(*pair):
            (x, dx), (y, dy) = (_relative(vehicle, e, *found[e]) for e in (a, b))
            off = np.subtract.outer(x, y)
            alike = SHARE * np.maximum.outer(np.abs(x), np.abs(y))
            if np.all(np.abs(off) < MOST_APART * np.sqrt(np.add.outer(dx**2, dy**2) + alike**2)):
                other = " or ".join(playing(third))
                yield f"{a} and {b} change alike: {other} may be the one cause"


def cancelling(parts: Mapping[str, Array], left: Array) -> Iterator[str]:
    """Yield each two effects whose mean forces or torques cancel to a third of either, with their
    sum, which alone the flight identifies.

    Args:
        parts: (rows, 6) wrench of each effect.
        left: (rows, 6) residual beside them. Means within its RMS do not count.
    """
    for channel, least, *means in zip(
        CHANNELS, left.std(axis=0), *(x.mean(axis=0) for x in parts.values()), strict=True
    ):
        for (a, x), (b, y) in itertools.combinations(zip(parts, means, strict=True), 2):
            if min(abs(x), abs(y)) > max(least, BY_CHANCE * abs(x + y)):
                unit = "N" if channel.startswith("F") else "Nm"
                yield (
                    f"{a} and {b} cancel in {channel}, {x:.3g} and {y:.3g} {unit}: the flight "
                    f"identifies their sum, {x + y:.2g} {unit}"
                )


def _relative(vehicle: Vehicle, effect: str, values: Values, std: Values) -> Array:
    """Return the relative changes by an effect, and their standard deviations."""
    changes = (
        np.array([values[c.name], std.get(c.name, 0.0)])
        / unit_of_change(Column(effect, c.name), vehicle)
        for c in get(effect).coefficients
        if c.name in values and c.name != CENTRAL
    )
    return np.transpose([*changes])


def outside_the_fit(flights: RegressedFlights) -> Iterator[str]:
    """Yield, for each quantity outside the range of the fit in held-out flight, how far outside.

    A coefficient fitted at 6 m/s holds at 14 m/s only if the effect's form holds so far. No fit
    knows this.
    """
    seen = flights.fit_rows
    thrust = flights.vehicle.rotor_wrench(flights.at_rows("rotor_speeds"))[:, 0]
    for name, unit, values in (
        ("the speed", "m/s", np.linalg.norm(flights.at_rows("velocity"), axis=1)),
        ("the turn rate", "rad/s", np.linalg.norm(flights.at_rows("angular_velocity"), axis=1)),
        ("the thrust", "weights", thrust / flights.vehicle.weight),
    ):
        most = np.quantile(values[seen], KNOWN)
        others = values[~seen]
        beyond = np.mean(others > most)
        if beyond > OUTSIDE:
            yield (
                f"outside the range of the fit: {name} of {beyond:.0%} of the held-out flight is "
                f"above {most:.3g} {unit}, up to {others.max():.3g} {unit}. The errors there are "
                "those of an extrapolation"
            )


def inertial_notes(flights: RegressedFlights, named: Sequence[str]) -> Iterator[str]:
    """Yield the consequences of reading the motion from an IMU."""
    if not flights.inertial:
        return
    rates = [pose_rate(log) for log in flights.logs]
    yield (
        "the log has no pose: the motion is read from gyro and accelerometer. Horizontal axes "
        f"are those in which the vehicle pointed at t = {flights.logs[0].t[0]:.4g} s, where its "
        "flight begins, and drift with the gyro"
        if not any(rates)
        else f"the log has {min(rates):.3g} positions a second: fast motion is read from gyro "
        "and accelerometer, slow motion from the positions"
    )
    for effect in playing(Role.THRUST_AXIS, among=named):
        yield f"{effect}: an IMU that is mounted tilted by as much leaves the same log"


def late_rotors(
    flights: RegressedFlights, effects: Iterable[str], sensors: Mapping[str, Pair]
) -> Iterator[str]:
    """Yield the delay of the rotor speeds against their log, unless an effect covers it;
    ``sensors``: time offsets and their standard deviations.
    """
    offset, std = sensors.get(ROTOR_TIME_OFFSET.coefficient, (0.0, math.inf))
    least = max(LEAST_ROTOR_TIME_OFFSET, BY_CHANCE * std)
    if flights.inertial or any(map(moves_time, effects)) or abs(offset) < least:
        return
    pose = ", or the filter of the pose delays it by as much" if flights.filtered else ""
    way = f"later than they are logged{pose}" if offset > 0 else "earlier than they are logged"
    yield f"the rotor speeds act {abs(1000 * offset):.1f} ms {way}"


def advice(
    effects: Sequence[NamedEffect],
    not_identifiable: Sequence[str],
    remainder: str,
    filtered: bool,
    needs_pose: Sequence[str],
) -> Iterator[str]:
    """Yield the flights, and the channels to log, for questions these logs leave open."""
    if filtered:
        lost = needing(Need.FAST_MOTION)
        yield (
            "Log the pose as it was measured, before any filter or estimator. Behind one, no "
            f"flight identifies {', '.join(sorted(lost))}, and no name is more than tentative."
        )
        not_identifiable = [x for x in not_identifiable if x not in lost]
    for effect in effects:
        if effect.indistinguishable_from:
            group = (effect.name, *effect.indistinguishable_from)
            yield f"To tell {' and '.join(group)} apart: {_excitations(group)}"
    if remainder == "structured":
        yield (
            "Fly hover, climbs, level flight at several speeds and turns one at a time: they show "
            "the variable that the residual follows. No effect of the library explains its "
            "structure."
        )
    if needs_pose:
        yield (
            f"An IMU alone does not show {', '.join(needs_pose)}: they need a velocity, a position "
            "or an attitude that no gyro and accelerometer know. To identify one of them, log the "
            "pose as well."
        )
    if not_identifiable:
        how = "docs/effects.md says what to fly for each"
        if len(not_identifiable) <= FEW:
            how = f"To identify one: {_excitations(not_identifiable)}"
        yield f"Not identifiable from these flights: {', '.join(not_identifiable)}. {how}"


def _excitations(effects: Iterable[str]) -> str:
    return "; ".join(f"{name} needs {get(name).excitation}" for name in effects)
