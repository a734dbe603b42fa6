"""The leaderboard's page, whose tables are kept results of ``windwrench benchmark``."""

import math
from dataclasses import fields
from typing import Any

from windwrench.evaluation.leaderboard import Standing
from windwrench.evaluation.tables import markdown, summary
from windwrench.evidence.kept_results import kept
from windwrench.runtime.provenance import made_by

TASKS = ("WindHover", "WindTrajectory", "FanTracking", "FanTracking2D")


def page() -> dict[str, Any]:
    """Return what the page shows: each task's board with its command."""
    return {"boards": {task: _board(kept(f"results/board/{task}.json.gz")) for task in TASKS}}


def _board(submission: dict[str, Any]) -> dict[str, str]:
    rows = [standing(row) for row in submission["rows"]]
    asked = submission["request"]
    command = (
        f"windwrench benchmark --task {asked['task']} --scenarios {','.join(asked['scenarios'])} "
        f"--controllers {','.join(asked['controllers'])} --seed {asked['seed']}"
    )
    made = made_by(command, [submission["commit"]], submission["windwrench"])
    figures = markdown(rows).partition("\n\n")[0]  # of its two tables
    return {"made": made, "table": f"{summary(rows)}\n{figures}\n"}


def standing(row: dict[str, Any]) -> Standing:
    """Return a row of a leaderboard from its file: null is not a number, but for a p-value."""
    values: dict[str, Any] = {
        field.name: math.nan
        if row[field.name] is None and field.name != "p_over_best"
        else row[field.name]
        for field in fields(Standing)
    }
    return Standing(**values)
