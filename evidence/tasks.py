"""The page of the tasks: tables of ``windwrench benchmark --task``, and what the felt wrench is
worth.
"""

from typing import Any

from windwrench.evidence.kept_results import kept

TASKS = ("WindHover", "WindTrajectory", "FanTracking2D")


def page() -> dict[str, Any]:
    """Return what the page shows: rows of each task, and rows by controller and scenario."""
    tasks = {task: shown(kept(f"results/tasks/{task}.json.gz")) for task in TASKS}
    return {
        "tasks": tasks,
        "felt": kept("results/tasks/felt_wrench.json"),
        "hover": _by_name(tasks["WindHover"]),
        "trajectory": _by_name(tasks["WindTrajectory"]),
        "fan": _by_name(tasks["FanTracking2D"]),
    }


def shown(rows: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the rows without policies that the row of their kind counts."""
    kinds = {row["controller"] for row in rows if row["policies"] > 1}
    return [row for row in rows if row["controller"].rpartition("-")[0] not in kinds]


def _by_name(rows: list[dict[str, Any]]) -> dict[str, dict[str, dict[str, Any]]]:
    found: dict[str, dict[str, dict[str, Any]]] = {}
    for row in rows:
        found.setdefault(row["controller"], {})[row["scenario"]] = row
    return found
