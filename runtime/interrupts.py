"""Interrupts of the command, which come in the middle of anything: imports above all."""

import _thread
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from types import FrameType

Handler = Callable[[int, FrameType | None], object]

INTERRUPTED, TERMINATED = 130, 143  # exit codes
_AGAIN = 0.02  # s until a lost interrupt comes again
# first words of ``sys.argv``: while ``python -m`` looks for the package, and as a program
_COMMAND = ("-m", "windwrench", "windwrench.exe", "windwrench-script.py")


def is_command() -> bool:
    """Return whether this process began as the ``windwrench`` command."""
    return bool(sys.argv) and os.path.basename(sys.argv[0]) in _COMMAND  # pathlib takes a while


@contextmanager
def _answering(
    number: signal.Signals, usual: "Handler | signal.Handlers", answer: Handler
) -> Iterator[bool]:
    """Have ``answer`` handle a signal in the block, and give whether it does: not where the usual
    handler is replaced already, nor in another thread than the main one.
    """
    ours = (
        threading.current_thread() is threading.main_thread() and signal.getsignal(number) is usual
    )
    if ours:
        signal.signal(number, answer)
    try:
        yield ours
    finally:
        if ours:
            signal.signal(number, usual)


@contextmanager
def leaving_at_once(active: bool = True) -> Iterator[None]:
    """Have an interrupt end the process at once while the block imports something.

    Nothing is done yet, so nothing is lost. An import may take the exception for one of its own,
    and prints many lines at best. Another handler of interrupts stays as it is, as do other threads
    than the main one.
    """
    usual = signal.default_int_handler
    with _answering(signal.SIGINT, usual, _leave) if active else nullcontext():
        yield


class _Interrupt(KeyboardInterrupt):
    """An interrupt, raised again where the first is lost: in callbacks of Python's own, as in every
    import, and in modules in C with imports of their own, as MuJoCo's.
    """

    taken = True  # an answer came, or no command runs
    number = signal.SIGINT  # signal of the interrupt

    def __del__(self) -> None:
        if not self.taken:
            threading.Timer(_AGAIN, _come_again).start()


def _come_again() -> None:
    if not _Interrupt.taken:
        _thread.interrupt_main(_Interrupt.number)


def _interrupt(number: int) -> None:
    _Interrupt.taken, _Interrupt.number = False, signal.Signals(number)
    raise _Interrupt


def taken() -> None:
    """Note the answer to an interrupt: it does not come again."""
    _Interrupt.taken = True


@contextmanager
def noted() -> Iterator[Callable[[], bool]]:
    """Give a function that answers an interrupt in the block, and returns whether one came.

    An interrupt within the import of a module in C may end as an import error.
    """
    came: list[int] = []
    hook_before = sys.unraisablehook

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)
        _interrupt(number)

    def answer() -> bool:
        taken()
        return bool(came)

    with _answering(signal.SIGINT, signal.default_int_handler, note) as ours:
        if ours:
            sys.unraisablehook = lambda lost: lost.exc_type is _Interrupt or hook_before(lost)
        try:
            yield answer
        finally:
            taken()
            sys.unraisablehook = hook_before


@contextmanager
def terminable() -> Iterator[Callable[[], bool]]:
    """Have a termination interrupt the block as Ctrl-C does, and give a function that returns
    whether one came. The parent process may have the command ignore interrupts, as a shell script
    does behind ``&``: a termination is answered all the same.
    """
    came: list[int] = []

    def end(number: int, frame: FrameType | None) -> None:
        came.append(number)
        _interrupt(number)

    with _answering(signal.SIGTERM, signal.SIG_DFL, end):
        yield lambda: bool(came)


def forget() -> None:
    """Have Python end with the given exit code. After an interrupt during the execution of a text,
    as by namedtuples and data classes, Python would kill itself in the end.
    """
    exec("")  # no code, but Python forgets the end of the last text


def _leave(_signal: int, _frame: FrameType | None) -> None:
    os.write(2, b"interrupted\n")
    os._exit(INTERRUPTED)
