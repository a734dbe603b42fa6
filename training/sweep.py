"""A sweep: many training runs, on one machine or spread over several with Ray.

Every run is the same run wherever it is done: its seed fixes it, and it goes on from its own
checkpoint when the machine or process that did it is lost. On a cluster of several machines the
results' folder must lie where all of them see it.
"""

import itertools
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from ..runtime.errors import InputError
from ..runtime.workers import every
from .configuration import Config, load_config


@dataclass(frozen=True)
class Job:
    """One training run of a sweep."""

    name: str  # of its folder
    config: Config
    scenario: str
    seed: int


def jobs_of(
    algorithm: str,
    scenario: str,
    seeds: Sequence[int],
    overrides: Sequence[str],
    search: Sequence[str],
    file: Path | None = None,
) -> list[Job]:
    """Return the runs of a sweep: every combination of the values searched, with every seed.

    Args:
        algorithm: of the runs.
        scenario: scenario or tier.
        seeds: of the runs.
        overrides: ``KEY=VALUE``, the same for all.
        search: ``KEY=VALUE|VALUE|...``.
        file: a configuration file.

    Raises:
        InputError: a key or value that does not exist, or nothing to choose from.
    """
    axes = []
    for text in search:
        key, equals, values = text.partition("=")
        choices = [v for v in values.split("|") if v.strip()]
        if not equals or len(choices) < 2:
            raise InputError(
                f"--search {text}: expected KEY=VALUE|VALUE|..., such as "
                f"learner.gamma=0.9|0.95|0.98"
            )
        axes.append([f"{key}={value.strip()}" for value in choices])
    jobs = []
    for chosen in itertools.product(*axes):
        config = load_config(algorithm, [*overrides, *chosen], file)
        label = "".join(f"{_words(setting)}-" for setting in chosen)
        jobs += [Job(f"{label}seed-{seed}", config, scenario, seed) for seed in seeds]
    return jobs


def _words(setting: str) -> str:
    """Return a setting as part of a folder's name."""
    key, _, value = setting.partition("=")
    return f"{key.rpartition('.')[2]}-{'-'.join(re.findall(r'[A-Za-z0-9_.]+', value))}"


def run_job(job: Job, folder: Path) -> dict[str, Any]:
    """Do one run in its folder, or go on with it; return what it was worth."""
    from .run import read_progress
    from .train import train

    path = train(job.config, job.scenario, job.seed, folder / job.name)
    done = read_progress(folder / job.name)
    assert done is not None
    return {
        "run": job.name,
        "policy": str(path),
        "validation_rmse_m": done.best_rmse,
        "seconds": done.seconds,
    }


def run_jobs(
    jobs: Sequence[Job],
    folder: Path,
    address: str | None = None,
    work: Callable[..., dict[str, Any]] = run_job,
    advance: Callable[[], None] = lambda: None,
) -> list[dict[str, Any]]:
    """Do the runs of a sweep; return the result of each, in their order.

    On a cluster a run whose process or machine is lost goes on elsewhere, from its last checkpoint.

    Args:
        jobs: of ``jobs_of``.
        folder: of the results, which every machine sees.
        address: of a Ray cluster; None: this process does one run after the other.
        work: does one run; called with the run and ``folder``.
        advance: called after each run.

    Raises:
        InputError: as ``runtime.workers.every``.
    """
    do = partial(work, folder=folder if address is None else folder.resolve())
    here = ((job, do(job)) for job in jobs)
    found = {}
    for job, one in here if address is None else every(do, jobs, cluster=address):
        found[job.name] = one
        advance()
    return [found[job.name] for job in jobs]
