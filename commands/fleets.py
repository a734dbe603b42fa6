"""Fleets: many logs of many vehicles, one diagnosis each; called by ``windwrench diagnose
--fleet``.
"""

import shlex
import sys
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from rich import box
from rich.table import Table

from ..runtime.errors import InputError
from .terminal import console, note, progress_bar, results_folder, say

_MOST_ROWS = 20  # of the table in the terminal


def diagnose_fleet(
    logs: Sequence[Path],
    vehicle: str | None,
    reader: str | None,
    log_map: str | None,
    without: Sequence[str],
    manifest: Path | None,
    cluster: str | None,
    jobs: int | None,
    limit: float | None,
    out: Path,
) -> dict[str, Any]:
    """Diagnose each log by itself; write the fleet's page, tables and picture.

    Raises:
        InputError: the request cannot be used, or no log at all could be diagnosed.
    """
    from ..dynamics.effects import names
    from ..identification.fleet.drift import fleet_of
    from ..identification.fleet.files import fleet_data, write_fleet
    from ..identification.fleet.manifest import find_logs, read_manifest
    from ..identification.fleet.outcomes import Outcomes
    from ..identification.fleet.page import change_in_words, changes, headline
    from ..identification.fleet.running import LIMIT_S, OUTCOMES, rows, run_fleet
    from ..identification.logs.log_map import load_map
    from ..identification.logs.readers import find_reader
    from ..runtime.errors import unknown_name
    from ..runtime.extras import need

    for name in without:
        if name not in names():
            raise unknown_name("effect", name, names(), "--without")
    if reader is not None:
        find_reader(reader)
    if log_map is not None:
        load_map(log_map)
    if cluster is not None:
        need("ray", "cluster")
    described = None if manifest is None else read_manifest(manifest)
    found, doubts = find_logs(logs, described, vehicle, reader, out, log_map)
    folder = results_folder(out, logs=len(found), jobs=jobs, cluster=cluster)
    for text in doubts:
        note(text)
    with closing(Outcomes(folder / OUTCOMES)) as outcomes:
        with progress_bar() as progress:
            task = progress.add_task("diagnosing logs", total=len(found))

            def report(counts: Any) -> None:
                text = f"diagnosing logs ({counts['refused']} refused)"
                progress.update(task, completed=sum(counts.values()), description=text)

            done = run_fleet(
                found, outcomes, tuple(without), limit or LIMIT_S, jobs, cluster, report
            )
        fleet = fleet_of(rows(done, outcomes))
        command = shlex.join(["windwrench", *sys.argv[1:]])
        written = write_fleet(fleet, lambda: rows(done, outcomes), folder, command)
    console.print(headline(fleet), highlight=False, markup=False)
    for one in changes(fleet):
        console.print(change_in_words(one), highlight=False, markup=False)
    if fleet.trends:
        table = Table(
            "vehicle", "effect", "coefficient", "named in", "sure in", "mean", box=box.SIMPLE_HEAD
        )
        for trend in fleet.trends[:_MOST_ROWS]:
            series = trend.series
            table.add_row(
                series.id,
                series.effect,
                series.coefficient,
                f"{len(series.flights)} of {trend.among}",
                str(sum(series.sure)),
                f"{trend.mean:.3g} {'' if series.unit == '1' else series.unit}",
            )
        console.print(table)
        if len(fleet.trends) > _MOST_ROWS:
            console.print(f"{len(fleet.trends) - _MOST_ROWS} more rows in fleet.html")
    say(*written)
    if not fleet.verdicts:
        raise InputError(
            f"none of {len(found)} logs could be diagnosed; {folder / 'fleet.html'} says why of "
            f"each"
        )
    return fleet_data(fleet)
