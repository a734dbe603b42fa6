"""The benchmark of all tasks: controllers flown through the same episodes."""

import os
from collections.abc import Callable, Iterable, Sequence

from ..controllers.registry import STANDARD_TASK
from ..envs.scenarios import find_scenario
from ..runtime.errors import InputError
from ..runtime.workers import every
from .episodes import Episode, benchmark_seeds, fly_episode
from .tasks import TASKS, make_pilot, task_of

_CHUNK = 5  # episodes of a worker at a time
_SEEDS = 2**32  # bound of a benchmark's seeds

Results = dict[tuple[str, str], list[Episode]]  # by controller and scenario
Chunk = tuple[str, str, str, tuple[int, ...]]  # task, controller, scenario, seeds


def check_request(
    controllers: Sequence[str],
    scenarios: Sequence[str],
    episodes: int,
    seed: int,
    task: str = STANDARD_TASK,
) -> None:
    """Check a request for ``fly_all``, before any flight.

    Raises:
        InputError: an unknown name, no episodes, or a seed out of range.
    """
    known = task_of(task)
    if episodes < 1:
        raise InputError(f"benchmark: --episodes must be at least 1, got {episodes}")
    if not 0 <= seed < _SEEDS:
        raise InputError(f"benchmark: --seed must lie between 0 and {_SEEDS - 1}, got {seed}")
    for name in controllers:
        make_pilot(name, task)
    for name in scenarios:
        find_scenario(name, known.environment.scenarios)


def count_flights(
    controllers: Sequence[str], scenarios: Sequence[str], episodes: int, task: str = STANDARD_TASK
) -> int:
    """Return the number of episodes of ``fly_all``."""
    return len(task_of(task).references(controllers)) * len(set(scenarios)) * episodes


def fly_all(
    controllers: Sequence[str],
    scenarios: Sequence[str],
    episodes: int,
    seed: int,
    jobs: int | None = None,
    advance: Callable[[int], None] = lambda count: None,
    cluster: str | None = None,
    task: str = STANDARD_TASK,
) -> Results:
    """Fly every controller, and the references, through every scenario on the same seeds.

    Args:
        controllers: names, of trained policies too, or their paths, or FILE.py:CLASS.
        scenarios: names, or paths of YAML files.
        episodes: a scenario.
        seed: the benchmark's.
        jobs: processes, without a change of the results; default: one a core.
        advance: called with the number of episodes flown since the last call.
        cluster: address of a Ray cluster, or ``local`` for a new one on this machine; default:
            none.
        task: one of ``TASKS``.

    Raises:
        InputError: as ``check_request``.
    """
    check_request(controllers, scenarios, episodes, seed, task)
    wanted, worlds = task_of(task).references(controllers), dict.fromkeys(scenarios)
    seeds = tuple(benchmark_seeds(seed, episodes))
    chunks = [
        (task, controller, scenario, seeds[i : i + _CHUNK])
        for scenario in worlds
        for controller in wanted
        for i in range(0, episodes, _CHUNK)
    ]
    # one episode first, for an early count
    first = chunks[0]
    chunks[:1] = [(*first[:3], part) for part in (first[3][:1], first[3][1:]) if part]
    flown: dict[Chunk, list[Episode]] = {}
    for chunk, some in _flown(chunks, jobs, cluster):
        flown[chunk] = some
        advance(len(some))
    results: Results = {(name, scenario): [] for scenario in worlds for name in wanted}
    for chunk in chunks:
        results[chunk[1], chunk[2]].extend(flown[chunk])
    return results


def _flown(
    chunks: list[Chunk], jobs: int | None, cluster: str | None
) -> Iterable[tuple[Chunk, list[Episode]]]:
    """Yield each chunk with its episodes, as they come."""
    jobs = min(jobs or os.cpu_count() or 1, len(chunks))
    if jobs == 1 and cluster is None:
        return ((chunk, _fly_chunk(chunk)) for chunk in chunks)
    if cluster is None:
        task, _, scenario, _ = chunks[0]
        TASKS[task].environment(scenario).reset(seed=0)  # compiles, once for all processes
    return every(_fly_chunk, chunks, None if cluster else jobs, cluster)


def _fly_chunk(chunk: Chunk) -> list[Episode]:
    task, name, scenario, seeds = chunk
    known, pilot = TASKS[task], make_pilot(name, task)
    env = known.environment(scenario)
    return [fly_episode(env, pilot, seed) for seed in seeds]
