"""A policy as C: weights as tables, or a law with its two gains."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...controllers.fan_laws import Lead
from ...controllers.features import QUANTITIES
from ...controllers.registry import shipped_policies
from ...controllers.trained_policy import TrainedPolicy, cell_of, layers_of, load_policy
from ...runtime.errors import InputError

LAWS = ("lead", "tracker")
# where the C has the numbers of an observation, in its order
_COLUMNS = (
    *(f"e->{part}[{i}]" for part in ("force", "torque") for i in range(3)),
    *("e->velocity[1]", "m->command"),
)


def exportable_policy(name: str) -> Mapping[str, Any]:
    """Return what the templates need of a policy: a law, or a trained one by its name or path.

    Raises:
        InputError: there is no such policy, or it is of a kind that is not exported.
    """
    if name == "lead":
        return {
            "kind": "lead",
            "title": "Fan tracking with lead: u = -(gain x + rate_gain dx/dt), x = tau_z / f_x.",
            "source": "controllers/fan_laws.py",
            "law": Lead(),
        }
    if name == "tracker":
        return {"kind": "tracker"}  # the rest is the vehicle's: ``tracker.tracker_policy``
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
    features, weights, card = policy.features, policy.weights, policy.card
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
