"""Tasks whose results are kept one by one, so that a study that was stopped goes on."""

import json
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

from windwrench.runtime.workers import workers

Task = tuple[Any, ...]  # arguments that JSON can hold


def run_tasks(
    work: Callable[..., Any], wanted: Sequence[Task], path: Path, jobs: int = 1
) -> dict[Task, Any]:
    """Do the tasks that have no line in a file yet, and append one for each that is done.

    Args:
        work: takes a task's parts as its arguments; its result goes into JSON.
        wanted: the tasks, none twice.
        path: a line ``{"task": [...], "result": ...}`` each.
        jobs: processes.

    Returns: results by task, in the order of ``wanted``.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    done: dict[Task, Any] = {}
    if path.exists():
        for line in path.read_text(encoding="utf-8").splitlines():
            kept = json.loads(line)
            done[tuple(kept["task"])] = kept["result"]
    pending = [task for task in wanted if task not in done]
    if pending:
        with workers(jobs) as pool:
            running = {pool.submit(work, *task): task for task in pending}
            for future in as_completed(running):
                task = running[future]
                line = json.dumps({"task": task, "result": future.result()})
                done[task] = json.loads(line)["result"]  # as a later run reads it
                with path.open("a", encoding="utf-8") as file:
                    file.write(line + "\n")
                print(f"{sum(t in done for t in wanted)} of {len(wanted)}", flush=True)
    return {task: done[task] for task in wanted}
