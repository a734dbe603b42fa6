"""``python -m studies.trials`` diagnoses simulated flights whose true effects are known."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from windwrench import __version__
from windwrench.runtime.page_files import write_json
from windwrench.runtime.provenance import commit
from windwrench.studies.pages import DOCS, write_page
from windwrench.studies.runner import Jobs, Page, start
from windwrench.studies.trials.judgements import judge, rules
from windwrench.studies.trials.page import RESULTS, page
from windwrench.studies.trials.trials import plan, run_trials, stamp


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
    markdown: Page = None,
    out: Annotated[Path, typer.Option(help="Folder of outcomes.")] = Path("results/trials"),
) -> None:
    """Simulate flights with known effects, diagnose and score them; a repeated command resumes."""
    code = commit()  # before the flights: the code that flies
    outcomes = run_trials(plan(seeds, quick, seed, group or ()), out, jobs)
    measured = rules(j for outcome in outcomes for j in judge(outcome))
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
    page_file = markdown or out / "trials.md"
    in_docs = page_file.resolve().parent == DOCS
    write_json(result, DOCS / RESULTS if in_docs else out / "trials.json.gz", allow_nan=True)
    for rule in measured:
        met = {True: "met", False: "not met", None: "-"}[rule.met]
        print(f"{met:8}{rule.subject}: {rule.measured}; target: {rule.target}")
    print(write_page("diagnosis-trials", page(result), page_file))


if __name__ == "__main__":
    start(study)
