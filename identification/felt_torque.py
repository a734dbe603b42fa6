"""The noise of a law's loop, from a flight along a measured profile: of the torque about z as the
vehicle's own wrench filter shows it, and of the vehicle's place.
"""

import numpy as np
from scipy.ndimage import uniform_filter1d

from ..controllers.briefing import FilterNoise
from ..controllers.observation import DECISION_PERIOD
from ..dynamics.vehicle import Vehicle
from ..estimator import UKFTuning
from ..runtime.errors import InputError
from .jet_design import FollowingLoop, following_loop
from .logs.flight_log import FlightLog
from .logs.table import Array
from .wind_profile import WindProfile
from .wrench_series import estimate_log

_ROWS = 100  # decisions of a flight at least
_SLOW = 6.0  # s, over which a place is the flight's way


def loops_of(
    log: FlightLog,
    vehicle: Vehicle,
    profile: WindProfile,
    edges: tuple[float, float],
    rise_time: float,
    others: Array,
) -> dict[float, FollowingLoop]:
    """Return the loop of an admittance law in a profile by the filter's rise time (s): the one that
    flies, with the noise of this flight, and ``others`` (n,) for their lag alone.

    Raises:
        InputError: less than 8 s of the flight lie between the ``edges`` (m) of the jet.
    """

    def filter_noise(rise: float) -> FilterNoise:
        return FilterNoise.of(UKFTuning.for_vehicle(vehicle, log.period, rise), log.period)

    inertia = float(vehicle.inertia[2, 2])
    loops = {float(rise): following_loop(inertia, filter_noise(rise)) for rise in others}
    alone = following_loop(inertia, filter_noise(rise_time))
    tuning = UKFTuning.for_vehicle(vehicle, log.period, rise_time)
    series = estimate_log(log, vehicle, tuning)
    t = np.arange(log.t[0] + 4.0 * rise_time, log.t[-1], DECISION_PERIOD)
    rows = np.minimum(np.searchsorted(log.t, t), len(log.t) - 1)
    place, felt = profile.along(series.position)[rows], series.torque[rows, 2]
    true = np.interp(place, profile.place, profile.torque)
    error, expected = np.zeros(3), np.empty(len(true))
    for k, change in enumerate(np.diff(true, prepend=true[0])):
        error = alone.keep @ error + alone.enter * change
        expected[k] = true[k] - error[2]
    # the vehicle's own wandering, beside its slow way
    span = round(_SLOW / DECISION_PERIOD)
    wander = place - uniform_filter1d(place, span, mode="nearest")
    noise = np.column_stack([felt - expected, wander])
    inside = (place > edges[0]) & (place < edges[1]) & np.isfinite(noise).all(axis=1)
    if inside.sum() < _ROWS:
        raise InputError(
            f"{log.source or log.name}: only {DECISION_PERIOD * inside.sum():.0f} s of the flight "
            f"lie in the jet; expected {DECISION_PERIOD * _ROWS:.0f} s or more"
        )
    own = following_loop(
        inertia, filter_noise(rise_time), noise[inside] - noise[inside].mean(axis=0)
    )
    return loops | {rise_time: own}
