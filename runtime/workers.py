"""Worker processes (pebble's, or a Ray cluster's) that outlive neither the work nor the process
that started them. A worker that dies, or takes too long, costs its own task alone.
"""

import math
import multiprocessing
import os
import signal
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from multiprocessing.managers import DictProxy, SyncManager
from pathlib import Path
from typing import Any, TypeVar

from .cluster import connected
from .errors import InputError
from .threads import one_thread

T = TypeVar("T")
R = TypeVar("R")

# forked workers would share the locks of compiled code and of linear algebra
_CONTEXT = multiprocessing.get_context("spawn")
_FIRST_TO_GO = 500  # of 1000: where memory runs out, the system ends a worker before its parent
_LOOK = 0.2  # s, after which tasks are looked at again
_ATTEMPTS = 4  # at a task of ``every``
# errors of Ray for a process, a machine or a result that is gone
_RAY_DEATHS = {
    "RayActorError",
    "WorkerCrashedError",
    "OutOfMemoryError",
    "NodeDiedError",
    "ObjectLostError",
}


def end_with_parent() -> None:
    """Have this process end as soon as the process that started it is gone, even if killed.

    For the initializer of any pool: a killed parent tells its workers nothing, and they would wait
    for work for ever.
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
    """Why a task has no result: its process died, or was ended since it took too long."""

    kind: str  # died, or time
    words: str


class _Local:
    """Tasks on processes of this machine, whose linear algebra has one thread each; a process that
    is gone is replaced.
    """

    def __init__(self, work: Callable[[Any], Any], count: int, most_seconds: float | None) -> None:
        self.count = count
        self._work, self._most_seconds = work, most_seconds
        self._before = {child.pid for child in multiprocessing.active_children()}
        self._begin()

    def _begin(self) -> None:
        from pebble import ProcessPool  # most of the kit starts no process

        self._pool: Any = ProcessPool(self.count, initializer=end_with_parent, context=_CONTEXT)
        # threads and processes that start in the block see no interrupt: a key press in the
        # terminal is the parent's to answer
        with _interrupts_blocked():
            assert self._pool.active

    def start(self, task: Any) -> Future[Any]:
        if not self._pool.active:  # a worker died while no worker had a task
            self._pool.stop()
            self._pool.join()
            self._begin()
        future: Future[Any] = self._pool.schedule(
            self._work, args=(task,), timeout=self._most_seconds
        )
        return future

    def wait(self, running: Iterable[Future[Any]], seconds: float | None) -> set[Future[Any]]:
        return wait(running, seconds, FIRST_COMPLETED).done

    def end(self) -> None:
        """End the processes at once, whatever they do."""
        self._pool.stop()
        for child in multiprocessing.active_children():
            if child.pid not in self._before:
                child.kill()
        self._pool.join()


class _OnCluster:
    """Tasks on a Ray cluster, one a core."""

    def __init__(
        self,
        ray: Any,
        address: str,
        work: Callable[[Any], Any],
        jobs: int | None,
        most_seconds: float | None,
    ) -> None:
        cores = int(ray.cluster_resources().get("CPU", 1))
        self.count = min(jobs or cores, cores)
        self._ray, self._address, self._most_seconds = ray, address, most_seconds
        self._running: dict[Any, tuple[Future[Any], float]] = {}  # by Ray's reference, until when

        def task_of_windwrench(task: Any) -> Any:  # Ray takes no partial function
            return work(task)

        # Ray gives a worker's linear algebra as many threads as the worker has cores
        self._work = ray.remote(num_cpus=1, max_retries=0)(task_of_windwrench)

    def start(self, task: Any) -> Future[Any]:
        future: Future[Any] = Future()
        until = math.inf if self._most_seconds is None else time.monotonic() + self._most_seconds
        self._running[self._work.remote(task)] = future, until
        return future

    def wait(self, running: Iterable[Future[Any]], seconds: float | None) -> set[Future[Any]]:
        """Ask Ray, always from this thread: a thread that asks while Ray is shut down, or that
        drops a reference then, ends the whole process.
        """
        first = min(until for _, until in self._running.values()) - time.monotonic()
        left = max(min(first, math.inf if seconds is None else seconds), 0.0)
        done, _ = self._ray.wait(list(self._running), timeout=None if math.isinf(left) else left)
        for reference in done:
            future, _ = self._running.pop(reference)
            try:
                future.set_result(self._ray.get(reference))
            except self._ray.exceptions.RayTaskError as error:
                reason = str(error.cause).partition("\n")[0]
                words = f"--cluster {self._address}: a task failed: {reason}"
                future.set_exception(InputError(words))
            except self._ray.exceptions.RayError as error:
                future.set_exception(error)
        for reference, (future, until) in list(self._running.items()):
            if time.monotonic() >= until:
                del self._running[reference]
                self._ray.cancel(reference, force=True)
                future.set_exception(TimeoutError("Task timeout"))
        return {future for future in running if future.done()}

    def end(self) -> None:
        """Leave the rest to Ray, which ends a task with the program that asked for it."""
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
    """Yield each task with its result, or with ``Lost``, as they come; tasks are taken when a
    worker is free, so that no more than one a worker are held.

    Args:
        work: what is done with a task; importable by its name.
        tasks: what is given to the work.
        most_seconds: that a task may take; None: any time.
        jobs: number of processes; default: one a core.
        cluster: a Ray cluster's address, or ``local`` for one on this machine; None: no Ray.
        attempts: at a task whose process dies, which may be its neighbour's fault; the further
            ones come last, one at a time.
        idle: called a few times a second while all wait.

    Raises:
        InputError: as ``runtime.cluster.connected``, or the work fails on a cluster.
        Exception: what the work itself raises.
    """
    with one_thread() if cluster is None else connected(cluster) as ray:
        crew: _Local | _OnCluster = (
            _Local(work, jobs or os.cpu_count() or 1, most_seconds)
            if cluster is None
            else _OnCluster(ray, cluster, work, jobs, most_seconds)
        )
        coming = iter(tasks)
        again: deque[tuple[T, int]] = deque()
        running: dict[Future[Any], tuple[T, int]] = {}
        try:
            while True:
                while len(running) < crew.count and (task := next(coming, None)) is not None:
                    running[crew.start(task)] = task, 1
                if not running:
                    if not again:
                        return
                    task, attempt = again.popleft()
                    running[crew.start(task)] = task, attempt + 1
                for future in crew.wait(running, _LOOK if idle else None):
                    task, attempt = running.pop(future)
                    error = future.exception()
                    if error is None:
                        yield task, future.result()
                    elif isinstance(error, TimeoutError) and error.args[:1] == ("Task timeout",):
                        yield task, Lost("time", f"it took more than {most_seconds:g} s")
                    elif (words := _death(error)) is None:
                        raise error
                    elif attempt < attempts:
                        again.append((task, attempt))
                    else:
                        yield task, Lost("died", words)
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


def _death(error: BaseException) -> str | None:
    """Return how a process ended, in words; None for what the work raised."""
    names = {kind.__name__ for kind in type(error).__mro__}
    if names & _RAY_DEATHS:
        return "its process on the cluster died"
    if isinstance(error, BrokenProcessPool):
        return "its process died"
    if "ProcessExpired" not in names:
        return None
    code = getattr(error, "exitcode", None)
    if code is None or code >= 0:
        return f"its process ended with code {code}"
    name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
    memory = ", as where memory runs out" if -code == signal.SIGKILL else ""
    return f"its process was ended by {name}{memory}"


@contextmanager
def shared_dict(values: Mapping[str, Any]) -> Iterator["DictProxy[str, Any]"]:
    """Give a dictionary that workers can change too; its ``copy`` is of one instant."""
    manager = SyncManager(ctx=_CONTEXT)
    with _interrupts_blocked():
        manager.start(end_with_parent)
    try:
        yield manager.dict(dict(values))
    finally:
        manager.shutdown()


@contextmanager
def _interrupts_blocked() -> Iterator[None]:
    """Hold interrupts back; processes that start in the block never see one."""
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # its own start would let interrupts through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
