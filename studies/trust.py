"""The page "How far to trust it", of kept results of the studies."""

from collections.abc import Mapping
from typing import Any

from windwrench.studies import measured_flights
from windwrench.studies.kept_results import kept
from windwrench.studies.probabilities import calibration
from windwrench.studies.trials.__main__ import RESULTS
from windwrench.studies.trials.held_back_outsiders import UNSEEN
from windwrench.studies.trials.judgements import judge, rules


def page() -> dict[str, Any]:
    """Return what the page shows."""
    return {
        "benchmark": kept("identify/nanodrone.json"),
        "flights": measured_flights.shown(),
        "probabilities": calibration.shown(),
        "trials": _trials(kept(RESULTS)),
    }


def _trials(result: Mapping[str, Any]) -> dict[str, Any]:
    judged = [j for outcome in result["trials"] for j in judge(outcome)]
    measured = rules(judged)
    (doubted,) = (rule.measured for rule in measured if "rightly none" in rule.subject)
    return {
        "command": f"python -m studies.trials --seed {result['seed']} --seeds {result['seeds']}",
        "version": result["version"],
        "commit": result["commit"],
        "flights": len(result["trials"]),
        "diagnoses": len(judged),
        "rules": measured,
        "doubted": doubted,
        "unseen": list(UNSEEN),
    }
