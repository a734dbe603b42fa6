"""One runner of studies: tasks in processes, kept one by one, so that a study that was stopped goes
on; and the command line that studies share.
"""

import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from windwrench.runtime.code_digest import code_digest
from windwrench.runtime.errors import InputError
from windwrench.runtime.whole_files import replaced
from windwrench.runtime.workers import Lost, each

Task = tuple[Any, ...]  # arguments that JSON can hold
Jobs = Annotated[int, typer.Option(min=1, help="Number of processes.")]
_MOST_SECONDS = 4 * 3600.0  # of a task
ROOMS = ("core", "runtime", "dynamics", "estimator", "controllers", "identification", "envs")


def code_stamp(*modules: str) -> str:
    """Return a digest (16 hexadecimal digits) of the rooms that fly and diagnose, and of these
    modules of the studies: results of other code are not comparable.

    Args:
        modules: paths below this folder without their ending, such as ``trials/outsiders``.
    """
    return code_digest(ROOMS, tuple(f"evidence/{name}.py" for name in modules))


def run_tasks(
    work: Callable[..., Any],
    wanted: Sequence[Task],
    path: Path,
    jobs: int = 1,
    stamp: str = "",
    report: Callable[[int, int], None] | None = None,
) -> dict[Task, Any]:
    """Do the tasks that have no line in a file yet, and append a line for each that is done.

    Args:
        work: takes a task's parts as its arguments; its result goes into JSON.
        wanted: the tasks, none twice.
        path: a line ``{"task": [...], "code": stamp, "result": ...}`` each. Lines of other tasks
            or of other code, and half lines, are dropped.
        jobs: processes.
        stamp: of the code, as of ``code_stamp``.
        report: called with the number of tasks that are done and of all; default: prints both.

    Returns: results by task, in the order of ``wanted``.

    Raises:
        InputError: the file cannot be written, or a task is refused.
    """
    keys = {json.dumps(task): task for task in wanted}
    done = {keys[key]: result for key, result in kept_lines(path, stamp) if key in keys}
    path.parent.mkdir(parents=True, exist_ok=True)
    with replaced(path) as part:
        part.write_text("".join(_line(t, stamp, r) for t, r in done.items()), encoding="utf-8")
    tell = report or (lambda count, whole: print(f"{count} of {whole}", flush=True))
    tell(len(done), len(keys))
    pending = [task for task in wanted if task not in done]
    with path.open("a", encoding="utf-8") as file:
        for task, result in each(partial(_do, work), pending, _MOST_SECONDS, jobs):
            if isinstance(result, Lost):
                raise InputError(f"{path}: {task}: {result.words}; run the study again")
            line = _line(task, stamp, result)
            file.write(line)
            file.flush()
            done[task] = json.loads(line)["result"]  # as a later run reads it
            tell(len(done), len(keys))
    return {task: done[task] for task in wanted}


def _do(work: Callable[..., Any], task: Task) -> Any:
    return work(*task)


def kept_lines(path: Path, stamp: str) -> Iterator[tuple[str, Any]]:
    """Yield the task, as JSON, and the result of each whole line of this code."""
    with suppress(OSError):
        for text in path.read_text(encoding="utf-8").splitlines():
            with suppress(ValueError, KeyError, TypeError):
                line = json.loads(text)
                if line.get("code", "") == stamp:
                    yield json.dumps(line["task"]), line["result"]


def _line(task: Task, stamp: str, result: Any) -> str:
    return json.dumps({"task": task, "code": stamp, "result": result}) + "\n"


def start(study: Callable[..., Any]) -> None:
    """Run a study's function from the command line; a refusal ends it with one line and status 2.

    Args:
        study: its arguments are the options, as of typer.
    """
    try:
        typer.run(study)
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        sys.exit(2)
