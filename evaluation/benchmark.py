"""The benchmark of all tasks: controllers flown through the same episodes."""

import itertools
import os
from collections.abc import Callable
from dataclasses import dataclass

from ..controllers.registry import STANDARD_TASK
from ..runtime.errors import InputError
from ..runtime.workers import every
from .episodes import Episode, benchmark_seeds, fly_episode
from .rewards import find_reward
from .tasks import BenchmarkTask, import_files, make_pilot, scenario_names, task_of

_CHUNK = 5  # episodes of a worker at a time
_SEEDS = 2**32  # bound of a benchmark's seeds

Results = dict[tuple[str, str], list[Episode]]  # for each controller and scenario


@dataclass(frozen=True)
class Request:
    """A benchmark.

    Attributes:
        controllers: names, of trained policies too, or their paths, YAML files of laws, or
            FILE.py:CLASS.
        scenarios: names, paths of YAML files, or FILE.py:NAME.
        episodes: a scenario.
        seed: the benchmark's.
        task: a name of ``TASKS``, a registered id, or FILE.py:NAME.
        reward: one's own, as of ``find_reward``; None: the task's.
        imports: Python files that register a task, a law, a scenario or a reward.
    """

    controllers: tuple[str, ...]
    scenarios: tuple[str, ...]
    episodes: int
    seed: int
    task: str = STANDARD_TASK
    reward: str | None = None
    imports: tuple[str, ...] = ()

    def check(self) -> BenchmarkTask:
        """Check all names, before any flight; return the task.

        Raises:
            InputError: an unknown name, no episodes, or a seed out of range.
        """
        import_files(self.imports)
        flown_task = task_of(self.task)
        if self.episodes < 1:
            raise InputError(f"benchmark: --episodes must be at least 1, got {self.episodes}")
        if not 0 <= self.seed < _SEEDS:
            raise InputError(
                f"benchmark: --seed must lie between 0 and {_SEEDS - 1}, got {self.seed}"
            )
        for name in self.controllers:
            make_pilot(name, self.task)
        scenario_names(self.scenarios, flown_task)
        if self.reward is not None:
            find_reward(self.reward)
        return flown_task

    def flights(self) -> int:
        """Return the number of episodes, those of the reference laws among them."""
        laws = task_of(self.task).references(self.controllers)
        return len(laws) * len({*self.scenarios}) * self.episodes


Chunk = tuple[Request, str, str, tuple[int, ...]]  # with controller, scenario and seeds


def fly_all(
    request: Request,
    jobs: int | None = None,
    advance: Callable[[int], None] = lambda count: None,
    cluster: str | None = None,
) -> Results:
    """Fly every controller, and the references, through every scenario on the same seeds.

    Args:
        request: the benchmark.
        jobs: processes, without a change of the results; default: one a core.
        advance: called with the number of episodes flown since the last call.
        cluster: address of a Ray cluster, or ``local`` for a new one on this machine; default:
            none.

    Raises:
        InputError: as ``Request.check``.
    """
    wanted = request.check().references(request.controllers)
    seeds = tuple(benchmark_seeds(request.seed, request.episodes))
    starts = 0, *range(1, request.episodes, _CHUNK)  # one episode first, for an early count
    chunks: list[Chunk] = [
        (request, controller, scenario, seeds[first:end])
        for scenario in dict.fromkeys(request.scenarios)
        for controller in wanted
        for first, end in itertools.pairwise((*starts, request.episodes))
    ]
    jobs = min(jobs or os.cpu_count() or 1, len(chunks))
    flown: dict[Chunk, list[Episode]] = {}
    alone = jobs == 1 and cluster is None
    for chunk, some in (
        ((chunk, _fly_chunk(chunk)) for chunk in chunks)
        if alone
        else every(_fly_chunk, chunks, None if cluster else jobs, cluster)
    ):
        flown[chunk] = some
        advance(len(some))
    results: Results = {}
    for chunk in chunks:
        results.setdefault(chunk[1:3], []).extend(flown[chunk])
    return results


def _fly_chunk(chunk: Chunk) -> list[Episode]:
    request, name, scenario, seeds = chunk
    import_files(request.imports)
    pilot = make_pilot(name, request.task)
    env = task_of(request.task).make(
        scenario, request.reward, observation=getattr(pilot, "observation", None)
    )
    return [fly_episode(env, pilot, seed) for seed in seeds]
