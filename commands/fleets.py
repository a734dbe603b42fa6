"""Fleets: many logs of many vehicles, one diagnosis each."""

from pathlib import Path
from typing import Any

from ..runtime.errors import InputError
from .flight_logs import AS_THEY_ARE, LogOptions
from .terminal import command_line, console, note, results_folder, say, show_table, working

_MOST_ROWS = 20  # of the table in the terminal


def fleet(
    logs: list[Path],
    manifest: Path | None = None,
    reading: LogOptions = AS_THEY_ARE,
    without: list[str] | None = None,
    cluster: str | None = None,
    jobs: int | None = None,
    limit: float | None = None,
    out: Path = Path("results/fleet"),
) -> dict[str, Any]:
    """Diagnose every log of a fleet by itself. Many at a time; write one page and table of all:
    fleet.html, fleet.json, fleet.csv, fleet.png. A run that was ended goes on.

    Example: windwrench fleet FOLDER --out results/fleet
    """
    from ..dynamics.effects import names
    from ..identification.fleet.drift import fleet_of
    from ..identification.fleet.files import fleet_data, write_fleet
    from ..identification.fleet.manifest import find_logs
    from ..identification.fleet.outcomes import Outcomes
    from ..identification.fleet.page import change_in_words, changes, headline
    from ..identification.fleet.running import LIMIT_S, OUTCOMES, rows, run_fleet
    from ..identification.logs.log_map import load_map
    from ..identification.logs.readers import find_reader
    from ..runtime.errors import unknown_name
    from ..runtime.extras import need

    for name in without or ():
        if name not in names():
            raise unknown_name("effect", name, names(), "--without")
    if reading.reader is not None:
        find_reader(reading.reader)
    if reading.map is not None:
        load_map(reading.map)
    if cluster is not None:
        need("ray", "cluster")
    found, doubts = find_logs(logs, manifest, out, **vars(reading))
    folder = results_folder(out, logs=len(found), jobs=jobs, cluster=cluster)
    for text in doubts:
        note(text)
    outcomes = Outcomes(folder / OUTCOMES)
    with working("diagnosing logs", len(found)) as progress:

        def report(counts: Any) -> None:
            text = f"diagnosing logs ({counts['refused']} refused)"
            progress(sum(counts.values()), text)

        done = run_fleet(
            found, outcomes, tuple(without or ()), limit or LIMIT_S, jobs, cluster, report
        )
    flights = rows(done, outcomes)
    flown = fleet_of(flights)
    written = write_fleet(flown, flights, folder, command_line())
    for sentence in (headline(flown), *(change_in_words(one) for one in changes(flown))):
        console.print(sentence)
    table = [
        (
            *trend.of[:3],
            f"{len(trend.points)} of {trend.among}",
            str(trend.sure_in),
            f"{trend.mean:.3g} {'' if trend.of.unit == '1' else trend.of.unit}",
        )
        for trend in flown.trends
    ]
    if table:
        columns = "vehicle", "effect", "coefficient", "named in", "sure in", "mean"
        show_table(columns, table[:_MOST_ROWS])
    if len(table) > _MOST_ROWS:
        console.print(f"{len(table) - _MOST_ROWS} more rows in fleet.html")
    say(*written)
    if not flown.verdicts:
        raise InputError(
            f"none of {len(found)} logs could be diagnosed; {folder / 'fleet.html'} says why of "
            f"each"
        )
    return fleet_data(flown)
