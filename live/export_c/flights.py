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
    task = {"decision_hz": 1.0 / WIND_PERIOD}
    if policy is not None:
        task = policy.card.get("flight", {})
        known = task.get("action") in _ACTIONS and task["observation"]
        if not known or task["gains"] != vars(FlightGains()) or "memory" in policy.card or cell_of(policy.weights):
            raise InputError(
                f"--policy: of {policy.task}; expected one of FanTracking, or one of dense layers "
                f"with the kit's gains and the action {', '.join(_ACTIONS)}"
            )
    seconds = 1.0 / task["decision_hz"]
    ticks = round(seconds / period)
    if abs(ticks * period - seconds) > 1e-6 or (controller and seconds != WIND_PERIOD):
        raise InputError(
            f"export-c: decisions of {seconds:g} s in steps of {period:g} s: expected whole steps "
            f"(--rate 200), and beside {controller} decisions of {WIND_PERIOD:g} s"
        )
    return {
        "loop": flight_record(compile_effects(vehicle).vehicle)[0],
        "law": LQG(vehicle=vehicle) if controller else None,
        "policy": policy,
        "task": task,
        "ticks": ticks,
    }
