"""The tracker as C: what a vehicle's own sensing makes of a moving fan, as tables."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...controllers.briefing import Briefing, FilterNoise
from ...controllers.jet_map import FIRST, STEP
from ...controllers.observation import DECISION_PERIOD, MAX_COMMAND
from ...controllers.sensor_model import SETTLED, sensor_model
from ...controllers.tracker import FEW, STOP, TURN, Tracker, nominal
from ...controllers.wrench_lag import ORDER
from ...dynamics.vehicle import Vehicle
from ...estimator import UKFTuning

PARTICLES = 400  # 40 kB: what a flight controller can spare


def briefing_of(vehicle: Vehicle, tuning: UKFTuning, period: float) -> Briefing:
    """Return what the tracker of a vehicle is told, whose wrench filter has this tuning and period
    (s): beside that, the fan and the air of the scenario ``base``.
    """
    return nominal(Briefing(vehicle=vehicle, noise=FilterNoise.of(tuning, period)))


def tracker_policy(vehicle: Vehicle, tuning: UKFTuning, period: float) -> Mapping[str, Any]:
    """Return what the templates need of the tracker of a vehicle, with the gains of ``Tracker`` and
    the fan and the air of the scenario ``base``.

    Args:
        vehicle: that flies.
        tuning: of its wrench filter.
        period: of it, s.
    """
    law = Tracker()
    return {
        "kind": "tracker",
        "title": "Fan tracking by a particle filter on the fan's place and velocity.",
        "source": "controllers/tracker.py",
        "particles": PARTICLES,
        "order": ORDER,
        "settled": SETTLED,
        "model": sensor_model(briefing_of(vehicle, tuning, period)),
        "law": law,
        "drift": law.acceleration * np.sqrt(DECISION_PERIOD),
        "jumps": law.jumps * DECISION_PERIOD,
        "stop": STOP,
        "turn": STOP + TURN,
        "few": FEW,
        "most": MAX_COMMAND,
        "first": FIRST,
        "per_step": 1.0 / STEP,
    }
