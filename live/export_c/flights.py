"""The numbers of an exported flight: the flight loop, and the laws that fly in it. The code is
``source/flight.hpp``.
"""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

import numpy as np

from ...controllers.flight import ATTITUDE, FLIGHT, RATES, ROTORS, FlightGains, flight_record
from ...controllers.lqg import LQG
from ...controllers.trained_policy import TaskPolicy
from ...controllers.wind_observation import WIND_PERIOD
from ...dynamics.effects import compile_effects
from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError
from .policies import layer_numbers

CONTROLLERS = ("lqg",)
_KINDS = {"attitude": ATTITUDE, "rates": RATES, "rotors": ROTORS}
_SEES = {"pose": (0, 0), "wrench": (1, 0), "imu": (0, 1), "all": (1, 1)}  # wrench, accelerometer
_PILOT = 60  # numbers of a pilot's memory beside the flight loop and the regulator's states


def flight_numbers(
    vehicle: Vehicle, period: float, controller: str | None, policy: TaskPolicy | None
) -> Mapping[str, Any]:
    """Return the numbers of a vehicle's flight loop and its laws, for the templates.

    Args:
        vehicle: the declared one, whom the controller is designed for.
        period: the wrench filter's, s.
        controller: one of ``CONTROLLERS``, or None.
        policy: a trained one of attitudes, rates or rotor speeds, or None.

    Raises:
        InputError: no such controller, a policy of another kind, or a decision is no whole number
            of periods.
    """
    record = flight_record(compile_effects(vehicle).vehicle)[0]
    lqg = _regulator(vehicle) if controller is not None else {}
    learned = {} if policy is None else _learned(policy)
    seconds = learned.get("decision_s", WIND_PERIOD)
    ticks = round(seconds / period)
    if ticks < 1 or abs(ticks * period - seconds) > 1e-6 or (lqg and seconds != WIND_PERIOD):
        raise InputError(
            f"export-c: decisions of {seconds:g} s in steps of {period:g} s: expected whole steps, "
            f"--rate 200, and with a controller decisions of {WIND_PERIOD:g} s"
        )
    states = lqg.get("states", 1)
    laws = 2 * bool(lqg) + 4 * bool(learned)
    integers = [
        ("DECISION", ticks, "steps"),
        ("STATES", states, "of the regulator"),
        ("LAWS", laws, "bits of the laws that are here"),
    ]
    settings = ("omega_max", "hover_rate", *FlightGains.__dataclass_fields__)
    return {
        "title": "The flight loop and its laws.",
        "lqg": bool(lqg),
        "learned": learned.get("title"),
        "decision_s": seconds,
        "size": FLIGHT.itemsize // 8 + _PILOT + states,
        "settings": {name: record[name] for name in settings},
        "integers": [*integers, *lqg.get("integers", []), *learned.get("integers", [])],
        "lists": learned.get("lists", []),
        "numbers": [
            ("UNMIXING", record["unmixing"], "thrust and torques to squared rotor speeds"),
            *lqg.get("numbers", []),
            *learned.get("numbers", []),
        ],
    }


def _regulator(vehicle: Vehicle) -> dict[str, Any]:
    """Return the numbers of the regulator that is designed for a vehicle, axis by axis."""
    law = LQG(vehicle=vehicle)
    models = [observer.model for observer in law.observers]
    flat = {
        "LQG_A": [m.A for m in models],
        "LQG_B": [m.B for m in models],
        "LQG_C": [m.C for m in models],
        "LQG_GAINS": [m.gains for m in models],
        "LQG_LAW": law.gains,
    }
    numbers = [(n, np.concatenate([x.ravel() for x in each]), "") for n, each in flat.items()]
    level, _, upwards = (len(m.A) for m in models)
    return {
        "states": 2 * level + upwards,
        "integers": [
            ("LQG_LEVEL", level, "states along x and y"),
            ("LQG_UPWARDS", upwards, "along z"),
            ("LQG_ROWS", len(models[0].gains), "decisions with gains of their own"),
        ],
        "numbers": [*numbers, ("LQG_AHEAD", law.ahead, "of the reference's last turn")],
    }


def _learned(policy: TaskPolicy) -> dict[str, Any]:
    """Return the numbers of a trained policy."""
    flight = policy.card.get("flight", {})
    if flight.get("action") not in _KINDS or flight.get("observation") not in _SEES:
        raise InputError(
            f"--policy: {policy.task}: expected one that `windwrench train` trained with the action "
            f"{', '.join(_KINDS)} and the observation {', '.join(_SEES)}"
        )
    if flight["gains"] != asdict(FlightGains()) or "memory" in policy.card:
        raise InputError(f"--policy: {policy.task}: has gains or a memory of its own: not exported")
    wrench, imu = _SEES[flight["observation"]]
    layers = layer_numbers(policy, policy.task)
    return {
        "title": f"a policy trained with {policy.card.get('algorithm', 'an unknown algorithm')}",
        "decision_s": 1.0 / flight["decision_hz"],
        "integers": [
            ("KIND", _KINDS[flight["action"]], "of commands, in core/flight_loop.hpp"),
            ("SEES_WRENCH", wrench, ""),
            ("SEES_IMU", imu, ""),
            *layers["integers"],
        ],
        "lists": layers["lists"],
        "numbers": [
            ("LIMITS", np.array(flight["limits"]), "of the observation"),
            ("DIVISORS", np.array(flight["divisors"]) * policy.card["scale"], ""),
            ("AT_ZERO", np.array(flight["hover"]), "command of the action 0"),
            ("BELOW", np.array(flight["below"]), "more for an action below, a unit"),
            ("ABOVE", np.array(flight["above"]), "likewise above"),
            *layers["numbers"],
        ],
    }
