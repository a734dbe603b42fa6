"""An exported flight: the flight loop, and the laws that fly in it (``source/flight.hpp``)."""

from typing import Any

from ...controllers.flight import FlightGains, flight_record
from ...controllers.lqg import LQG
from ...controllers.trained_policy import TaskPolicy, cell_of
from ...controllers.wind_observation import WIND_PERIOD
from ...dynamics.effects import compile_effects
from ...dynamics.vehicle import Vehicle
from ...runtime.errors import InputError

CONTROLLERS = ("lqg",)
_ACTIONS = ("attitude", "rates", "rotors")


def flight_of(
    vehicle: Vehicle, period: float, controller: str | None, policy: TaskPolicy | None
) -> dict[str, Any]:
    """Return the templates' numbers of a vehicle's flight loop and its laws.

    Args:
        vehicle: the declared one, whom the controller is designed for.
        period: the wrench filter's, s.
        controller: one of ``CONTROLLERS``, or None.
        policy: a trained one, or None.

    Raises:
        InputError: a policy of another kind, or a decision is no whole number of periods.
    """
    task = policy.card.get("flight", {}) if policy else {"decision_hz": 1.0 / WIND_PERIOD}
    if policy and not (
        task.get("action") in _ACTIONS
        and task["observation"]
        and task["gains"] == vars(FlightGains())
        and "memory" not in policy.card
        and cell_of(policy.weights) is None
    ):
        raise InputError(
            f"--policy: of {policy.task}; expected one of FanTracking, or one of dense layers "
            f"with the kit's gains and the action {', '.join(_ACTIONS)}"
        )
    ticks = 1.0 / (task["decision_hz"] * period)
    if abs(ticks - round(ticks)) > 1e-6 or (controller and task["decision_hz"] * WIND_PERIOD != 1):
        raise InputError(
            f"export-c: {task['decision_hz']:g} decisions in {1.0 / period:g} steps a second: "
            f"expected whole steps (--rate 200), and {1.0 / WIND_PERIOD:g} beside a controller"
        )
    return {
        "loop": flight_record(compile_effects(vehicle).vehicle)[0],
        "law": LQG(vehicle=vehicle) if controller else None,
        "policy": policy,
        "task": task,
        "ticks": round(ticks),
    }
