"""Episodes of laws, here and in another simulator, as figures."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from windwrench.envs.wind_tasks import WindHoverEnv
from windwrench.evaluation.episodes import TRANSIENT, Episode, fly_episode

from .flight import WindHoverElsewhere
from .peers import PEERS, VEHICLES, vehicle_of
from .pilots import pilot_of

HERE = "here"  # the kit's own plant


@cache
def _world(place: str, simulator: str, arguments: tuple[tuple[str, Any], ...]) -> Any:
    given = dict(arguments)
    if place == HERE:
        return WindHoverEnv(vehicle=vehicle_of(VEHICLES[simulator]), **given)
    return WindHoverElsewhere(PEERS[place](), **given)


def fly(
    place: str, simulator: str, law: str, folder: str, first: int, count: int
) -> list[dict[str, Any]]:
    """Return the figures of a law's episodes: at ``HERE`` with the simulator's vehicle, or in it.

    ``force`` is the RMS error (N) of the estimated force against the applied one after 3 s.
    """
    pilot = pilot_of(law, vehicle_of(VEHICLES[simulator]), Path(folder))
    env = _world(place, simulator, tuple(getattr(pilot, "arguments", {}).items()))
    return [_figures(fly_episode(env, pilot, first + i)) for i in range(count)]


def _figures(flown: Episode) -> dict[str, Any]:
    settled = flown.time > TRANSIENT
    error = np.sum((flown.estimate[settled, :3] - flown.force[settled]) ** 2, axis=1)
    applied = np.sum(flown.force[settled] ** 2, axis=1)
    return {
        "seed": flown.seed,
        "rmse": flown.rmse_settled,
        "lost": flown.lost,
        "force": float(np.sqrt(np.mean(error))) if len(error) else float("nan"),
        "applied": float(np.sqrt(np.mean(applied))) if len(applied) else float("nan"),
    }
