"""Work done by processes that stay warm, of which none may take the others with it.

Each worker has a process of its own: one that dies (out of memory, a crash in C) or takes too long
costs its own task alone, and another takes its place. The processes are this machine's, or actors
of a Ray cluster; both give futures, so one loop serves both.
"""

import multiprocessing
import os
import signal
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Generic, Protocol, TypeVar

from .cluster import connected
from .workers import end_with_parent, one_process

T = TypeVar("T")
R = TypeVar("R")

_FIRST_TO_GO = 500  # of 1000: where memory runs out, the system ends a worker before its parent
_PATIENCE = 5.0  # s, for the exit code of a process that is gone


@dataclass(frozen=True)
class Lost:
    """Why a task has no result: its process died, or was ended since it took too long."""

    kind: str  # died, or time
    words: str


@dataclass
class _Task(Generic[T]):
    task: T
    attempts: int = 0


class Worker(Protocol):
    """A process that does one task after the other."""

    warm: bool  # whether it has done one

    def start(self, task: Any) -> Future[Any]:
        """Begin with a task; return the future of its result."""

    def end(self) -> None:
        """End the process at once, whatever it does."""

    def last_words(self) -> str:
        """Return how the process ended, in words."""


Crew = Callable[[], Worker]  # makes one more worker


class _Process:
    """A worker on this machine."""

    def __init__(self, work: Callable[[Any], Any]) -> None:
        self._work = work
        self.warm = False
        self._process: BaseProcess | None = None
        before = {child.pid for child in multiprocessing.active_children()}
        self._pool = one_process(_prepare)
        for child in multiprocessing.active_children():
            if child.pid not in before:
                self._process = child

    def start(self, task: Any) -> Future[Any]:
        return self._pool.submit(self._work, task)

    def end(self) -> None:
        if self._process is not None:
            self._process.kill()
        self._pool.shutdown(wait=False, cancel_futures=True)

    def last_words(self) -> str:
        if self._process is None:
            return "its process died"
        self._process.join(_PATIENCE)
        latest = time.monotonic() + _PATIENCE
        # the pool waits for it as well: whoever comes second knows the code a moment later
        while (code := self._process.exitcode) is None and time.monotonic() < latest:
            time.sleep(0.01)
        if code is None or code >= 0:
            return f"its process ended with code {code}"
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        memory = ", as where memory runs out" if -code == signal.SIGKILL else ""
        return f"its process was ended by {name}{memory}"


def _prepare() -> None:
    end_with_parent()
    with suppress(OSError):  # Linux alone has it
        Path("/proc/self/oom_score_adj").write_text(str(_FIRST_TO_GO), encoding="ascii")


class _Does:
    """What a Ray actor runs."""

    def __init__(self, work: Callable[[Any], Any]) -> None:
        self._work = work

    def do(self, task: Any) -> Any:
        return self._work(task)


class _Actor:
    """A worker on a Ray cluster."""

    def __init__(self, ray: Any, work: Callable[[Any], Any]) -> None:
        self._ray = ray
        self.warm = False
        # Ray gives a worker's linear algebra as many threads as the worker has cores
        self._actor = ray.remote(num_cpus=1, max_restarts=0)(_Does).remote(work)

    def start(self, task: Any) -> Future[Any]:
        future: Future[Any] = self._actor.do.remote(task).future()
        return future

    def end(self) -> None:
        self._ray.kill(self._actor)

    def last_words(self) -> str:
        return "its process on the cluster died"


@contextmanager
def crew_of(
    work: Callable[[Any], Any], jobs: int | None = None, cluster: str | None = None
) -> Iterator[tuple[Crew, int]]:
    """Give what makes workers, and how many of them to have: one a core unless ``jobs`` says else.

    Args:
        work: what is done with a task; importable by its name.
        jobs: number of processes.
        cluster: a Ray cluster's address, or ``local`` for one on this machine; None: no Ray.

    Raises:
        InputError: as ``runtime.cluster.connected``.
    """
    if cluster is None:
        yield (lambda: _Process(work)), jobs or os.cpu_count() or 1
        return
    with connected(cluster) as ray:
        cores = int(ray.cluster_resources().get("CPU", 1))
        yield (lambda: _Actor(ray, work)), min(jobs or cores, cores)


@dataclass
class _Busy(Generic[T]):
    worker: Worker
    task: _Task[T]
    since: float = field(default_factory=time.monotonic)


def each(
    tasks: Iterable[T], crew: Crew, count: int, most_seconds: float, attempts: int = 2
) -> Iterator[tuple[T, Any]]:
    """Yield each task with its result, or with ``Lost``, as they come; tasks are taken when a
    worker is free, so that no more than ``count`` are held.

    Args:
        tasks: what is given to the work.
        crew: makes a worker.
        count: of workers at the same time.
        most_seconds: that a task may take; a worker's first one may take as much again, for the
            imports.
        attempts: at a task whose process dies, which may be its neighbour's fault; the further
            ones come last, one at a time.

    Raises:
        Exception: what the work itself raises.
    """
    coming = iter(tasks)
    again: deque[_Task[T]] = deque()
    idle: list[Worker] = []
    busy: dict[Future[Any], _Busy[T]] = {}

    def begin(task: _Task[T]) -> None:
        worker = idle.pop() if idle else crew()
        task.attempts += 1
        try:
            future = worker.start(task.task)
        except BrokenProcessPool:  # it died while it had nothing to do
            worker.end()
            worker = crew()
            future = worker.start(task.task)
        busy[future] = _Busy(worker, task)

    try:
        while True:
            while len(busy) < count and (task := next(coming, None)) is not None:
                begin(_Task(task))
            if not busy:
                if not again:
                    return
                begin(again.popleft())
            limits = {
                f: b.since + most_seconds * (1 if b.worker.warm else 2) for f, b in busy.items()
            }
            first = min(limits.values())
            done, _ = wait(busy, max(0.0, first - time.monotonic()), FIRST_COMPLETED)
            for future in done:
                one = busy.pop(future)
                error = future.exception()
                if error is None:
                    one.worker.warm = True
                    idle.append(one.worker)
                    yield one.task.task, future.result()
                elif not _is_death(error):
                    raise error
                else:
                    lost = Lost("died", one.worker.last_words())
                    one.worker.end()
                    if one.task.attempts < attempts:
                        again.append(one.task)
                    else:
                        yield one.task.task, lost
            now = time.monotonic()
            for future in [f for f, limit in limits.items() if f in busy and limit <= now]:
                one = busy.pop(future)
                one.worker.end()
                yield one.task.task, Lost("time", f"it took more than {most_seconds:g} s")
    finally:
        for worker in (*idle, *(one.worker for one in busy.values())):
            worker.end()


def _is_death(error: BaseException) -> bool:
    """Return whether an error says that the process is gone, and not what the work raised."""
    names = {kind.__name__ for kind in type(error).__mro__}
    return isinstance(error, BrokenProcessPool) or bool(
        names & {"RayActorError", "ActorDiedError", "WorkerCrashedError", "OutOfMemoryError"}
    )
