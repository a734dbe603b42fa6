"""``python -m studies.closed_loop`` measures what an amended model is worth in flight.

A vehicle has an effect that its model lacks. It is recorded, diagnosed, amended, and flown by
``lqg``, the law that uses the model most, in both tasks in the wind: with the declared model, the
amended one, and the exact one, in the same worlds.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from windwrench.dynamics import load_vehicle
from windwrench.dynamics.vehicle import EffectSetting, Vehicle
from windwrench.envs.recording import record_flight
from windwrench.evaluation.episodes import benchmark_seeds, fly_episode
from windwrench.evaluation.statistics import hierarchical_bootstrap, relative_change
from windwrench.evaluation.tasks import make_pilot, task_of
from windwrench.identification import diagnose
from windwrench.identification.logs.flight_log import FlightLog
from windwrench.runtime.page_files import write_json
from windwrench.studies.kept_results import DOCS, kept
from windwrench.studies.runner import Jobs, code_stamp, run_tasks, start

RESULTS = "close-loop/lqg.json"
TASKS, SCENARIOS = ("WindHover", "WindTrajectory"), ("calm", "base")
MODELS = ("declared", "amended", "exact")
# each effect of the size of a mistake that is made, and the flight that shows it
EFFECTS: Mapping[str, tuple[str, Mapping[str, float]]] = {
    "com_offset": ("shake", {"cx": 0.005, "cy": 0.005, "cz": 0.005}),
    "mass": ("vertical", {"dm": 0.04}),
    "rotor_drag": ("excite", {"kdx": 1.2e-4, "kdy": 1.2e-4}),
    "inflow_thrust": ("excite", {"kz": 2.3e-4}),
    "battery_sag": ("excite", {"n": 1.0}),
    "rotor_efficiency": ("excite", {"e1": -0.08}),
    "motor_lag": ("excite", {"tau": 0.035}),
    "thrust_axis_tilt": ("yaw", {"ax": 0.02, "ay": 0.02}),
    "world_tilt": ("yaw", {"ax": 0.01, "ay": 0.01}),
    "constant_torque": ("excite", {"tx": 0.01, "ty": 0.01, "tz": 0.01}),
}


@cache
def _amended(name: str) -> Vehicle:
    """Return the vehicle with what a diagnosis of one minute of flight adds to it."""
    vehicle, (trajectory, values) = load_vehicle("ardrone2"), EFFECTS[name]
    columns: Any = record_flight(vehicle, (EffectSetting(name, values),), trajectory, 60.0, seed=0)
    amended: Vehicle = diagnose([FlightLog(**columns)], vehicle).amended
    return amended


def flown(name: str, model: str, task: str, scenario: str, episodes: int) -> list[float]:
    """Return the RMSE (m) of ``lqg`` in each episode, of a vehicle with an effect.

    Args:
        name: of the effect.
        model: one of ``MODELS``: what the filter and the law know.
        task: one of ``TASKS``.
        scenario: one of ``SCENARIOS``.
        episodes: how many are flown, the same for every model.
    """
    vehicle = load_vehicle("ardrone2")
    effect = EffectSetting(name, EFFECTS[name][1])
    known = {
        "declared": lambda: vehicle,
        "amended": lambda: _amended(name),
        "exact": lambda: vehicle.with_effects(effect),
    }[model]()
    law = make_pilot("lqg", task)
    env = task_of(task).environment(scenario, vehicle=known, truth=vehicle, effects=(effect,))
    decisions = task_of(task).decisions
    return [
        fly_episode(env, law, seed, decisions=decisions).rmse
        for seed in benchmark_seeds(0, episodes)
    ]


def rows(results: Mapping[tuple[Any, ...], list[float]]) -> list[dict[str, Any]]:
    """Return a row for each effect, task and scenario: mean RMSE (m) by model, and the change from
    the declared to the amended one with its 95 % interval.
    """
    out = []
    for name, _, task, scenario, count in [k for k in results if k[1] == "declared"]:
        rmse = {m: np.array(results[name, m, task, scenario, count]) for m in MODELS}
        pair = rmse["amended"][None], rmse["declared"][None]
        interval = hierarchical_bootstrap(relative_change, *pair)
        out.append(
            {
                "effect": name,
                "task": task,
                "scenario": scenario,
                "episodes": count,
                **{f"{m}_m": float(f"{x.mean():.4g}") for m, x in rmse.items()},
                "change": float(f"{relative_change(*pair):.3g}"),
                "change_ci95": [float(f"{x:.3g}") for x in interval],
            }
        )
    return out


def shown() -> list[dict[str, Any]]:
    """Return the kept rows, each with how far the amended model's RMSE is from the exact one's."""
    found: list[dict[str, Any]] = kept(RESULTS)
    return [{**x, "off_exact": abs(x["amended_m"] / x["exact_m"] - 1.0)} for x in found]


def study(
    episodes: Annotated[int, typer.Option(min=2, help="In each world.")] = 20,
    jobs: Jobs = 1,
    out: Annotated[Path, typer.Option(help="Folder of what is done.")] = Path(
        "results/closed_loop"
    ),
) -> None:
    """Fly, and keep the rows of the table."""
    wanted = [
        (name, model, task, scenario, episodes)
        for name in EFFECTS
        for task in TASKS
        for scenario in SCENARIOS
        for model in MODELS
    ]
    done = run_tasks(flown, wanted, out / "flown.jsonl", jobs, code_stamp("closed_loop"))
    write_json(rows(done), DOCS / RESULTS)
    print(DOCS / RESULTS)


if __name__ == "__main__":
    start(study)
