"""``python -m studies.probabilities.other_logs``: probabilities of logs that have no posterior, by
the search alone: an IMU in place of the pose, or a pose that was filtered before it was logged.
"""

import argparse
import gzip
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from windwrench.identification.posterior.pooling import SEARCH_ALONE, SIGNS, PoolingSettings
from windwrench.runtime.page_files import write_text
from windwrench.studies.page_tables import put_between, share, table
from windwrench.studies.probabilities.fitting import acts_unknown, fit, is_right, without_posterior
from windwrench.studies.probabilities.flights import OF_TEN, WAYS_TO_LOG, recorded
from windwrench.studies.probabilities.scores import (
    Scored,
    area,
    calibration_interval,
    claims_of,
    cross_fitted,
    error_of_perfect_calibration,
    expected_calibration_error,
    mean_and_interval,
    reliability,
)
from windwrench.studies.resumed_tasks import Task, run_tasks

RESULTS = Path("docs/probabilities/other-logs.json.gz")
POSES = Path("docs/probabilities/results.json.gz")
PAGE_PART = "other logs"
_WEIGHTS = ("sure", "tentative", *SIGNS[:-1])
_TITLES = {"pose": "a pose, without its posterior", "imu": "an IMU", "filtered": "a filtered pose"}


def kind_of(way: str) -> str:
    """Return the key of ``SEARCH_ALONE`` of a way to log."""
    return way if way in SEARCH_ALONE else "imu"


def plan(flights: int, first: int, catalogue: int, simulator: str) -> list[Task]:
    """Return so many flights of each way to log but the pose; half of the filtered ones are of the
    other simulator.
    """
    out: list[Task] = []
    for i in range(flights):
        for j, way in enumerate(WAYS_TO_LOG[1:]):
            own = way != "filtered" or i % 2 == 0
            k = i // 2 if way == "filtered" else i
            if own:
                out.append(("own", OF_TEN[k % len(OF_TEN)], first + flights * j + k, way))
            else:
                out.append(
                    (simulator, "catalogue" if k % 5 else "left out", catalogue + 7 * k, way)
                )
    return out


def _row(title: str, some: Sequence[Scored]) -> list[str]:
    low, high = calibration_interval(some)
    claims = claims_of(some)
    names = [(e, x) for x in some for e in x.flight["named"]]
    sure = [(e, x) for e, x in names if not e["tentative"]]
    unsure = [(e, x) for e, x in names if e["tentative"]]

    def right(of: Sequence[tuple[Mapping[str, Any], Scored]]) -> str:
        return share(sum(is_right(x.flight, e["name"]) for e, x in of), len(of))

    return [
        title,
        f"{len(some)}, {sum(acts_unknown(x.flight) for x in some)}",
        right(sure),
        right(unsure),
        f"{expected_calibration_error(claims):.3f} ({low:.3f} to {high:.3f})",
        f"{error_of_perfect_calibration(claims):.3f}",
        mean_and_interval([x.log_score() for x in some]),
        area(some),
    ]


def _of_kind(
    kind: str, records: Sequence[Mapping[str, Any]], poses: Sequence[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Return the records of a key of ``SEARCH_ALONE``, without a posterior."""
    mine = (
        [{**r, "task": [*r["task"], "pose"]} for r in poses]
        if kind == "pose"
        else [r for r in records if kind_of(r["task"][3]) == kind]
    )
    return [
        {**r, "result": without_posterior(r["result"])}
        for r in mine
        if "refused" not in r["result"]
    ]


def fitted_weights(
    records: Sequence[Mapping[str, Any]], poses: Sequence[Mapping[str, Any]]
) -> dict[str, PoolingSettings]:
    """Return what ``SEARCH_ALONE`` should be by these flights; arguments as of ``tables``."""
    found = {
        kind: fit([r["result"] for r in _of_kind(kind, records, poses)]) for kind in SEARCH_ALONE
    }
    return {k: replace(x, evidence=0.0, other=0.0, structure=0.0) for k, x in found.items()}


def tables(records: Sequence[Mapping[str, Any]], poses: Sequence[Mapping[str, Any]]) -> str:
    """Return the scores as Markdown tables.

    Args:
        records: of ``plan``.
        poses: records of flights whose poses are logged as measured, for the weights of those that
            have no posterior all the same.
    """
    rows, weights, parts = [], [], []
    for kind, in_use in SEARCH_ALONE.items():
        mine = _of_kind(kind, records, poses)
        found = cross_fitted(mine)
        ways = dict.fromkeys(r["task"][3] for r in mine)
        for way in ways:
            some = [x for x, r in zip(found, mine, strict=True) if r["task"][3] == way]
            rows.append(_row(way if len(ways) > 1 else _TITLES[kind], some))
        if kind != "pose":
            title = f"{_TITLES[kind][0].upper()}{_TITLES[kind][1:]}"
            parts += [f"**{title}: names by their probability**"]
            parts += [table(["probability", "mean", "right"], reliability(found))]
        fitted = fitted_weights(records, poses)[kind]
        weights.append(
            [_TITLES[kind]]
            + [f"{getattr(fitted, x):.2f} ({getattr(in_use, x):.2f})" for x in _WEIGHTS]
        )
    head = ["read from", "flights, something unknown acts", "sure names right"]
    head += ["tentative names right", "expected calibration error (95 %)"]
    head += [
        "of a perfect forecaster",
        "log score a flight (95 %)",
        "area under the curve of `unknown`",
    ]
    refused = sum("refused" in r["result"] for r in records)
    parts = [table(head, rows), f"Refused: {share(refused, len(records))}.", *parts]
    parts += ["**Weights, fitted to all these flights (and in use), nats**"]
    parts += [table(["read from", *(f"`{x}`" for x in _WEIGHTS)], weights)]
    return "\n\n".join(parts)


def kept(path: Path) -> list[dict[str, Any]]:
    """Return the records in a file of results."""
    found: list[dict[str, Any]] = json.loads(gzip.decompress(path.read_bytes()))
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="python -m studies.probabilities.other_logs")
    parser.add_argument("--flights", type=int, default=100, help="of each way to log")
    parser.add_argument("--simulator", default="../shared/generator/make_flights.py")
    parser.add_argument("--first", type=int, default=910_000, help="number of the first own flight")
    parser.add_argument("--catalogue", type=int, default=170_000, help="the other's first number")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--out", type=Path, default=Path("results/other-logs"))
    parser.add_argument("--results", type=Path, default=RESULTS, help="what is kept for the page")
    parser.add_argument("--page", type=Path, default=None, help="page whose tables are made anew")
    parser.add_argument("--done", action="store_true", help="score only what has been kept")
    given = parser.parse_args()
    if not given.done:
        wanted = plan(given.flights, given.first, given.catalogue, given.simulator)
        outcomes = run_tasks(recorded, wanted, given.out / "flights.jsonl", given.jobs)
        lines = ",\n".join(
            json.dumps(
                {"task": ["own" if task[0] == "own" else "other", *task[1:]], "result": result}
            )
            for task, result in outcomes.items()
        )
        write_text(f"[\n{lines}\n]\n", given.results)
    text = tables(kept(given.results), kept(POSES))
    put_between(text, given.page, PAGE_PART)
    print(text)
