"""How far a measured profile and its law are to be trusted: fans unknown to the kit's defaults.

Each fan has a drawn strength, radius and distance. A vehicle flies hovers on a line, or slow
sweeps, through its jet; ``profile_log`` reads the log. Counted are: places of the true mean jet
within the 95 % intervals; the designed law's error beside the default one's on the same episodes;
and how many flights follow fans slower and faster than the stated fastest one.

``python -m evidence.profiled_fans --fans 12 --episodes 40 --out FILE.json``
"""

import argparse
import json
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..controllers.fan_laws import Admittance
from ..dynamics.vehicle import Vehicle
from ..dynamics.vehicle_file import load_vehicle
from ..envs.fan import Fan
from ..envs.fan_tracking import FanTrackingEnv
from ..envs.plant import PlantSettings
from ..envs.recording import record_flight
from ..envs.scenarios import SCENARIOS, Variation
from ..evaluation.episodes import benchmark_seeds, fly_episode
from ..evaluation.statistics import episode_bootstrap, interval_of
from ..identification.logs.flight_log import FlightLog
from ..identification.profile_law import ProfiledJet, profile_log
from ..identification.wind_profile import WindProfile
from ..reproduction.calm_jet import calm_jet

Array = NDArray[np.float64]

FIRST_SEED = 68_000  # of fans and recordings
SECONDS = 250.0  # of a recorded flight
KINDS = ("hovers", "sweep")
# ranges of the drawn fans: m/s, m, m
SPEED, RADIUS, DISTANCE = (2.9, 5.2), (0.33, 0.6), (1.8, 2.8)
SHARES = (0.7, 0.85, 1.0, 1.15, 1.3)  # of the stated fastest fan


def drawn_fan(seed: int) -> tuple[Fan, float]:
    """Return a fan unknown to the kit's defaults, and its distance in m."""
    rng = np.random.default_rng(seed)
    return Fan(speed=rng.uniform(*SPEED), radius=rng.uniform(*RADIUS)), rng.uniform(*DISTANCE)


def true_profile(fan: Fan, vehicle: Vehicle, profile: WindProfile) -> Array:
    """Return force and torque (6, n) of the mean jet on the line of a profile, in its parts."""
    way = np.array([math.cos(profile.direction), math.sin(profile.direction)])
    wind = np.array([way[1], -way[0]])
    x, y = (profile.place[:, None] * way + profile.beside * wind).T
    wrench = calm_jet(fan, vehicle, x, y)
    turn = np.vstack([np.append(wind, 0.0), np.append(way, 0.0), [0.0, 0.0, 1.0]])
    return np.hstack([wrench[:, :3] @ turn.T, wrench[:, 3:] @ turn.T]).T


def recorded(
    fan: Fan, distance: float, kind: str, seed: int, seconds: float = SECONDS
) -> FlightLog:
    """Return the log of a flight through a fan's jet, with the disturbances of the tasks."""
    vehicle = load_vehicle("ardrone2")
    settings = PlantSettings.for_vehicle(vehicle)
    columns: dict[str, Any] = record_flight(
        vehicle, (), kind, seconds, seed, settings=settings, fan=fan, distance=distance
    )
    return FlightLog(**columns, name=f"{kind} {seed}")


def make_env(fan: Fan, distance: float, rise_time: float = 0.45) -> FanTrackingEnv:
    """Return the task in front of a fan at a distance."""
    one = (1.0, 1.0)
    fixed = Variation(
        distance=(distance, distance),
        fan_speed=one,
        rotor_drag=one,
        hull_area=one,
        mass=one,
        inertia=one,
    )
    base = replace(SCENARIOS["base"], varied=True, variation=fixed, rise_time=rise_time)
    return FanTrackingEnv(base, fan=fan)


def follows(env: FanTrackingEnv, law: Any, speed: float, seed: int, reach: Array) -> bool:
    """Return whether a law keeps the vehicle within ``reach`` (2,) m of the axis for 20 s, behind a
    fan of a steady speed.
    """
    signed = speed * (-1.0) ** seed
    env.fan_path = lambda t: signed * t
    observation, _ = env.reset(seed=seed)
    for _ in range(env.decisions()):
        observation, _, lost, _, info = env.step(law(observation))
        if lost or not reach[0] <= info["offset"] <= reach[1]:
            return False
    return True


def study(seed: int, kind: str, episodes: int) -> dict[str, Any]:
    """Return the figures of one fan."""
    fan, distance = drawn_fan(seed)
    vehicle = load_vehicle("ardrone2")
    found = profile_log(recorded(fan, distance, kind, seed), vehicle)
    p = found.profile
    true = true_profile(fan, vehicle, p)
    inside = np.mean((true > p.low) & (true < p.high), axis=1)
    row: dict[str, Any] = {
        "seed": seed,
        "kind": kind,
        "speed": fan.speed,
        "radius": fan.radius,
        "distance": distance,
        "coverage_force": float(inside[0]),
        "coverage_torque": float(inside[5]),
        "why": found.why,
    }
    return row | (_flown(found, fan, distance, episodes) if found.law and episodes else {})


def _flown(found: ProfiledJet, fan: Fan, distance: float, episodes: int) -> dict[str, Any]:
    assert found.law is not None
    assert found.shape is not None
    law, env = Admittance(found.law["gain"]), make_env(fan, distance)
    fastest = found.law["fastest_fan_m_s"]
    seeds = benchmark_seeds(68, episodes)
    reach = np.array(found.shape.edges) - found.shape.axis
    own, default = (
        [fly_episode(env, one, seed).rmse for seed in seeds] for one in (law, Admittance())
    )
    held = [
        sum(follows(env, law, share * fastest, seed, reach) for seed in seeds) for share in SHARES
    ]
    difference = np.array(own) - np.array(default)
    return {
        "law": found.law,
        "rmse": float(np.mean(own)),
        "rmse_default": float(np.mean(default)),
        "rmses": own,
        "rmses_default": default,
        "difference_ci95": episode_bootstrap(lambda x: x.mean(axis=(-2, -1)), difference),
        "held": held,
        "episodes": episodes,
    }


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return the figures over all fans; fans are drawn anew for the intervals."""
    rng = np.random.default_rng(0)

    def over_fans(values: Sequence[float]) -> dict[str, Any]:
        x = np.array(values)
        means = x[rng.integers(len(x), size=(2000, len(x)))].mean(axis=1)
        return {"mean": float(x.mean()), "ci95": interval_of(means), "fans": len(x)}

    flown = [row for row in rows if "rmse" in row]
    return {
        **{
            f"coverage_{part}_{kind}": over_fans(
                [row[f"coverage_{part}"] for row in rows if row["kind"] == kind]
            )
            for part in ("force", "torque")
            for kind in KINDS
            if any(row["kind"] == kind for row in rows)
        },
        "laws": len([row for row in rows if not row["why"]]),
        "relative_rmse": over_fans([row["rmse"] / row["rmse_default"] - 1.0 for row in flown]),
        "held_share": {
            f"{share:g}": over_fans([row["held"][i] / row["episodes"] for row in flown])
            for i, share in enumerate(SHARES)
        },
        "follows_the_stated": sum(row["held"][1] >= 0.8 * row["episodes"] for row in flown),
        "loses_the_faster": sum(row["held"][3] < 0.8 * row["episodes"] for row in flown),
        "flown": len(flown),
    }


def main() -> None:
    """Fly the study and write its figures."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fans", type=int, default=12)
    parser.add_argument("--first", type=int, default=FIRST_SEED)
    parser.add_argument("--episodes", type=int, default=40)
    parser.add_argument("--out", type=Path, default=Path("results/profiled_fans.json"))
    given = parser.parse_args()
    rows = []
    for i in range(given.fans):
        rows.append(study(given.first + i, KINDS[i % 2], given.episodes))
        row = {key: value for key, value in rows[-1].items() if not key.startswith("rmses")}
        print(json.dumps(row), flush=True)
    figures = summary(rows) if given.episodes else {}
    given.out.parent.mkdir(parents=True, exist_ok=True)
    given.out.write_text(json.dumps({"summary": figures, "fans": rows}, indent=1) + "\n")
    print(json.dumps(figures, indent=1))


if __name__ == "__main__":
    main()
