"""A fleet's results on the disk: ``fleet.json``, ``fleet.csv``, ``fleet.html`` and ``fleet.png``.
Flights are written as they are read: none are held.
"""

import csv
import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ... import __version__
from ...runtime.whole_files import replaced
from ..report.files import plain
from .drift import Fleet
from .page import write_page
from .picture import draw_fleet

FlightRow = Mapping[str, Any]
_COLUMNS = (
    *("id", "flight", "log", "time", "vehicle", "status", "reason", "verdict", "residual"),
    *("effect", "coefficient", "value", "std", "unit", "tentative", "indistinguishable_from"),
    *("force_before_N", "force_after_N", "torque_before_Nm", "torque_after_Nm"),
)


def write_fleet(
    fleet: Fleet, rows: Callable[[], Iterable[FlightRow]], folder: Path, command: str
) -> list[Path]:
    """Write the results of a fleet, each file whole or not at all; return their paths.

    Args:
        fleet: what the flights say together.
        rows: gives the flights anew at each call, as ``running.rows`` does.
        folder: it is there.
        command: the command line, for the page.

    Raises:
        InputError: a file cannot be written.
    """
    table, numbers, page = folder / "fleet.csv", folder / "fleet.json", folder / "fleet.html"
    with replaced(table) as partial, open(partial, "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, _COLUMNS)
        writer.writeheader()
        for row in rows():
            writer.writerows(_lines(row))
    with replaced(numbers) as partial, open(partial, "w", encoding="utf-8") as file:
        head = json.dumps(fleet_data(fleet), indent=1, allow_nan=False)
        file.write(head.removesuffix("\n}") + ',\n "flights": [')
        for i, row in enumerate(rows()):
            file.write(("," if i else "") + "\n  " + json.dumps(row, allow_nan=False))
        file.write("\n ]\n}\n")
    write_page(fleet, rows, page, command)
    return [page, numbers, table, draw_fleet(fleet, folder)]


def fleet_data(fleet: Fleet) -> dict[str, Any]:
    """Return what ``fleet.json`` holds besides its flights, and what the command returns: plain
    values, None for what is not finite.
    """
    trends = []
    for one in fleet.trends:
        data = asdict(one)
        series = data.pop("series")
        trends.append(
            {
                **{key: series[key] for key in ("id", "effect", "coefficient", "unit", "flights")},
                "named_in": len(series["flights"]),
                "sure_in": sum(series["sure"]),
                **data,
            }
        )
    found: dict[str, Any] = plain(
        {
            "version": __version__,
            "logs": sum(sum(counts.values()) for counts in fleet.individuals.values()),
            "individuals": fleet.individuals,
            "refused": fleet.refused,
            "verdicts": fleet.verdicts,
            "trends": trends,
            "appearances": [asdict(one) for one in fleet.appearances],
        }
    )
    return found


def _lines(row: FlightRow) -> Iterable[dict[str, Any]]:
    """Yield a flight's lines of the table: one a coefficient, or one if there is none."""
    line = {key: row.get(key) for key in _COLUMNS[:8]}
    line["residual"] = row.get("remainder")
    if row["status"] == "diagnosed":
        for side in ("before", "after"):
            error = row["error"][side]
            line[f"force_{side}_N"] = error["force_rms_N"]
            line[f"torque_{side}_Nm"] = error["torque_rms_Nm"]
    if not row.get("effects"):
        yield line
        return
    for effect in row["effects"]:
        for name, value in effect["coefficients"].items():
            yield {
                **line,
                "effect": effect["name"],
                "coefficient": name,
                "value": value,
                "std": effect["std"].get(name),
                "unit": effect["units"].get(name),
                "tentative": effect["tentative"],
                "indistinguishable_from": " ".join(effect["indistinguishable_from"]),
            }
