"""The page of real faults: every number from the results, losses first."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from windwrench.identification.comparison.change import NOWHERE
from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import made_by
from windwrench.studies.real_faults.study import wilson

Result = Mapping[str, Any]  # as ``study.run`` returns it


def share(count: int, of: int) -> str:
    """Return a count, its share and the share's 95 % interval."""
    if of == 0:
        return "none of 0"
    low, high = (100 * v for v in wilson(count, of))
    return f"{count} of {of} ({100 * count / of:.0f} %, 95 % {low:.0f}-{high:.0f})"


def write_page(result: Result, data: Path, page: Path) -> None:
    """Write the page from results that lie in a file."""
    lines = [
        "# Real faults",
        "",
        made_by(
            f"python -m studies.real_faults --changes {result['changes']} --flights "
            f"{result['flights']} --seed {result['seed']}",
            [result["commit"]],
            result["version"],
        ),
        "",
        "A weak or cut propeller, a weight under an arm, a motor that fails in flight: how often "
        "does this kit find them? It is tried on public measured flights whose truth is known, and "
        "on simulated ones. What it misses comes first.",
        "",
        *_comparisons(result),
        *_searches(result),
        f"Data: [{data.name}]({data.relative_to(page.parent).as_posix()}).",
        "",
    ]
    write_text("\n".join(lines), page)


def _named(rows: Sequence[Mapping[str, Any]]) -> str:
    return f" ({', '.join(row['flight'] for row in rows)})" if rows else ""


def _comparisons(result: Result) -> list[str]:
    rows = result["crazypad"]
    changed = [row for row in rows if row["truth"] != NOWHERE]
    normal = [row for row in rows if row["truth"] == NOWHERE]
    drawn = result["drawn_changes"]
    wrong = [row for row in changed if not row["right"]]
    small = [row for row in wrong if row["place"] == NOWHERE]
    lines = [
        "## Which rotor or side changed between two sets of flights",
        "",
        "`windwrench diagnose flight.csv.gz --against normal1.csv.gz --against normal2.csv.gz "
        "--reader crazypad`",
        "",
        "Data: CrazyPAD (Masalimov and others, Data 2024, 9, 79; MIT), a Crazyflie 2.1 that "
        "carries a weight under a motor or flies with a propeller cut by 3 mm. Known: what was "
        "done to which motor. The logs have motor requests and no pose, no gyro and no "
        "accelerometer. Each flight is compared with the other normal flights of the same "
        "vehicle, one or two.",
        "",
        f"* **Missed**: on {len(small)} of {len(changed)} changed flights *nothing* is likelier "
        f"than any place{_named(small)}. A light weight changes the trim by one to three times the "
        "usual scatter of an unchanged vehicle from flight to flight. A battery is never put in "
        "twice at the same place.",
        f"* The likeliest of all answers is right: "
        f"{share(sum(row['right'] for row in changed), len(changed))}.",
        f"* The likeliest place, if something changed, is right: "
        f"{share(sum(row['right_if_changed'] for row in changed), len(changed))}.",
        f"* Sure and wrong: {share(sum(row['sure_and_wrong'] for row in rows), len(rows))}.",
        f"* Normal against normal, a place is likeliest: "
        f"{share(sum(not row['right'] for row in normal), len(normal))}.",
        "",
        "The intervals are wide: no more flights are at hand. And these flights are no blind "
        "test: the scatter between unchanged flights (`ChangeSettings.scatter`), and its "
        "difference from vehicle to vehicle, were set with these flights. The simulated "
        "changes below are the blind test.",
        "",
        "| flight | truth | likeliest | probability | likeliest place if something changed | "
        "left - right | front - rear | diagonals | total |",
        "| --- | --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        numbers = " | ".join(f"{100 * v:+.1f} %" for v in row["difference"])
        lines.append(
            f"| {row['flight']} | {row['truth']} | {row['place']} | {row['probability']:.2f} | "
            f"{row['if_changed']} | {numbers} |"
        )
    lines += [
        "",
        "### Are the probabilities right?",
        "",
        f"Drawn trims ({result['changes']}): vehicles, batteries, propellers and thrust curves at "
        "random, with one to three flights before and after. In half of them a rotor lost 1 to "
        "40 % of its thrust, or a weight of 1 to 40 % of the vehicle's was added. Requests come "
        "from statics and not from the comparison's own model.",
        "",
        f"* Sure of a wrong place: {share(drawn['sure_of_a_wrong_place'], drawn['sure'])} of what "
        f"was sure. Sure of nothing where a little had changed: "
        f"{share(drawn['sure_of_nothing_and_wrong'], drawn['sure'])}.",
        f"* Of the changed ones the likeliest answer is right: "
        f"{share(drawn['changed_right'], drawn['changed'])}; of the unchanged ones: "
        f"{share(drawn['unchanged_right'], result['changes'] - drawn['changed'])}.",
        "",
        "| stated probability of the likeliest answer | mean | right |",
        "| --- | --- | --- |",
    ]
    for one in drawn["bins"]:
        if one["count"]:
            lines.append(
                f"| {one['from']:g} to {one['to']:g} | {one['mean']:.2f} | "
                f"{share(one['right'], one['count'])} |"
            )
    return [*lines, ""]


def _searches(result: Result) -> list[str]:
    rows = result["drawn_faults"]["rows"]
    kinds = {
        kind: [row for row in rows if row["event"] == kind] for kind in ("fault", "none", "other")
    }
    seen = {kind: [r for r in group if "refused" not in r] for kind, group in kinds.items()}
    faults = seen["fault"]
    right = [row for row in faults if row["named"] == row["rotor"]]
    false = [row for kind in ("none", "other") for row in seen[kind] if row["named"]]
    lines = [
        "## A motor that fails in flight",
        "",
        "`windwrench diagnose flight.ulg --rotor-faults`",
        "",
        "Needs gyro, accelerometer and motor commands; no pose, and nothing of the vehicle but "
        "that it is a quadrotor with a rotor in each quadrant. `windwrench diagnose` asks the same "
        "of every log that can answer, and says so in `report.json` (`rotor_faults`).",
        "",
        "Data: two simulated PX4 logs of the RflyMAD kind, one in software and one with the "
        "autopilot's hardware in the loop, as republished in "
        "lerlis/RLS-fault-diagnosis-for-RflyMAD. Known: the topic `rfly_ctrl_lxl` says which motor "
        "is left with what share, and, at 10 Hz, when. Both end in a tumble in which the gyro "
        "reaches its limit within 0.2 s: nothing later is looked at.",
        "",
        "| log | commanded, between two samples (s) | found | probability | onset (s) | left of "
        "the thrust |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for row in result["motor_faults"]:
        truth = row["commanded"]
        known = "-"
        if truth:
            motors = ", ".join(f"{name} to {100 * v:.0f} %" for name, v in truth["motors"].items())
            known = f"{motors}, {truth['between_s'][0]:.3f} to {truth['between_s'][1]:.3f}"
        found = f"{row['found']}" + (f" ({row['motor']})" if row["motor"] else "")
        onset = left = "-"
        if row["onset_s"] is not None:
            low, high = row["onset_ci95_s"]
            onset = f"{row['onset_s']:.3f} ({low:.3f} to {high:.3f})"
            least, most = (100 * v for v in row["remaining_ci95"])
            left = f"{100 * row['remaining']:.0f} % ({least:.0f} to {most:.0f})"
        chance = max(row["probabilities"].values())
        lines.append(f"| {row['log']} | {known} | {found} | {chance:.3f} | {onset} | {left} |")
    lines += [
        "",
        "These are two logs of one kind, and the search was developed on them. They show that it "
        "works on such logs, not how often.",
        "",
        f"Simulated flights: {result['flights']} with a fault of 5 to 100 % at a random time, half "
        "as many without, half as many with a force and torque that no rotor makes. Vehicles have "
        "0.03 to 3 kg. Thrust curves, lags, gusts, sensors and rates of the log (commands at 10 to "
        "250 Hz) are random, in a simulator of its own (`studies/real_faults/flights.py`).",
        "",
        f"* **Wrong rotor named with a fault**: "
        f"{share(sum(bool(r['named']) and r['named'] != r['rotor'] for r in faults), len(faults))}"
        ", of these sure: "
        f"{sum(bool(r['named']) and r['named'] != r['rotor'] and r['sure'] for r in faults)}.",
        f"* **A rotor named where none failed**: "
        f"{share(len(false), len(seen['none']) + len(seen['other']))}, of these sure: "
        f"{sum(r['sure'] for r in false)}.",
        f"* **Something found where nothing happened** (all rotors, or another force): "
        f"{share(sum(r['likeliest'] != 'nothing' for r in seen['none']), len(seen['none']))}, of "
        "these sure: "
        f"{sum(r['likeliest'] != 'nothing' and r['sure'] for r in seen['none'])}.",
        f"* Another force and torque taken for all rotors at once: "
        f"{share(sum(r['likeliest'] == 'all rotors' for r in seen['other']), len(seen['other']))}"
        ", of these sure: "
        f"{sum(r['likeliest'] == 'all rotors' and r['sure'] for r in seen['other'])}.",
        f"* Refused, too little flight before the model ends to hold: "
        f"{sum('refused' in row for row in rows)} of {len(rows)}.",
        f"* Onset within the stated 95 % interval where the rotor is right: "
        f"{share(sum(r['onset_inside'] for r in right), len(right))}; remaining thrust: "
        f"{share(sum(r['remaining_inside'] for r in right), len(right))}.",
        "",
        "| rotor's loss | named rightly | of these sure | nothing found | another force or all "
        "rotors |",
        "| --- | --- | --- | --- | --- |",
    ]
    for low, high in ((0.05, 0.1), (0.1, 0.2), (0.2, 0.5), (0.5, 1.0)):
        group = [row for row in faults if low <= row["loss"] < high]
        named = [row for row in group if row["named"] == row["rotor"]]
        lines.append(
            f"| {100 * low:.0f} to {100 * high:.0f} % | {share(len(named), len(group))} | "
            f"{sum(r['sure'] for r in named)} | "
            f"{sum(r['likeliest'] == 'nothing' for r in group)} | "
            f"{sum(r['likeliest'] in ('all rotors', 'another force or torque') for r in group)} |"
        )
    return [*lines, ""]
