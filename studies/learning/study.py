"""The study behind the leaderboard: policies trained, everything scored on the same test episodes,
step by step.

Each step leaves a file, and a step whose file is there is not done again: a study that was stopped
goes on where it was.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from windwrench import __version__
from windwrench.controllers import Limit
from windwrench.controllers.flight_response import half_response
from windwrench.controllers.trained_policy import TrainedPolicy, load_policy, save_policy
from windwrench.dynamics.effects import parse_setting
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.envs.watched_fan_tracking import scenario_env
from windwrench.evaluation.episodes import benchmark_seeds, fly_episode
from windwrench.evaluation.tasks import make_pilot
from windwrench.runtime.errors import InputError, unknown_name
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit
from windwrench.runtime.workers import Lost, each
from windwrench.studies.pages import DOCS, ROOT
from windwrench.training.configuration import load_config
from windwrench.training.train import Progress, read_progress

_MOST_SECONDS = 24 * 3600.0  # of an entry


@dataclass(frozen=True)
class Entry:
    """One line of the study: a policy of one seed, or a hand-designed controller
    (``seed`` None).
    """

    name: str
    group: str  # designed, learned or ablation
    worlds: tuple[str, ...]
    seed: int | None = None
    algorithm: str = ""
    scenario: str = ""
    overrides: tuple[str, ...] = ()
    ship: bool = False

    @property
    def file(self) -> str:
        """Name of its files."""
        words = "".join(c if c.isalnum() or c in "._-" else "-" for c in self.name)
        return words if self.seed is None else f"{words}-{self.seed}"


@dataclass(frozen=True)
class Places:
    """Where a study keeps what."""

    runs: Path  # training runs, with checkpoints; large, and of no use once a policy is scored
    results: Path  # a small JSON file for each entry
    policies: Path  # the policies that are shipped


KEPT = Places(
    Path("results/leaderboard"), DOCS / "results" / "learning", ROOT / "training" / "policies"
)


def load_plan(file: Path | None = None) -> dict[str, Any]:
    """Return the plan of the study: ``study.yaml``, or a file like it.

    Raises:
        InputError: the file is missing or not of this form.
    """
    source = Path(__file__).with_name("study.yaml") if file is None else file
    try:
        plan = yaml.safe_load(source.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InputError(f"{source}: cannot be read as a study's plan: {error}") from error
    missing = {"worlds", "episodes", "designed", "learned", "ablation"} - set(
        plan if isinstance(plan, dict) else ()
    )
    if missing:
        raise InputError(f"{source}: a study's plan needs {', '.join(sorted(missing))} as well")
    return dict(plan)


def entries_of(plan: Mapping[str, Any], only: Sequence[str] = ()) -> list[Entry]:
    """Return the lines of a study, in the order in which they are done: seed by seed.

    Args:
        plan: of ``load_plan``.
        only: names of lines, groups, or single seeds such as sac-0; default: all.

    Raises:
        InputError: ``only`` names something that is not in the plan.
    """
    worlds = tuple(plan["worlds"])
    entries = [Entry(name, "designed", worlds) for name in plan["designed"]]
    for name, one in plan["learned"].items():
        entries += [
            Entry(
                name,
                "learned",
                worlds,
                seed,
                one["algorithm"],
                one["scenario"],
                tuple(one.get("set", ())),
                bool(one.get("ship")),
            )
            for seed in range(one["seeds"])
        ]
    ablation = plan["ablation"]
    changes = {ablation["reference"]: [], **ablation["changes"]} if ablation else {}
    for name, extra in changes.items():
        entries += [
            Entry(
                name,
                "ablation",
                tuple(ablation["worlds"]),
                seed,
                ablation["algorithm"],
                ablation["scenario"],
                (*ablation["set"], *extra),
            )
            for seed in range(ablation["seeds"])
        ]
    known = (
        {e.name for e in entries} | {e.file for e in entries} | {"designed", "learned", "ablation"}
    )
    for name in only:
        if name not in known:
            raise unknown_name("part of the study", name, known, "--only")
    return [e for e in entries if not only or e.name in only or e.group in only or e.file in only]


def result_path(entry: Entry, places: Places) -> Path:
    """Return where an entry's result is kept."""
    return places.results / f"{entry.file}.json"


def is_done(entry: Entry, plan: Mapping[str, Any], places: Places) -> bool:
    """Whether an entry is trained and scored in all its worlds."""
    path = result_path(entry, places)
    if not path.exists():
        return False
    kept = json.loads(path.read_text(encoding="utf-8"))
    return all(
        len(kept["scores"].get(world, {}).get("rmse_m", ())) >= plan["episodes"]
        for world in entry.worlds
    )


def missing_of(plan: Mapping[str, Any], places: Places) -> list[str]:
    """Return the files of the entries that are not done."""
    return [entry.file for entry in entries_of(plan) if not is_done(entry, plan, places)]


def train_entry(entry: Entry, places: Places) -> tuple[Path, Progress]:
    """Train an entry's policy, or take up its training where it was left; return the best policy
    and how it went.
    """
    assert entry.seed is not None
    folder = places.runs / entry.file
    config = load_config(entry.algorithm, entry.overrides)
    done = read_progress(folder)
    if done is None or not done.steps or done.steps[-1] < config["steps"]:
        from windwrench.training.algorithms import run_training

        run_training(config, entry.scenario, entry.seed, folder)
        done = read_progress(folder)
    assert done is not None
    return folder / "best.npz", done


def fly_world(
    pilot: Any, world: Mapping[str, Any], seeds: Sequence[int]
) -> Iterator[tuple[float, bool, float | None]]:
    """Yield RMSE (m) of the offset and whether the vehicle was lost, for each seed in a world of
    the plan; and for the pilot ``limit`` the root mean square (m) of how uncertain the fan's place
    was when a command given now is carried out by half.
    """
    ahead, uncertain = half_response(), []

    def note(info: Mapping[str, Any]) -> None:
        if isinstance(pilot, Limit):
            uncertain.append(pilot.deviation_ahead(ahead))

    effects = [parse_setting(text) for text in world.get("effects", ())]
    if effects or "estimator" in world:
        env = FanTrackingEnv(
            world["scenario"], effects=effects, estimator=world.get("estimator", "ukf")
        )
    else:
        env = scenario_env(
            world["scenario"],
            pilot.features.sources if isinstance(pilot, TrainedPolicy) else frozenset(),
        )
    for seed in seeds:
        uncertain.clear()
        episode = fly_episode(env, pilot, seed, note)
        bound = float(np.sqrt(np.mean(np.square(uncertain)))) if uncertain else None
        yield episode.rmse, episode.lost, bound


def do_entry(entry: Entry, plan: Mapping[str, Any], places: Places) -> None:
    """Train and score one entry, as far as that is not done; its result grows world by world."""
    path = result_path(entry, places)
    result: dict[str, Any] = {
        "name": entry.name,
        "group": entry.group,
        "seed": entry.seed,
        "commit": commit(),
        "version": __version__,
        "scores": {},
    }
    if entry.seed is None:
        pilot = make_pilot(entry.name)
    else:
        shipped = places.policies / f"{entry.file}.npz"
        if entry.ship and shipped.exists() and path.exists():
            pilot = load_policy(shipped)
        else:
            best, progress = train_entry(entry, places)
            pilot = load_policy(best)
            if entry.ship:
                save_policy(
                    {k: v for k, v in pilot.card.items() if k != "sha256"}, pilot.weights, shipped
                )
            result["training"] = {
                "steps": progress.steps,
                "rmse_m": progress.rmse_m,
                "lost": progress.lost,
                "best": progress.best,
                "seconds": round(progress.seconds, 1),
            }
        result |= {
            "algorithm": entry.algorithm,
            "scenario": entry.scenario,
            "overrides": list(entry.overrides),
            "sha256": pilot.card["sha256"],
        }
    if path.exists():
        kept = json.loads(path.read_text(encoding="utf-8"))
        if kept.get("sha256") == result.get(
            "sha256"
        ):  # else the scores are those of another policy
            result = {**kept, **result, "scores": kept["scores"]}
    for name in entry.worlds:
        if len(result["scores"].get(name, {}).get("rmse_m", ())) >= plan["episodes"]:
            continue
        rmse, lost, bounds = [], [], []
        for value, gone, bound in fly_world(
            pilot, plan["worlds"][name], benchmark_seeds(0, plan["episodes"])
        ):
            rmse.append(round(value, 6))
            lost.append(int(gone))
            bounds += [round(bound, 6)] if bound is not None else []
        result["scores"][name] = {"rmse_m": rmse, "lost": lost}
        if bounds:
            result["scores"][name]["bound_m"] = bounds
        write_json(result, path)


def read_results(places: Places) -> list[dict[str, Any]]:
    """Return all results that there are."""
    found = [
        json.loads(p.read_text(encoding="utf-8")) for p in sorted(places.results.glob("*.json"))
    ]
    return [r for r in found if isinstance(r, dict) and "scores" in r]


def run_study(
    entries: Sequence[Entry], plan: Mapping[str, Any], places: Places, jobs: int = 1
) -> int:
    """Train and score entries that are not done yet, in ``jobs`` processes; return how many entries
    that were.

    Args:
        entries: of ``entries_of``.
        plan: of ``load_plan``.
        places: where everything is kept.
        jobs: processes.

    Raises:
        InputError: what training or scoring refuses.
    """
    waiting = [e for e in entries if not is_done(e, plan, places)]
    work = partial(do_entry, plan=plan, places=places)
    for count, (entry, result) in enumerate(each(work, waiting, _MOST_SECONDS, jobs), 1):
        if isinstance(result, Lost):
            raise InputError(f"{entry.file}: {result.words}; run the study again")
        print(f"{entry.file}: {count} of {len(waiting)}", flush=True)
    return len(waiting)
