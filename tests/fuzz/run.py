"""Spoiled inputs by the thousand: every one is read or refused with a message that names it, and
nothing else happens.

``python -m tests.fuzz --inputs 20000 --seed 0`` spoils good files of every form that the kit reads,
by bytes and by fields, and does with each what a command does: read it and, where it was read, use
it. A fault is anything but success and ``InputError``: another exception, a warning that numbers
overflowed, a message that does not name the file, more than 10 s, more memory than 4 GiB, or a
process that dies. For a part of the refused files the whole command is run: it must end with exit
code 2, one line on standard error, and no result.
"""

import argparse
import contextlib
import io
import os
import random
import signal
import sys
import tempfile
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, field
from pathlib import Path

from tests.fuzz.forms import Form, forms, lay_out
from tests.fuzz.mutations import spoil
from tests.support.compiled_estimates import compile_estimates
from windwrench.runtime.errors import InputError
from windwrench.runtime.whole_files import replaced
from windwrench.runtime.workers import workers

LONGEST = 10.0  # s, for one input
MOST_MEMORY = 4 * 2**30  # bytes
_COMPILING = 900.0  # s, for the good example, on which code that is new here is compiled
_CHUNK = 100  # inputs that a worker is given at a time
_COMMANDED = 25  # every so many refused inputs of a chunk, one goes through the whole command


@dataclass
class Tally:
    """What became of the inputs of one form."""

    form: str
    read: int = 0
    refused: int = 0
    commands: int = 0  # whole commands that were run on refused inputs
    faults: list[str] = field(default_factory=list)
    slowest: float = 0.0  # s
    messages: Counter[str] = field(
        default_factory=Counter
    )  # the refusals' last words, for how varied they are

    def add(self, other: "Tally") -> None:
        """Take in what became of other inputs."""
        self.read += other.read
        self.refused += other.refused
        self.commands += other.commands
        self.faults += other.faults
        self.slowest = max(self.slowest, other.slowest)
        self.messages.update(other.messages)

    @property
    def inputs(self) -> int:
        """How many inputs there were."""
        return self.read + self.refused + len(self.faults)


class _TooLong(BaseException):
    """Not an Exception: what catches everything must not catch it."""


@contextlib.contextmanager
def _limited(longest: float) -> Iterator[None]:
    """Stop the block after ``longest`` seconds, where the system can."""
    if not hasattr(signal, "setitimer"):
        yield
        return

    def stop(*_: object) -> None:
        raise _TooLong

    before = signal.signal(signal.SIGALRM, stop)
    signal.setitimer(signal.ITIMER_REAL, longest)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def spoiled(form: Form, number: int, seed: int) -> bytes:
    """Return the input of a number: the same for the same form, number and seed."""
    rng = random.Random(f"{form.name}/{seed}/{number}")
    return spoil(form.good(), form.ways, rng)


def attempt(form: Form, path: Path, longest: float = LONGEST) -> tuple[str, str]:
    """Use a file for ``longest`` s at most; return ``read``, ``refused`` or ``fault``, and what was
    said.
    """
    try:
        with _limited(longest), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            warnings.filterwarnings(
                "error", category=RuntimeWarning
            )  # numbers that overflow unseen
            form.use(path)
    except InputError as error:
        named = form.command == () or path.name in str(error) or path.stem in str(error)
        return (
            ("refused", str(error))
            if named and str(error).strip()
            else ("fault", f"does not name the file: {error}")
        )
    except _TooLong:
        return "fault", f"more than {longest:g} s"
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        where = traceback.extract_tb(error.__traceback__)[-1]
        return (
            "fault",
            f"{type(error).__name__}: {str(error)[:120]} "
            f"({Path(where.filename).name}:{where.lineno})",
        )
    return "read", ""


def run_command(form: Form, path: Path) -> str:
    """Run the form's command on a file that is refused; return what is wrong with how it ends, or
    nothing.
    """
    from windwrench.cli import main

    before, argv, here = set(path.parent.iterdir()), sys.argv, Path.cwd()
    out, said = io.StringIO(), io.StringIO()
    sys.argv = ["windwrench", *form.command, path.name]
    try:
        os.chdir(path.parent)
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(said):
            main()
    except SystemExit as ended:
        lines = said.getvalue().strip().splitlines()
        if ended.code != 2:
            return f"the command ended with exit code {ended.code}"
        if len(lines) != 1 or not lines[0].startswith("error: "):
            return f"the command said {said.getvalue()[:200]!r}"
        if out.getvalue() or set(path.parent.iterdir()) != before:
            return "the command wrote something"
        return ""
    except BaseException as error:
        return f"the command raised {type(error).__name__}: {str(error)[:120]}"
    finally:
        sys.argv = argv
        os.chdir(here)
    return "the command did not end"


def fuzz_chunk(name: str, first: int, count: int, seed: int) -> Tally:
    """Return what becomes of the inputs ``first`` to ``first + count`` of a form."""
    import time

    form, tally = forms()[name], Tally(name)
    # the first use of code is its slowest, and no fault of an input's: a spoiled log may have other
    # sensors left than the good one
    compile_estimates()
    with tempfile.TemporaryDirectory() as folder:
        # the first use of code is its slowest, and no fault of an input's
        outcome, said = attempt(
            form, lay_out(form, form.good(), Path(folder) / "input"), longest=_COMPILING
        )
        if outcome != "read":
            tally.faults.append(f"{name}: the good example was not read: {said}")
        for number in range(first, first + count):
            path = lay_out(form, spoiled(form, number, seed), Path(folder) / "input")
            begun = time.perf_counter()
            outcome, said = attempt(form, path)
            tally.slowest = max(tally.slowest, time.perf_counter() - begun)
            if outcome == "refused" and form.command and tally.refused % _COMMANDED == 0:
                wrong = run_command(form, path)
                tally.commands += 1
                outcome, said = ("fault", wrong) if wrong else (outcome, said)
            if outcome == "read":
                tally.read += 1
            elif outcome == "refused":
                tally.refused += 1
                tally.messages[said.rpartition("expected ")[2][:60]] += 1
            else:
                tally.faults.append(f"{name} {number}: {said}")
    return tally


def _limited_chunk(name: str, first: int, count: int, seed: int) -> Tally:
    """Do the same in a process of the fuzzer's own, which may have so much memory and no more."""
    try:
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (MOST_MEMORY, MOST_MEMORY))
    except (ImportError, OSError, ValueError):
        pass  # not on this system
    return fuzz_chunk(name, first, count, seed)


def fuzz(
    inputs: int,
    seed: int,
    jobs: int | None = None,
    only: Sequence[str] = (),
    advance: Callable[[int], None] = lambda count: None,
) -> list[Tally]:
    """Spoil ``inputs`` inputs, the same number of every form, and return what became of them.

    Args:
        inputs: in all; rounded up to the same number of each form.
        seed: of the spoiling.
        jobs: processes; default: one a core. The outcome does not depend on it.
        only: names of forms; default: all.
        advance: called with the number of inputs done since the last call.
    """
    names = [name for name in forms() if not only or name in only]
    each = -(-inputs // len(names))
    tallies = {name: Tally(name) for name in names}
    tasks = [
        (name, first, min(_CHUNK, each - first))
        for name in names
        for first in range(0, each, _CHUNK)
    ]
    while tasks:
        left: list[tuple[str, int, int]] = []
        with workers(min(jobs or os.cpu_count() or 1, len(tasks))) as pool:
            waiting: list[tuple[tuple[str, int, int], Future[Tally]]] = [
                (task, pool.submit(_limited_chunk, *task, seed)) for task in tasks
            ]
            for (name, first, count), future in waiting:
                try:
                    tallies[name].add(future.result())
                    advance(count)
                except (
                    BrokenProcessPool
                ):  # an input killed its process; the others of that pool are innocent
                    left.append((name, first, count))
        if left and len(left) == len(tasks):
            name, first, count = left[0]
            if count == 1:
                tallies[name].faults.append(f"{name} {first}: the process died")
                left = left[1:]
            else:
                half = count // 2
                left = [(name, first, half), (name, first + half, count - half), *left[1:]]
        tasks = left
    return list(tallies.values())


def table(tallies: Sequence[Tally]) -> str:
    """Return what became of the inputs as a Markdown table."""
    lines = [
        "| form | inputs | read | refused | different refusals | commands run | faults | slowest |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
    ]
    whole = Tally("all")
    for tally in tallies:
        whole.add(tally)
    for t in (*tallies, whole):
        lines.append(
            f"| {t.form} | {t.inputs} | {t.read} | {t.refused} | {len(t.messages)} | {t.commands} "
            f"| {len(t.faults)} | "
            f"{t.slowest:.1f} s |"
        )
    return "\n".join(lines) + "\n"


def main() -> int:
    """Run from a command line; the exit code is 1 where there was a fault."""
    parser = argparse.ArgumentParser(
        prog="python -m tests.fuzz",
        description=(__doc__ or "").partition("\n")[0],
        epilog="Example: python -m tests.fuzz --inputs 20000 --seed 0",
    )
    parser.add_argument("--inputs", type=int, default=20_000, help="in all (default: 20000)")
    parser.add_argument("--seed", type=int, default=0, help="of the spoiling (default: 0)")
    parser.add_argument("--jobs", type=int, help="processes (default: one a core)")
    parser.add_argument(
        "--only", action="append", default=[], help="name of a form; may be repeated"
    )
    parser.add_argument("--markdown", type=Path, help="also write the table to this file")
    given = parser.parse_args()
    done = 0

    def advance(count: int) -> None:
        nonlocal done
        done += count
        print(f"\r{done} inputs", end="", file=sys.stderr, flush=True)

    tallies = fuzz(given.inputs, given.seed, given.jobs, given.only, advance)
    print(file=sys.stderr)
    print(table(tallies))
    faults = [fault for tally in tallies for fault in tally.faults]
    print("\n".join(faults[:60]))
    if given.markdown is not None:
        with replaced(given.markdown) as partial:
            partial.write_text(table(tallies), encoding="utf-8")
    return 1 if faults else 0
