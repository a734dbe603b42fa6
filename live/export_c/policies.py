"""A policy as C: weights as tables, a law with its two gains, or the tracker: a vehicle's own
sensing of a moving fan, as tables.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ...controllers.briefing import Briefing, FilterNoise
from ...controllers.fan_laws import Lead
from ...controllers.features import QUANTITIES
from ...controllers.jet_map import FIRST, STEP
from ...controllers.observation import DECISION_PERIOD, MAX_COMMAND
from ...controllers.registry import shipped_policies
from ...controllers.sensor_model import SETTLED, sensor_model
from ...controllers.tracker import FEW, STOP, TURN, Tracker, nominal
from ...controllers.trained_policy import TrainedPolicy, cell_of, layers_of, load_policy
from ...controllers.wrench_lag import ORDER
from ...dynamics.vehicle import Vehicle
from ...estimator import UKFTuning
from ...runtime.errors import InputError

LAWS = ("lead", "tracker")
PARTICLES = 400  # the tracker's, 40 kB: a flight controller can spare as much
# the numbers of an observation in the C, in order
_COLUMNS = (
    *(f"e->{part}[{i}]" for part in ("force", "torque") for i in range(3)),
    *("e->velocity[1]", "m->command"),
)


def exportable_policy(name: str) -> Mapping[str, Any]:
    """Return the templates' numbers of a policy: a law, or a trained one by its name or path.

    Raises:
        InputError: there is no such policy, or its kind is not exported.
    """
    if name == "lead":
        return {
            "kind": "lead",
            "title": "Fan tracking with lead: u = -(gain x + rate_gain dx/dt), x = tau_z / f_x.",
            "source": "controllers/fan_laws.py",
            "law": Lead(),
        }
    if name == "tracker":
        return {"kind": "tracker"}  # the rest is the vehicle's: ``tracker_policy``
    trained = shipped_policies()
    if name not in trained and not name.endswith((".npz", ".json")):
        raise InputError(
            f"--policy {name}: no such policy; expected {', '.join((*LAWS, *trained))}, or the "
            "path of a trained one"
        )
    path = trained.get(name, Path(name))
    policy = load_policy(path)
    if not isinstance(policy, TrainedPolicy):
        raise InputError(f"--policy {name}: is of {policy.task}; expected one of FanTracking")
    if cell_of(policy.weights) is not None:
        raise InputError(
            f"--policy {name}: is recurrent; only policies of dense layers can be exported"
        )
    features = policy.features
    weights = policy.weights
    card = policy.card
    summed = next((quantity for quantity in features.frame if QUANTITIES[quantity].summed), None)
    if summed is not None:
        raise InputError(
            f"--policy {name}: sees {summed}, which is not in an estimate by itself; such a policy "
            "cannot be exported"
        )
    places = [_COLUMNS[QUANTITIES[quantity].column] for quantity in features.frame]
    layers = [(weights[f"weight{i}"], weights[f"bias{i}"]) for i in range(layers_of(weights))]
    return {
        "kind": "dense",
        "name": name,
        "title": f"The policy {path.stem}, trained with "
        f"{card.get('algorithm', 'an unknown algorithm')}.",
        "source": "controllers/trained_policy.py",
        "repeat": int(card["repeat"]),
        "frame": list(zip(places, features.scale, strict=True)),
        "history": features.history,
        "layers": layers,
        "widest": max(features.size, *(len(bias) for _, bias in layers)),
        "activation": str(card["activation"]),
        "squash": bool(card["squash"]),
    }


def briefing_of(vehicle: Vehicle, tuning: UKFTuning, period: float) -> Briefing:
    """Return the briefing of a vehicle's tracker: the vehicle, the tuning and period (s) of its
    wrench filter, and the fan and the air of the scenario ``base``.
    """
    return nominal(Briefing(vehicle=vehicle, noise=FilterNoise.of(tuning, period)))


def tracker_policy(vehicle: Vehicle, tuning: UKFTuning, period: float) -> Mapping[str, Any]:
    """Return the templates' numbers of a vehicle's tracker, with the gains of ``Tracker`` and the
    fan and the air of the scenario ``base``.

    Args:
        vehicle: the vehicle in flight.
        tuning: its wrench filter's.
        period: the wrench filter's, s.
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
