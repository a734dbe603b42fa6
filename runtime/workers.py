"""Worker processes, of this machine or of a Ray cluster. They end with the work, and with their
parent process. A death or a timeout of a worker costs its own task alone.
"""

import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from .cluster import connected
from .errors import InputError
from .threads import one_thread

T = TypeVar("T")
R = TypeVar("R")

# for new processes: forked workers would share the locks of linear algebra
SPAWNED = multiprocessing.get_context("spawn")
_FIRST_TO_GO = 500  # of 1000: without memory, the system ends a worker before its parent
_LOOK = 0.2  # s between two checks of the time and calls of ``idle``
_ATTEMPTS = 4  # at a task of ``every``


def end_with_parent() -> None:
    """Have this process end as soon as its parent process is gone, even if killed.

    For the initializer of any pool: a killed parent tells its workers nothing, and they would wait
    for ever.
    """
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, name="parent watch", daemon=True).start()
    with suppress(OSError):  # Linux alone has it
        Path("/proc/self/oom_score_adj").write_text(str(_FIRST_TO_GO), encoding="ascii")


@dataclass(frozen=True)
class Lost:
    """Why a task has no result: its process died, or was ended after too long a time."""

    kind: str  # died, or time
    words: str


class _Worker:
    """One process, alone in its pool: no other task is lost with it."""

    def __init__(self, work: Callable[[Any], Any]) -> None:
        self._work = work
        self._pool = ProcessPoolExecutor(1, SPAWNED, end_with_parent)
        others = {child.pid for child in multiprocessing.active_children()}
        # threads and processes started in the block see no interrupt: the parent answers key
        # presses
        with interrupts_blocked():
            self._ready = self._pool.submit(callable, work)  # imports the work's modules
            new = (c for c in multiprocessing.active_children() if c.pid not in others)
            self._process = next(new, None)

    def start(self, task: Any) -> Future[Any]:
        """Start a task.

        Raises:
            BrokenProcessPool: the process is gone.
        """
        future = self._pool.submit(self._work, task)
        self._begun = time.monotonic()
        return future

    def seconds(self) -> float:
        """Return how long the task has run; the start of the process does not count."""
        if not self._ready.done():
            self._begun = time.monotonic()
        return time.monotonic() - self._begun

    def end(self) -> int | None:
        """End the process at once, even in a task; return its exit code."""
        if self._process is not None:
            self._process.kill()
        self._pool.shutdown(cancel_futures=True)  # waits for the process
        return None if self._process is None else self._process.exitcode


class _Local:
    """Tasks on processes of this machine, each with one thread of linear algebra; dead processes
    are replaced.
    """

    def __init__(self, work: Callable[[Any], Any], count: int) -> None:
        self.count = count
        self._work = work
        self._resting: list[_Worker] = []
        self._busy: dict[Future[Any], _Worker] = {}

    def start(self, task: Any) -> Future[Any]:
        worker = self._resting.pop() if self._resting else _Worker(self._work)
        try:
            future = worker.start(task)
        except BrokenProcessPool:  # died without a task
            worker.end()
            return self.start(task)
        self._busy[future] = worker
        return future

    def wait(self, seconds: float | None) -> set[Future[Any]]:
        """Return the tasks that are done, once there is one or the time is over."""
        return wait(self._busy, seconds, FIRST_COMPLETED).done

    def seconds(self, future: Future[Any]) -> float:
        return self._busy[future].seconds()

    def stop(self, future: Future[Any]) -> None:
        self._busy.pop(future).end()

    def death(self, future: Future[Any]) -> str | None:
        """Return in words how the process of a finished task ended; None if the process lives."""
        worker = self._busy.pop(future)
        if not isinstance(future.exception(), BrokenProcessPool):
            self._resting.append(worker)
            return None
        code = worker.end()
        if code is None or code >= 0:
            return f"its process ended with code {code}"
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        memory = ", as where memory runs out" if -code == signal.SIGKILL else ""
        return f"its process was ended by {name}{memory}"

    def end(self) -> None:
        """End the processes at once, whatever they do."""
        for worker in (*self._busy.values(), *self._resting):
            worker.end()


class _OnCluster:
    """Tasks on a Ray cluster, one a core."""

    def __init__(
        self, ray: Any, address: str, work: Callable[[Any], Any], jobs: int | None
    ) -> None:
        cores = int(ray.cluster_resources().get("CPU", 1))
        self.count = min(jobs or cores, cores)
        self._ray, self._address = ray, address
        self._running: dict[Future[Any], tuple[Any, float]] = {}  # Ray's reference, start (s)

        def task_of_windwrench(task: Any) -> Any:  # Ray takes no partial function
            return work(task)

        # Ray gives a worker's linear algebra as many threads as the worker has cores
        self._work = ray.remote(num_cpus=1, max_retries=0)(task_of_windwrench)

    def start(self, task: Any) -> Future[Any]:
        future: Future[Any] = Future()
        self._running[future] = self._work.remote(task), time.monotonic()
        return future

    def wait(self, seconds: float | None) -> set[Future[Any]]:
        """Ask Ray, always from this thread: another thread that asks, or drops a reference, during
        Ray's shutdown ends the whole process.
        """
        futures = {reference: future for future, (reference, _) in self._running.items()}
        for reference in self._ray.wait(list(futures), timeout=seconds)[0]:
            future = futures[reference]
            try:
                future.set_result(self._ray.get(reference))
            except self._ray.exceptions.RayTaskError as error:
                reason = str(error.cause).partition("\n")[0]
                words = f"--cluster {self._address}: a task failed: {reason}"
                future.set_exception(InputError(words))
            except self._ray.exceptions.RayError as error:
                future.set_exception(error)
        return {future for future in self._running if future.done()}

    def seconds(self, future: Future[Any]) -> float:
        return time.monotonic() - self._running[future][1]

    def stop(self, future: Future[Any]) -> None:
        self._ray.cancel(self._running.pop(future)[0], force=True)

    def death(self, future: Future[Any]) -> str | None:
        """Return in words how the process of a finished task ended; None if the process lives."""
        del self._running[future]
        died = isinstance(future.exception(), self._ray.exceptions.RayError)
        return "its process on the cluster died" if died else None

    def end(self) -> None:
        """Leave the rest to Ray: a task ends with its program."""
        self._running.clear()


def each(
    work: Callable[[T], Any],
    tasks: Iterable[T],
    most_seconds: float | None = None,
    jobs: int | None = None,
    cluster: str | None = None,
    attempts: int = 2,
    idle: Callable[[], None] | None = None,
) -> Iterator[tuple[T, Any]]:
    """Yield each task with its result, or with ``Lost``, as they come. A task is taken when a
    worker is free: at most one a worker is held.

    Args:
        work: function of a task; importable by its name.
        tasks: arguments of the work.
        most_seconds: the longest time of a task; None: any time.
        jobs: number of processes; default: one a core.
        cluster: a Ray cluster's address, or ``local`` for one on this machine; None: no Ray.
        attempts: at a task where its process dies; the further ones come last, one at a time.
        idle: called a few times a second while all wait.

    Raises:
        InputError: as ``runtime.cluster.connected``, or the work fails on a cluster.
        Exception: any error of the work itself.
    """
    with one_thread() if cluster is None else connected(cluster) as ray:
        crew: _Local | _OnCluster = (
            _Local(work, jobs or os.cpu_count() or 1)
            if cluster is None
            else _OnCluster(ray, cluster, work, jobs)
        )
        coming = iter(tasks)
        again: deque[tuple[T, int]] = deque()
        running: dict[Future[Any], tuple[T, int]] = {}
        look = None if most_seconds is None and idle is None else _LOOK
        try:
            while True:
                while len(running) < crew.count and (task := next(coming, None)) is not None:
                    running[crew.start(task)] = task, 1
                if not running:
                    if not again:
                        return
                    task, attempt = again.popleft()
                    running[crew.start(task)] = task, attempt + 1
                for future in crew.wait(look):
                    task, attempt = running.pop(future)
                    words = crew.death(future)
                    if words is None:
                        yield task, future.result()
                    elif attempt < attempts:
                        again.append((task, attempt))
                    else:
                        yield task, Lost("died", words)
                if most_seconds is not None:
                    for future in [f for f in running if crew.seconds(f) > most_seconds]:
                        crew.stop(future)
                        task, _ = running.pop(future)
                        yield task, Lost("time", f"it took more than {most_seconds:g} s")
                if idle:
                    idle()
        finally:
            crew.end()


def every(
    work: Callable[[T], R],
    tasks: Iterable[T],
    jobs: int | None = None,
    cluster: str | None = None,
    idle: Callable[[], None] | None = None,
) -> Iterator[tuple[T, R]]:
    """Yield each task with its result, as they come, as ``each`` without a limit of time.

    Raises:
        InputError: as ``each``, or the process of one task died four times.
    """
    for task, result in each(work, tasks, None, jobs, cluster, _ATTEMPTS, idle):
        if isinstance(result, Lost):
            where = "this machine" if cluster is None else f"--cluster {cluster}"
            raise InputError(f"{where}: a task failed: {result.words}")
        yield task, result


@contextmanager
def interrupts_blocked() -> Iterator[None]:
    """Hold interrupts back; processes that start in the block never see one."""
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # its own start would let interrupts through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
