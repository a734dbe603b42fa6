"""One file a submission: the referee's seed, every episode's figures, the code behind them, and a
hash over the results.
"""

import hashlib
import json
import os
import platform
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import __version__
from ..runtime.page_files import write_text
from ..runtime.plain_values import plain
from ..runtime.provenance import commit, package_versions
from .benchmark import Request, Results
from .leaderboard import SETTLED, Standing, figures, flights_of, ranking_figures
from .statistics import (
    hierarchical_draws,
    interquartile_mean,
    interval_of,
    probability_of_improvement,
)
from .tasks import task_of

_FIGURES = ("rmse_settled", "rmse_transient", "total_reward", "lost", "uses_truth")


def over_all(rows: Sequence[Standing], results: Results) -> list[dict[str, Any]]:
    """Return each controller over all scenarios: the interquartile mean of its episodes' scores,
    and its probability of improvement over the rival, with 95 % intervals.

    A score is 0 at the mean of ``hover`` in its scenario, and 1 at the oracle's. Definitions are
    rliable's; the bootstrap is stratified by scenario, over policies and episodes.
    """
    flown_task, over_all_rows = task_of(rows[0].task), []
    of_controller: dict[str, list[Standing]] = {}
    for row in rows:
        of_controller.setdefault(row.controller, []).append(row)
    for name, in_worlds in of_controller.items():
        scores, better = [], []
        for row in in_worlds:
            laws = {law: [results[law, row.scenario]] for law in flown_task.references(())}
            by, ranked = ranking_figures({name: flights_of(row, results)} | laws)
            start, end = ranked["hover"].mean(), ranked.get("oracle", np.array(np.nan)).mean()
            scores.append((start - ranked[name]) / (start - end))
            better.append((-ranked[name], -ranked[flown_task.rival]))
        strata = [each.shape[1] for each in scores]
        x, y = (np.hstack(part) for part in zip(*better, strict=True))
        draws = hierarchical_draws(probability_of_improvement, x, y, strata=strata)
        stated: dict[str, Any] = {
            "controller": name,
            "improvement_over_rival": probability_of_improvement(x, y),
            "improvement_ci95": interval_of(draws),
        }
        if by == SETTLED and np.isfinite(scores[0]).all():
            score = np.hstack(scores)
            draws = hierarchical_draws(interquartile_mean, score, strata=strata)
            stated |= {"iqm_score": interquartile_mean(score), "iqm_ci95": interval_of(draws)}
        over_all_rows.append(stated)
    return over_all_rows


def results_hash(data: Mapping[str, Any]) -> str:
    """Return the SHA-256 of a submission's request, rows and flights, as canonical JSON."""
    hashed = {key: data[key] for key in ("request", "rows", "over_all", "flights")}
    text = json.dumps(hashed, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def write_submission(
    request: Request, rows: Sequence[Standing], results: Results, folder: Path
) -> Path:
    """Write ``submission.json``, at once or not at all; return its path."""
    flights = [
        {
            "controller": name,
            "scenario": scenario,
            "seeds": [episode.seed for episode in flown],
            **{key: figures([flown], key)[0] for key in _FIGURES},
        }
        for (name, scenario), flown in results.items()
    ]
    named = (*request.controllers, *request.scenarios, request.task, request.reward or "")
    files = {re.sub(r"(\.(?:py|ya?ml)):.*", r"\1", name) for name in named}
    data: dict[str, Any] = {
        "windwrench": __version__,
        "commit": commit(),
        "python": platform.python_version(),
        "packages": package_versions(),
        "files": {
            name: hashlib.sha256(Path(name).read_bytes()).hexdigest()
            for name in sorted({*files, *request.imports})
            if os.path.isfile(name)
        },
        "request": request,
        "rows": rows,
        "over_all": over_all(rows, results),
        "flights": flights,
    }
    path = folder / "submission.json"
    data = plain(data)
    data["sha256"] = results_hash(data)
    write_text(json.dumps(data, indent=1, allow_nan=False) + "\n", path)
    return path
