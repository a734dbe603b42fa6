"""``python -m studies.trials`` diagnoses simulated flights whose true effects are known."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from windwrench import __version__
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit
from windwrench.studies.kept_results import DOCS
from windwrench.studies.runner import Jobs, start
from windwrench.studies.trials.judgements import judge, rules
from windwrench.studies.trials.misses import misses
from windwrench.studies.trials.trials import plan, run_trials, stamp

RESULTS = "diagnosis-trials/trials.json.gz"  # below docs/


def study(
    seeds: Annotated[
        int, typer.Option(min=1, help="Number of seeds: every flight is flown once with each.")
    ] = 1,
    seed: Annotated[int, typer.Option(min=0, help="First random seed.")] = 0,
    quick: Annotated[
        bool, typer.Option("--quick", help="Fly a subset only (takes minutes).")
    ] = False,
    group: Annotated[
        list[str] | None,
        typer.Option(help="Group of flights to run, such as pair; may be repeated."),
    ] = None,
    jobs: Jobs = 1,
    keep: Annotated[
        bool,
        typer.Option("--keep", help=f"Keep the results as docs/{RESULTS}, which a page shows."),
    ] = False,
    out: Annotated[Path, typer.Option(help="Folder of outcomes.")] = Path("results/trials"),
) -> None:
    """Simulate flights with known effects, diagnose and score them; a repeated command resumes."""
    code = commit()  # before the flights: the code that flies
    outcomes = run_trials(plan(seeds, quick, seed, group or ()), out, jobs)
    judged = [j for outcome in outcomes for j in judge(outcome)]
    measured = rules(judged)
    result: dict[str, Any] = {
        "version": __version__,
        "commit": code,
        "code": stamp(),
        "seed": seed,
        "seeds": seeds,
        "quick": quick,
        "groups": group or [],
        "rules": [asdict(rule) for rule in measured],
        "trials": outcomes,
    }
    file = DOCS / RESULTS if keep else out / "trials.json.gz"
    write_json(result, file, allow_nan=True)
    print(*misses(judged), sep="\n")
    for rule in measured:
        met = {True: "met", False: "not met", None: "-"}[rule.met]
        print(f"{met:8}{rule.subject}: {rule.measured}; target: {rule.target}")
    print(file)


if __name__ == "__main__":
    start(study)
