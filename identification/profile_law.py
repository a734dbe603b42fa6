"""From a flight through a wind to an admittance law: the profile, the jet in it, and the design."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..controllers.observation import MAX_COMMAND
from ..dynamics.vehicle import Vehicle
from ..runtime.errors import InputError
from .felt_torque import loops_of
from .jet_design import (
    RISE_TIMES,
    AdmittanceDesign,
    JetShape,
    design_admittance,
    fastest_followed,
    no_jet,
    shape_of,
)
from .logs.flight_log import FlightLog
from .wind_profile import WindProfile, wind_profile
from .wrench_series import WrenchSeries, estimate_log

RISE_TIME = 0.45  # s, of the filter in the tasks
_DRAWS = 40  # of the profile, for the intervals
_SPREAD = 0.15  # m, of a flight about its line, above which a note is due
_UNLIKE = 3.0  # standard deviations between the two largest torques, for a note

Interval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class ProfiledJet:
    """A flight's profile and the law for it; ``why`` says why there is none.

    Attributes:
        profile: along the line of the law.
        others: along the flight's other lines.
        why: empty where there is a law.
        shape: of the torque's profile.
        design: the law.
        intervals: 95 %, from the profile's draws: ``bound`` and ``fastest`` in m/s, ``left`` and
            ``right`` in m, places of the largest torques.
        notes: sentences for the user.
    """

    profile: WindProfile
    others: tuple[WindProfile, ...]
    why: str
    shape: JetShape | None
    design: AdmittanceDesign | None
    intervals: dict[str, Interval]
    notes: tuple[str, ...]


def profile_log(
    log: FlightLog,
    vehicle: Vehicle,
    axis: float | None = None,
    line: float | None = None,
    rise_time: float = RISE_TIME,
    speed: float | None = None,
    report: Callable[[float], None] | None = None,
) -> ProfiledJet:
    """Return force and torque over the place of a flight, and the admittance law for them.

    Args:
        log: hovers on a line or grid, or slow sweeps, through a steady wind.
        vehicle: as declared.
        axis: rad, direction of the line from the world's x; default: found.
        line: m along the wind, of the line where the flight has several.
        rise_time: s, of the wrench filter that the law will fly with.
        speed: m/s, the largest of the fans behind which the gain has the least offset; default:
            half of the fastest that any gain follows.
        report: called now and then with the finished share.

    Raises:
        InputError: the log does not suit ``estimate_log``, or is too short or too narrow for a
            profile.
    """
    series = estimate_log(log, vehicle, report=report, smooth=True)
    try:
        profile = wind_profile(series, axis, line)
    except InputError as error:
        raise InputError(f"{log.source or log.name}: {error}") from error
    others, notes = _others(series, profile), [*series.notes, *_notes(profile)]
    why = no_jet(profile.place, profile.torque, profile.std[5])
    shape = None if why else shape_of(profile.place, profile.torque)
    if shape is None:
        return ProfiledJet(profile, others, why, None, None, {}, tuple(notes))
    notes += _one_sided(profile, shape)
    loops = loops_of(log, vehicle, profile, shape.edges, rise_time, RISE_TIMES)
    flown = profile.place, profile.torque
    design = design_admittance(loops, rise_time, *flown, shape, speed)
    if design is None:
        why = "the torque's noise lets no gain follow a fan: fly longer, or nearer to the fan"
        return ProfiledJet(profile, others, why, shape, None, {}, tuple(notes))
    drawn = []
    for torque in profile.torque_draws[:_DRAWS]:
        if one := shape_of(profile.place, torque):
            gain = np.array([design.gain])
            fastest = fastest_followed(loops[rise_time], profile.place, torque, one, gain)[0]
            bound = min(design.gain * one.weaker, MAX_COMMAND)
            drawn.append((bound, fastest, *one.peaks))
    low, high = np.quantile(np.array(drawn), (0.025, 0.975), axis=0).tolist()
    names = "bound", "fastest", "left", "right"
    intervals = dict(zip(names, zip(low, high, strict=True), strict=True))
    return ProfiledJet(profile, others, "", shape, design, intervals, tuple(notes))


def _others(series: WrenchSeries, profile: WindProfile) -> tuple[WindProfile, ...]:
    """Return the profiles of the flight's other lines, where they are long enough."""
    found = []
    for beside, _ in profile.lines:
        if abs(beside - profile.beside) > 0.05:
            try:
                found.append(wind_profile(series, profile.direction, float(beside)))
            except InputError:
                continue
    return tuple(found)


def _notes(profile: WindProfile) -> list[str]:
    """Return a warning of a flight that strayed from its line."""
    if max(profile.spread) <= _SPREAD:
        return []
    return [
        f"warning: the flight strays {profile.spread[0]:.2f} m along the wind and "
        f"{profile.spread[1]:.2f} m in height (standard deviations): the profile is a mean over both"
    ]


def _one_sided(profile: WindProfile, shape: JetShape) -> list[str]:
    """Return a warning of largest torques that differ beyond their uncertainty."""
    left, right = (float(np.interp(p, profile.place, profile.std[5])) for p in shape.peaks)
    total = sum(shape.torques)
    if abs(total) <= _UNLIKE * float(np.hypot(left, right)):
        return []
    return [
        f"warning: the two largest torques differ by {1e3 * abs(total):.2g} mNm: about "
        f"{5e2 * total:+.2g} mNm is not the jet's, or the jet leans. The law rests where the torque "
        "is zero, and follows by the weaker side"
    ]
