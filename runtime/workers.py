"""Worker processes that outlive neither the work nor the process that started them."""

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future, ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing.managers import DictProxy, SyncManager
from typing import Any, ParamSpec, TypeVar

P = ParamSpec("P")
T = TypeVar("T")

# forked workers would share the locks of compiled code and of linear algebra
_CONTEXT = multiprocessing.get_context("spawn")
# one process a core: further threads of linear algebra would only wait for each other
SINGLE_THREADED = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")


def end_with_parent() -> None:
    """Have this process end as soon as the one that started it is gone, even if that one was
    killed.

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


class _Pool(ProcessPoolExecutor):
    """Starts its workers with interrupts blocked: a key press in the terminal is the parent's to
    answer.
    """

    def submit(self, fn: Callable[P, T], /, *args: P.args, **kwargs: P.kwargs) -> Future[T]:
        """Return the future of a call in a worker."""
        with _interrupts_blocked():
            return super().submit(fn, *args, **kwargs)

    def map(self, fn: Callable[..., T], *iterables: Iterable[Any], **_: Any) -> Iterator[T]:
        """Yield the results of calls in workers, in order."""
        # the library's own cancels what waits when it is left early, and then trips over that where
        # workers are ended
        futures = [self.submit(fn, *arguments) for arguments in zip(*iterables, strict=False)]
        return (future.result() for future in futures)


@contextmanager
def workers(count: int) -> Iterator[ProcessPoolExecutor]:
    """Give a pool of ``count`` processes; an error or an interrupt in the block ends them at once,
    work or no work.
    """
    before = {child.pid for child in multiprocessing.active_children()}
    pool = _Pool(count, mp_context=_CONTEXT, initializer=end_with_parent)
    try:
        yield pool
    except BaseException:
        for child in multiprocessing.active_children():
            if child.pid not in before:
                child.terminate()
        pool.shutdown()
        raise
    pool.shutdown()


def one_process(prepare: Callable[[], None] = end_with_parent) -> ProcessPoolExecutor:
    """Return a pool of one process, whose linear algebra has one thread; it has started.

    Args:
        prepare: called in the process first; it calls ``end_with_parent``.
    """
    pool = _Pool(1, mp_context=_CONTEXT, initializer=prepare)
    given = {name: value for name, value in SINGLE_THREADED.items() if name not in os.environ}
    os.environ.update(given)  # read by the libraries as they are imported
    try:
        pool.submit(os.getpid)
    finally:
        for name in given:
            del os.environ[name]
    return pool


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
