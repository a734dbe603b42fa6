"""A fleet's results on the disk: ``fleet.json``, ``.csv``, ``.html`` and ``.png``."""

import csv
import io
import json
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from ... import __version__
from ...runtime.page_files import write_text
from ...runtime.plain_values import plain
from .drift import Fleet
from .page import fleet_page
from .picture import draw_fleet

FlightRow = Mapping[str, Any]
_COLUMNS = (
    *("id", "flight", "log", "time", "session"),
    *("vehicle", "status", "reason", "verdict", "residual"),
    *("effect", "coefficient", "value", "std", "unit", "tentative", "indistinguishable_from"),
    *("force_before_N", "force_after_N", "torque_before_Nm", "torque_after_Nm"),
)


def write_fleet(fleet: Fleet, rows: Sequence[FlightRow], folder: Path, command: str) -> list[Path]:
    """Write the results of a fleet, each file whole or not at all; return their paths.

    Args:
        fleet: what the flights say together.
        rows: the flights, as ``running.rows`` returns them.
        folder: it is there.
        command: the command line, for the page.

    Raises:
        InputError: a file cannot be written.
    """
    page, numbers, table = (folder / f"fleet.{end}" for end in ("html", "json", "csv"))
    lines = io.StringIO()
    writer = csv.DictWriter(lines, _COLUMNS)
    writer.writeheader()
    for row in rows:
        writer.writerows(_lines(row))
    write_text(lines.getvalue(), table)
    data = {**fleet_data(fleet), "flights": rows}
    write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", numbers)
    write_text(fleet_page(fleet, rows, command), page)
    return [page, numbers, table, draw_fleet(fleet, folder)]


def fleet_data(fleet: Fleet) -> dict[str, Any]:
    """Return what ``fleet.json`` holds besides its flights, and what the command returns: plain
    values, None for what is not finite.
    """
    found: dict[str, Any] = plain(
        {
            "version": __version__,
            "logs": sum(sum(counts.values()) for counts in fleet.individuals.values()),
            "individuals": fleet.individuals,
            "refused": fleet.refused,
            "verdicts": fleet.verdicts,
            "trends": [
                {
                    **one.of._asdict(),
                    "flights": one.points[:, 0].astype(int).tolist(),
                    "named_in": len(one.points),
                    "sure_in": one.sure_in,
                    "drifts": one.told,
                    **{k: x for k, x in vars(one).items() if k not in ("of", "points")},
                }
                for one in fleet.trends
            ],
            "appearances": [{**vars(one), "changed": one.told} for one in fleet.appearances],
        },
        6,
    )
    return found


def _lines(row: FlightRow) -> Iterable[dict[str, Any]]:
    """Yield a flight's lines of the table: one a coefficient, or one if there is none."""
    line = {key: row.get(key) for key in _COLUMNS[:9]} | {"residual": row.get("remainder")}
    for side in ("before", "after") if row["status"] == "diagnosed" else ():
        line[f"force_{side}_N"] = row["error"][side]["force_rms_N"]
        line[f"torque_{side}_Nm"] = row["error"][side]["torque_rms_Nm"]
    if not row.get("effects"):
        yield line
    for effect in row.get("effects", ()):
        line |= {
            "effect": effect["name"],
            "tentative": effect["tentative"],
            "indistinguishable_from": " ".join(effect["indistinguishable_from"]),
        }
        for name, value in effect["coefficients"].items():
            std, unit = effect["std"].get(name), effect["units"].get(name)
            yield {**line, "coefficient": name, "value": value, "std": std, "unit": unit}
