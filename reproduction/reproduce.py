"""Running experiments side by side, keeping what is done, and the page that compares them with the
paper.
"""

import csv
import io
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from importlib import import_module
from multiprocessing.managers import DictProxy, SyncManager
from pathlib import Path
from typing import Any

from .. import __version__
from ..runtime.errors import InputError, unknown_name
from ..runtime.page_files import write_figure, write_json, write_text
from ..runtime.plain_values import plain
from ..runtime.provenance import commit, made_by
from ..runtime.regular_files import read_json
from ..runtime.workers import SPAWNED, end_with_parent, every, interrupts_blocked
from . import NAMES
from .result import Columns, Result, template


def chosen(name: str) -> list[str]:
    """Return the experiments that a name stands for: itself, or all.

    Raises:
        InputError: no experiment has this name.
    """
    if name != "all" and name not in NAMES:
        raise unknown_name("experiment", name, [*NAMES, "all"])
    return list(NAMES) if name == "all" else [name]


def reproduce(
    names: Sequence[str],
    folder: Path,
    seeds: int | None = None,
    jobs: int | None = None,
    report: Callable[[Mapping[str, float]], None] = lambda shares: None,
) -> dict[str, bool]:
    """Run experiments, each in a process of its own, and write their files as each ends.

    An experiment whose JSON of the same version and seeds lies in the folder already is not run
    again, so that an interrupted run goes on where it stopped.

    Args:
        names: of the experiments.
        folder: for NAME.json, NAME.csv.gz, NAME.png and NAME.svg.
        seeds: for every experiment; default: each one's own number.
        jobs: processes; default: one a core.
        report: called a few times a second with the share that is done of each experiment.

    Returns:
        For each name, whether it was run now (or kept from before).

    Raises:
        InputError: ``seeds`` is not positive, or an experiment needs a package that is not there.
    """
    wanted = numbers_of_seeds(names, seeds)
    done = {name: is_done(folder, name, count) for name, count in wanted.items()}
    pending = [name for name in names if not done[name]]
    with _shared_dict({name: float(done[name]) for name in names}) as shares:
        work = partial(_run_and_write, seeds=wanted, folder=folder, shares=shares)
        jobs = min(jobs or os.cpu_count() or 1, max(len(pending), 1))
        for _ in every(work, pending, jobs, idle=lambda: report(dict(shares))):
            pass
        report(dict(shares))
    return {name: name in pending for name in names}


@contextmanager
def _shared_dict(values: Mapping[str, Any]) -> Iterator["DictProxy[str, Any]"]:
    """Give a dictionary that workers can change too; its ``copy`` is of one instant."""
    manager = SyncManager(ctx=SPAWNED)
    with interrupts_blocked():
        manager.start(end_with_parent)
    try:
        yield manager.dict(dict(values))
    finally:
        manager.shutdown()


def _module(name: str) -> Any:
    return import_module(f".{name}", __package__)


def numbers_of_seeds(names: Sequence[str], seeds: int | None = None) -> dict[str, int]:
    """Return with how many seeds each experiment runs: ``seeds``, or its own number.

    Raises:
        InputError: ``seeds`` is not positive.
    """
    if seeds is not None and seeds < 1:
        raise InputError(f"reproduce: --seeds must be at least 1, got {seeds}")
    return {name: seeds or int(_module(name).SEEDS) for name in names}


def is_done(folder: Path, name: str, seeds: int) -> bool:
    """Return whether an experiment's files of this version and number of seeds lie in a folder.

    The SVG, which no page shows, may be missing.
    """
    try:
        kept = read_json(folder / f"{name}.json", "a figure's results")
    except InputError:
        return False
    files = all((folder / f"{name}.{kind}").is_file() for kind in ("csv.gz", "png"))
    return bool(
        files
        and isinstance(kept, dict)
        and (kept.get("seeds"), kept.get("version")) == (seeds, __version__)
    )


def _run_and_write(name: str, seeds: Mapping[str, int], folder: Path, shares: Any) -> None:
    """Run one experiment and write its files; the JSON comes last and says that the others are
    whole.
    """
    commit()  # asked before the run: it is the code that runs
    module = _module(name)
    result: Result = module.run(
        seeds[name], lambda share: shares.__setitem__(name, min(float(share), 0.99))
    )
    write_result(name, module.TITLE, seeds[name], result, folder)
    shares[name] = 1.0


def write_result(name: str, title: str, seeds: int, result: Result, folder: Path) -> None:
    """Write NAME.png, NAME.svg, NAME.csv.gz and then NAME.json, the same bytes for the same
    result.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{name}.json").unlink(missing_ok=True)
    write_figure(result.picture, folder, name)
    write_text(_csv(result.data), folder / f"{name}.csv.gz")
    summary = {
        "experiment": name,
        "title": title,
        "version": __version__,
        "commit": commit(),
        "seeds": seeds,
        "figures": plain(result.figures),
        "comparison": [asdict(row) for row in result.comparison],
        "remarks": result.remarks,
    }
    write_json(summary, folder / f"{name}.json")


def _csv(columns: Columns) -> str:
    """Return a table as CSV, with the six digits that a picture's data need."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*(plain(column) for column in columns.values()), strict=True):
        writer.writerow([float(f"{v:.6g}") if isinstance(v, float) else v for v in row])
    return buffer.getvalue()


def write_page(names: Sequence[str], folder: Path, page: Path) -> None:
    """Write the page "the paper / this kit" from the experiments' JSON files in a folder."""
    figures = {}
    for name in names:
        try:
            figures[name] = read_json(folder / f"{name}.json", "a figure's results")
        except InputError:
            continue
    where = Path(os.path.relpath(folder, page.parent)).as_posix()
    text = template("page").render(figures=figures, where=where, made_by=made_by)
    write_text(text, page)
