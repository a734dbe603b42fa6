"""Interrupts of the command, which come in the middle of anything: imports above all."""

import _thread
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

INTERRUPTED = 130  # exit code
_AGAIN = 0.02  # s until an interrupt that was lost comes again
# what ``sys.argv`` begins with while ``python -m`` looks for the package, and as a program
_COMMAND = ("-m", "windwrench", "windwrench.exe", "windwrench-script.py")


def is_command() -> bool:
    """Return whether this process began as the ``windwrench`` command."""
    return bool(sys.argv) and os.path.basename(sys.argv[0]) in _COMMAND  # pathlib takes a while


@contextmanager
def leaving_at_once(active: bool = True) -> Iterator[None]:
    """Have an interrupt end the process at once while the block imports something.

    Nothing is done yet, so nothing is lost; an exception raised within an import may be taken for
    one of its own, and comes with many lines at best. Where someone else answers interrupts, or
    this is not the main thread, nothing changes.
    """
    ours = active and threading.current_thread() is threading.main_thread()
    if not ours or signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    signal.signal(signal.SIGINT, _leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def noted() -> Iterator[Callable[[], bool]]:
    """Give a function that says whether an interrupt came in the block.

    One that comes within the import of a module in C ends as an error of that import. One within a
    callback of Python's own, as every import has them, is lost there, and comes again.
    """
    came: list[int] = []
    told = sys.unraisablehook

    def again(lost: Any) -> None:
        if lost.exc_type is KeyboardInterrupt:
            threading.Timer(_AGAIN, _thread.interrupt_main).start()
        else:
            told(lost)

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)
        signal.default_int_handler(number, frame)

    usual = threading.current_thread() is threading.main_thread() and (
        signal.getsignal(signal.SIGINT) is signal.default_int_handler
    )
    if usual:
        signal.signal(signal.SIGINT, note)
        sys.unraisablehook = again
    try:
        yield lambda: bool(came)
    finally:
        if usual:
            sys.unraisablehook = told
            signal.signal(signal.SIGINT, signal.default_int_handler)


def forget() -> None:
    """Have Python end with the exit code that it is given: where an interrupt ended the execution
    of a text, as namedtuples and data classes do, it would kill itself in the end.
    """
    exec("")  # nothing, but Python forgets what ended the last


def _leave(_signal: int, _frame: FrameType | None) -> None:
    os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)
