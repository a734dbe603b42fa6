"""The numbers of an exported policy: weights, a law's two gains, or the tracker's: a vehicle's own
sensing of a moving fan, as tables. Its code is ``source/KIND.hpp``.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...controllers.briefing import Briefing, FilterNoise
from ...controllers.fan_laws import Lead
from ...controllers.features import QUANTITIES
from ...controllers.observation import DECISION_PERIOD, MAX_COMMAND
from ...controllers.registry import shipped_policies
from ...controllers.sensor_model import SETTLED, sensor_model
from ...controllers.tracker import FEW, STOP, TURN, Tracker, nominal
from ...controllers.trained_policy import TrainedPolicy, cell_of, load_policy
from ...controllers.wrench_lag import ORDER
from ...dynamics.vehicle import Vehicle
from ...estimator import UKFTuning
from ...runtime.errors import InputError

LAWS = ("lead", "tracker")
PARTICLES = 400  # the tracker's, 40 kB: a flight controller can spare as much


def exportable_policy(name: str) -> Mapping[str, Any]:
    """Return the numbers of a policy: a law, or a trained one by its name or path.

    Raises:
        InputError: there is no such policy, or its kind is not exported.
    """
    if name == "lead":
        law = Lead()
        return {
            "kind": "lead",
            "title": "Fan tracking with lead: u = -(gain x + rate_gain dx/dt), x = tau_z / f_x.",
            "numbers": [
                ("GAIN", law.gain, "m/s"),
                ("RATE_GAIN", law.lead, "m"),
                ("LEAST_FORCE", law.least_force, "N"),
            ],
            "size": (1, 1),
        }
    if name == "tracker":
        return {"kind": "tracker"}  # the rest is the vehicle's: ``policy_numbers``
    trained = shipped_policies()
    if name not in trained and not name.endswith((".npz", ".json")):
        raise InputError(
            f"--policy {name}: no such policy; expected {', '.join((*LAWS, *trained))}, or the "
            "path of a trained one"
        )
    path = trained.get(name, Path(name))
    policy = load_policy(path)
    if not isinstance(policy, TrainedPolicy):
        return {"kind": "flight", "policy": policy}  # the rest is in ``flights``
    if cell_of(policy.weights) is not None:
        raise InputError(
            f"--policy {name}: is recurrent; only policies of dense layers can be exported"
        )
    features = policy.features
    summed = next((quantity for quantity in features.frame if QUANTITIES[quantity].summed), None)
    if summed is not None:
        raise InputError(
            f"--policy {name}: sees {summed}, which is not in an estimate by itself; such a policy "
            "cannot be exported"
        )
    columns = [QUANTITIES[quantity].column for quantity in features.frame]
    return {
        "kind": "dense",
        "title": f"The policy {path.stem}, trained with "
        f"{policy.card.get('algorithm', 'an unknown algorithm')}.",
        "integers": [
            ("REPEAT", int(policy.card["repeat"]), "decisions that a command is held for"),
            ("HISTORY", features.history, "frames"),
            ("FRAME", len(columns), "numbers of a frame"),
        ],
        "lists": [("PLACES", columns, "of a frame's numbers in an observation")],
        "numbers": [
            ("SCALES", np.array(features.scale, dtype=float), "of a frame's numbers"),
        ],
        "layers": policy,
        "size": (1, features.history * len(columns) + 1),
    }


def briefing_of(vehicle: Vehicle, tuning: UKFTuning, period: float) -> Briefing:
    """Return the briefing of a vehicle's tracker: the vehicle, the tuning and period (s) of its
    wrench filter, and the fan and the air of the scenario ``base``.
    """
    return nominal(Briefing(vehicle=vehicle, noise=FilterNoise.of(tuning, period)))


def policy_numbers(
    policy: Mapping[str, Any], vehicle: Vehicle, tuning: UKFTuning, period: float
) -> Mapping[str, Any]:
    """Return the numbers of an ``exportable_policy`` aboard a vehicle.

    Args:
        policy: from ``exportable_policy``.
        vehicle: the vehicle in flight.
        tuning: its wrench filter's.
        period: the wrench filter's, s.
    """
    common = {"max_command": MAX_COMMAND, "integers": [], "lists": []}
    if policy["kind"] != "tracker":
        return common | dict(policy)
    law = Tracker()
    model = sensor_model(briefing_of(vehicle, tuning, period))
    return common | {
        "kind": "tracker",
        "title": "Fan tracking by a particle filter on the fan's place and velocity.",
        "particles": PARTICLES,
        "integers": [
            ("SETTLED", SETTLED, "decisions that the filter has settled before the first"),
        ],
        "numbers": [
            ("REACH", law.reach, "m, of the fan at first"),
            ("SPEED", law.speed, "m/s, deviation of a new velocity of the fan"),
            ("DRIFT_STD", law.acceleration * np.sqrt(DECISION_PERIOD), "m/s, in a decision"),
            ("JUMPS", law.jumps * DECISION_PERIOD, "chance of a new velocity, in a decision"),
            ("STOP", STOP, "chance that the new velocity is none,"),
            ("TURN", STOP + TURN, "and that it is none or the opposite"),
            ("FEW", FEW, "effective share of the particles, below which they are drawn anew"),
            ("FEED", law.feed, "of the fan's velocity"),
            ("GAIN", law.gain, "1/s, of the offset"),
            ("DAMPING", law.damping, "of the velocity's error"),
            ("JET", model.tables, "mean, slopes with velocity and yaw rate, deviation: Nm, N, N"),
            ("KEEP", model.keep, "of the filter's error, in a decision"),
            ("ENTER", model.enter, "of a change, into that error"),
            ("REGRESSION", model.regression, "of residuals, at the first decisions and the others"),
            ("REST", model.variance, "variance that the regression leaves"),
            ("YAW", model.yaw, "integral, angle, rate after a decision; torque and its rate"),
        ],
        "size": (6, 6 + PARTICLES * (2 + 3 + 9 + 3 * ORDER + 3)),
    }
