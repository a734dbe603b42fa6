"""The page of the tasks: what the felt wrench is worth."""

from typing import Any

from windwrench.evidence.kept_results import kept


def page() -> dict[str, Any]:
    """Return what the page shows."""
    return {"felt": kept("results/tasks/felt_wrench.json")}
