"""From a flight through a wind to an admittance law: the profile, the jet in it, and the design."""

from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import NamedTuple

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..controllers.briefing import FilterNoise
from ..controllers.observation import DECISION_PERIOD
from ..dynamics.vehicle import Vehicle
from ..estimator import UKFTuning
from ..runtime.errors import InputError
from .jet_design import (
    FollowingLoop,
    JetShape,
    design_admittance,
    fastest_followed,
    following_loop,
    no_jet,
    shape_of,
)
from .logs.flight_log import FlightLog
from .logs.table import Array, Data, Names, finite_rows
from .wind_profile import WindProfile, ways_of, wind_profile
from .wrench_series import WrenchSeries, estimate_log

RISE_TIME = 0.45  # s, of the filter in the tasks
_ROWS = 100  # decisions of a flight in the jet, at least
_SLOW = 6.0  # s, over which a place is the flight's way


class ProfiledJet(NamedTuple):
    """A flight's profile and the law for it; ``why`` says why there is none.

    Attributes:
        profile: along the line of the law.
        others: along the flight's other lines.
        why: empty where there is a law.
        shape: of the torque's profile.
        law: ``design_admittance``, with 95 % intervals from the profile's draws.
        notes: on the log.
    """

    profile: WindProfile
    others: tuple[WindProfile, ...]
    why: str
    shape: JetShape | None
    law: Data | None
    notes: Names


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
    others = []
    for beside in profile.lines[profile.lines != profile.beside].tolist():
        with suppress(InputError):  # too short a line
            others.append(wind_profile(series, profile.direction, beside))
    found = partial(ProfiledJet, profile, tuple(others), notes=series.notes)
    torque = profile.wrench[5]
    why = no_jet(profile.place, torque, (profile.high[5] - torque) / 1.96)
    shape = None if why else shape_of(profile.place, torque)
    if shape is None:
        return found(why, None, None)

    def loop(rise: float, *noise: Array) -> FollowingLoop:
        tuning = UKFTuning.for_vehicle(vehicle, log.period, rise)
        return following_loop(vehicle.inertia[2, 2], FilterNoise.of(tuning, log.period), *noise)

    shown = estimate_log(log, vehicle, UKFTuning.for_vehicle(vehicle, log.period, rise_time))
    noise = _noise(shown, 4.0 * rise_time, profile, shape, loop(rise_time))
    if len(noise) < _ROWS:
        return found(f"only {DECISION_PERIOD * len(noise):.0f} s lie in the jet", shape, None)
    flying = loop(rise_time, noise - noise.mean(axis=0))
    law = design_admittance(flying, loop, shape, speed)
    if law is None:
        return found("the torque's noise lets no gain follow a fan", shape, None)
    gain = np.array([law["gain"]])
    limits = [
        (jet.bounds(gain), fastest_followed(flying, jet, gain))
        for drawn in profile.torque_draws
        if (jet := shape_of(profile.place, drawn))
    ]
    bound, fastest = np.quantile(limits, (0.025, 0.975), axis=(0, 2)).T.tolist()
    return found("", shape, law | {"bound_ci95_m_s": bound, "fastest_fan_ci95_m_s": fastest})


def _noise(
    series: WrenchSeries, settled: float, profile: WindProfile, jet: JetShape, loop: FollowingLoop
) -> Array:
    """Return the noise (k, 2) of a flight within a jet's edges, a row a decision: of the torque
    about z that the vehicle's own filter shows after it ``settled`` (s), Nm, and of the place (m).
    """
    t = np.arange(series.t[0] + settled, series.t[-1], DECISION_PERIOD)
    rows = np.searchsorted(series.t, t)
    place = series.position[rows] @ ways_of(profile.direction)[1]
    true = np.interp(place, profile.place, profile.wrench[5])
    error, felt = np.zeros(3), []
    for change in np.diff(true, prepend=true[:1]):
        error = loop.keep @ error + loop.enter * change
        felt.append(error[2])
    way = uniform_filter1d(place, round(_SLOW / DECISION_PERIOD), mode="nearest")
    noise = np.column_stack([series.torque[rows, 2] - (true - felt), place - way])
    low, high = jet.edges
    return np.asarray(noise[(place > low) & (place < high) & finite_rows(noise)])
