"""One thread of linear algebra: matrices are small here, and further threads only wait for each
other. With two, a diagnosis takes twice the processor time, and no less of the clock.
"""

import os
import threading
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from threadpoolctl import threadpool_limits

# for new processes: libraries read these once, when loaded
SINGLE_THREADED = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"), "1")
_lock = threading.Lock()
_inside = 0  # callers
_before = ExitStack()  # restores the settings from before


@contextmanager
def one_thread() -> Iterator[None]:
    """Have linear algebra use one thread, here and in processes started meanwhile, until the last
    caller leaves; then as many as before. Also a decorator.
    """
    global _inside
    # NumPy and SciPy have a library each; only loaded ones can be limited
    import scipy.linalg  # noqa: F401

    with _lock:
        if not _inside:
            _before.enter_context(threadpool_limits(1, "blas"))
            _before.callback(_put_back, {name: os.environ.get(name) for name in SINGLE_THREADED})
            os.environ.update(SINGLE_THREADED)
        _inside += 1
    try:
        yield
    finally:
        with _lock:
            _inside -= 1
            if not _inside:
                _before.close()


def _put_back(environment: dict[str, str | None]) -> None:
    for name, value in environment.items():
        if value is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = value
