"""A policy as C: weights as tables, or a law with its two gains."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ...controllers.fan_laws import Lead
from ...controllers.features import QUANTITIES
from ...controllers.registry import shipped_policies
from ...controllers.trained_policy import TrainedPolicy, cell_of, layers_of, load_policy
from ...runtime.errors import InputError
from .c_numbers import literal, table

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
        law = Lead()
        return {
            "kind": "lead",
            "title": "Fan tracking with lead: u = -(gain x + rate_gain dx/dt), x = tau_z / f_x.",
            "source": "controllers/fan_laws.py",
            "gain": literal(law.gain),
            "rate_gain": literal(law.lead),
            "least_force": literal(law.least_force),
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
    frame = []
    for quantity, scale in zip(policy.features.frame, policy.features.scale, strict=True):
        known = QUANTITIES[quantity]
        if known.summed:
            raise InputError(
                f"--policy {name}: sees {quantity}, which is not in an estimate by itself; "
                "such a policy cannot be exported"
            )
        frame.append({"c": _COLUMNS[known.column], "scale": literal(scale, name)})
    layers = []
    for i in range(layers_of(policy.weights)):
        weight, bias = policy.weights[f"weight{i}"], policy.weights[f"bias{i}"]
        layers.append(
            {
                "rows": weight.shape[0],
                "columns": weight.shape[1],
                "weight": table(weight),
                "bias": table(bias),
            }
        )
    squash, activation = bool(policy.card["squash"]), str(policy.card["activation"])
    last = "b" if len(layers) % 2 == 1 else "a"
    widest = max(policy.features.size, *(layer["rows"] for layer in layers))
    return {
        "kind": "dense",
        "title": f"The policy {path.stem}, trained with "
        f"{policy.card.get('algorithm', 'an unknown algorithm')}.",
        "source": "controllers/trained_policy.py",
        "repeat": int(policy.card["repeat"]),
        "frame": frame,
        "history": policy.features.history,
        "layers": layers,
        "widest": widest,
        "activation": activation,
        "squash": squash,
        "last": last,
    }
