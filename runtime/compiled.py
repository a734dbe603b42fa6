"""How this kit's inner loops are compiled."""

import os
import subprocess
import sys
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import NumbaExperimentalFeatureWarning, njit

F = TypeVar("F", bound=Callable[..., Any])

# a record that begins like another may stand for it: the plant's for the model's
warnings.filterwarnings(
    "ignore", category=NumbaExperimentalFeatureWarning, message=r"(\x1b\[\d+m)*Record"
)

# One record of a structured array: compiled code reads its fields as attributes.
Record = Any


def compiled(function: F) -> F:
    """Compile a function at its first call and keep the machine code on disk; numbers come out the
    same bit for bit.

    Strict arithmetic: with reordered sums a cached process could give other bits than a fresh one.
    """
    return cast(F, njit(cache=True)(function))


def is_compiled(function: Callable[..., Any]) -> bool:
    """Return whether a compiled function's machine code is in memory already."""
    return bool(cast(Any, function).signatures)


@contextmanager
def announced(patience: float = 2.0) -> Iterator[None]:
    """Say on stderr what takes so long if the block, a first call of compiled code, lasts longer
    than ``patience`` s.
    """
    timer = threading.Timer(
        patience,
        lambda: print(
            "windwrench: compiling its inner loops, once for this installation (about 20 s) ...",
            file=sys.stderr,
            flush=True,
        ),
    )
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


@contextmanager
def compiled_meanwhile(
    function: Callable[..., Any], compile_it: Callable[[], None]
) -> Iterator[None]:
    """Have another process compile ``function`` while the block compiles something else, and wait
    for it.

    Only where there is no machine code of it on disk and a second core: this one then finds it
    there. Numba compiles one function at a time in a process, in threads or not.

    Args:
        function: a compiled one.
        compile_it: compiles it; a function without arguments, found by its module and name.
    """
    code = cast(Any, function)
    known = is_compiled(function) or any(
        Path(code.stats.cache_path).glob(f"*.{code.__name__}-*.nbi")
    )
    if known or len(os.sched_getaffinity(0)) < 2:
        yield
        return
    module, name = compile_it.__module__, compile_it.__name__
    with subprocess.Popen(
        [sys.executable, "-c", f"from {module} import {name}; {name}()"],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    ) as other:
        try:
            yield
        except BaseException:
            other.kill()
            raise
