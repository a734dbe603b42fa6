"""Worker processes (pebble's, or a Ray cluster's) that outlive neither the work nor the process
that started them. A worker that dies, or takes too long, costs its own task alone.
"""

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
from typing import Any, ParamSpec, TypeVar

from .cluster import connected

P = ParamSpec("P")
T = TypeVar("T")

# forked workers would share the locks of compiled code and of linear algebra
_CONTEXT = multiprocessing.get_context("spawn")
# one process a core: further threads of linear algebra would only wait for each other
SINGLE_THREADED = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_FIRST_TO_GO = 500  # of 1000: where memory runs out, the system ends a worker before its parent
_LOOK = 0.2  # s, after which a task that a cluster has is looked at again


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


class Workers:
    """A pool of processes of this machine; a process that is gone is replaced."""

    def __init__(self, count: int) -> None:
        self._count = count
        self._before = {child.pid for child in multiprocessing.active_children()}
        self._begin()

    def _begin(self) -> None:
        from pebble import ProcessPool  # most of the kit starts no process

        self._pool: Any = ProcessPool(self._count, initializer=end_with_parent, context=_CONTEXT)
        # threads and processes that start in the block see no interrupt: a key press in the
        # terminal is the parent's to answer
        with _interrupts_blocked():
            assert self._pool.active

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Return the future of a call in a worker."""
        return self.limited(None, fn, *args, **kwargs)

    def limited(
        self, seconds: float | None, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs
    ) -> Future[T]:
        """Return the future of a call that is ended with TimeoutError after some seconds."""
        if not self._pool.active:  # a worker died while no worker had a task
            self._pool.stop()
            self._pool.join()
            self._begin()
        future: Future[T] = self._pool.schedule(fn, args=args, kwargs=kwargs, timeout=seconds)
        return future

    def map(self, fn: Callable[..., T], *iterables: Iterable[Any]) -> Iterator[T]:
        """Yield the results of calls in workers, in order."""
        futures = [self.submit(fn, *arguments) for arguments in zip(*iterables, strict=False)]
        return (future.result() for future in futures)

    def close(self) -> None:
        """Wait for all work, and end the processes."""
        self._pool.close()
        self._pool.join()

    def end(self) -> None:
        """End the processes at once, whatever they do."""
        self._pool.stop()
        for child in multiprocessing.active_children():
            if child.pid not in self._before:
                child.kill()
        self._pool.join()


@contextmanager
def workers(count: int) -> Iterator[Workers]:
    """Give a pool of ``count`` processes; an error or an interrupt in the block ends them at once,
    work or no work.
    """
    pool = Workers(count)
    try:
        yield pool
    except BaseException:
        pool.end()
        raise
    pool.close()


@dataclass(frozen=True)
class Lost:
    """Why a task has no result: its process died, or was ended since it took too long."""

    kind: str  # died, or time
    words: str


class _Local:
    """Tasks on the processes of this machine, whose linear algebra has one thread each."""

    def __init__(self, work: Callable[[Any], Any], count: int, most_seconds: float) -> None:
        self.count = count
        self._work, self._most_seconds = work, most_seconds
        self._set = {k: value for k, value in SINGLE_THREADED.items() if k not in os.environ}
        os.environ.update(self._set)  # read by the libraries as a worker imports them
        self._pool = Workers(count)

    def start(self, task: Any) -> Future[Any]:
        return self._pool.limited(self._most_seconds, self._work, task)

    def end(self) -> None:
        self._pool.end()
        for name in self._set:
            os.environ.pop(name, None)


class _OnCluster:
    """Tasks on a Ray cluster, one a core."""

    def __init__(
        self, ray: Any, work: Callable[[Any], Any], jobs: int | None, most_seconds: float
    ) -> None:
        cores = int(ray.cluster_resources().get("CPU", 1))
        self.count = min(jobs or cores, cores)
        self._ray, self._most_seconds = ray, most_seconds
        # Ray gives a worker's linear algebra as many threads as the worker has cores
        self._work = ray.remote(num_cpus=1, max_retries=0)(work)

    def start(self, task: Any) -> Future[Any]:
        reference, late = self._work.remote(task), Future[Any]()
        inner, until = reference.future(), time.monotonic() + self._most_seconds

        def watch() -> None:
            while not inner.done() and time.monotonic() < until:
                time.sleep(_LOOK)
            if not inner.done():
                self._ray.cancel(reference, force=True)
                late.set_exception(TimeoutError("Task timeout"))
            elif (error := inner.exception()) is not None:
                late.set_exception(error)
            else:
                late.set_result(inner.result())

        threading.Thread(target=watch, daemon=True).start()
        return late

    def end(self) -> None:
        """Leave the rest to Ray, which ends a task with the program that asked for it."""


def each(
    work: Callable[[T], Any],
    tasks: Iterable[T],
    most_seconds: float,
    jobs: int | None = None,
    cluster: str | None = None,
    attempts: int = 2,
) -> Iterator[tuple[T, Any]]:
    """Yield each task with its result, or with ``Lost``, as they come; tasks are taken when a
    worker is free, so that no more than one a worker are held.

    Args:
        work: what is done with a task; importable by its name.
        tasks: what is given to the work.
        most_seconds: that a task may take.
        jobs: number of processes; default: one a core.
        cluster: a Ray cluster's address, or ``local`` for one on this machine; None: no Ray.
        attempts: at a task whose process dies, which may be its neighbour's fault; the further
            ones come last, one at a time.

    Raises:
        InputError: as ``runtime.cluster.connected``.
        Exception: what the work itself raises.
    """
    if cluster is None:
        yield from _each(
            _Local(work, jobs or os.cpu_count() or 1, most_seconds), tasks, most_seconds, attempts
        )
        return
    with connected(cluster) as ray:
        crew = _OnCluster(ray, work, jobs, most_seconds)
        yield from _each(crew, tasks, most_seconds, attempts)


def _each(
    crew: _Local | _OnCluster, tasks: Iterable[T], most_seconds: float, attempts: int
) -> Iterator[tuple[T, Any]]:
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
            for future in wait(running, return_when=FIRST_COMPLETED).done:
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
    finally:
        crew.end()


def _death(error: BaseException) -> str | None:
    """Return how a process ended, in words; None for what the work raised."""
    names = {kind.__name__ for kind in type(error).__mro__}
    if names & {"RayActorError", "WorkerCrashedError", "OutOfMemoryError", "NodeDiedError"}:
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
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing import resource_tracker

    resource_tracker.ensure_running()  # its own start would let interrupts through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
