"""The page of faults: every number from the results."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import made_by
from windwrench.studies.faults.study import LONGEST

Result = Mapping[str, Any]  # as ``study.run`` returns it


def write_page(result: Result, data: Path, page: Path) -> None:
    """Write the page from results that lie in a file."""
    lines = [
        "# What faults do to the estimators",
        "",
        made_by(
            f"python -m studies.faults --count {result['count']} --steps {result['steps']} "
            f"--seed {result['seed']}",
            [result["commit"]],
            result["version"],
        ),
        "",
        "Does an estimator recover after bad measurements? The vehicle hovers under an "
        "upward force of a tenth of the weight. Steps take 1 ms to 0.1 s, with gates and "
        "without. At every step the state must be finite and the covariance positive definite. "
        "Faults are:",
        "",
        "* no pose for up to 30 s, or a position or an attitude alone;",
        "* poses that jump by 1 mm to 1 km, once, for good or back and forth;",
        "* poses that are upside down or turned at random;",
        "* wrong rotor speeds;",
        "* starts up to 180 degrees off.",
        "",
        "## After one to three faults",
        "",
        "An estimator is judged two rise times after good samples are back. It is *wrong* if it "
        "is not tracking, or a component of the wrench is off by more than three of its own "
        "standard deviations. With a gate it has 0.7 s more: the gate needs 0.6 s to accept a "
        "jump. All estimators get the same sequences.",
        "",
        "| estimator | sequences | not finite | wrong | 95 % | of these at steps of 50 ms or more "
        "| faults most often among them |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in sorted(result["sequences"], key=lambda row: -row["wrong"]):
        low, high = (100 * v for v in row["ci95"])
        kinds = ", ".join(f"{name} ({count})" for name, count in row["worst_kinds"])
        lines.append(
            f"| {row['estimator']} | {row['count']} | {row['not_finite']} | {row['wrong']} "
            f"({100 * row['wrong'] / row['count']:.1f} %) | {low:.1f}-{high:.1f} % "
            f"| {row['long_steps']} | {kinds} |"
        )
    lines += [
        "",
        "Wrong rotor speeds make a wrench of a whole weight that never acted. Poses that are "
        "upside down, or turn at random, for longer than the gate refuses them are accepted, "
        "with the wrench that they imply. Where later poses contradict such a wrench, its "
        "standard deviation becomes as large as itself. Where they do not, it decays with "
        "the filter's rise time, to 1 % after two of them. Its standard deviation, which "
        "knows of the random walk alone, does not show that. An estimated mass goes back to "
        "its prior when it is contradicted ([the filter](estimator.md)).",
        "",
        "## A long flight",
        "",
        f"Faults of up to {LONGEST:g} s and 2.7 s of good samples by turns, AR.Drone at 200 Hz, "
        "gate 0.999. Right: the wrench is within three standard deviations before the next fault.",
        "",
        "| estimator | steps | faults | restarts | right | 95 % |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in result["soak"]:
        low, high = (100 * v for v in row["ci95"])
        lines.append(
            f"| {row['estimator']} | {row['steps']:,} | {row['faults']} | {row['restarts']} "
            f"| {row['right']} ({100 * row['right'] / row['faults']:.0f} %) "
            f"| {low:.0f}-{high:.0f} % |"
        )
    lines += ["", f"Data: [{data.name}]({data.relative_to(page.parent).as_posix()}).", ""]
    write_text("\n".join(lines), page)
