"""The page of estimates from logs, and its picture: every number from the results."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import made_by
from windwrench.studies.log_estimates.study import EVERY, FAR, JUMP, SHARE

Result = Mapping[str, Any]  # as ``study.run`` returns it

_NEAR_BEST, _SMOOTH_N, _SMOOTH_NM = 1.15, 0.03, 0.002  # targets
_ISOLATED, _BURST = 1.15, 2.0
_BARS = (
    ("given", "default tuning, 1 s", "#c9c9c9"),
    ("given, smoothed", "the same, smoothed", "#8a8a8a"),
    ("fitted", "tuning fitted to the log", "#edae49"),
    ("best", "best tuning, truth known", "#d1495b"),
    ("fitted, smoothed", "fitted, smoothed", "#30638e"),
)


def draw(result: Result) -> Figure:
    """Draw the errors of force and torque on each flight, a bar for each tuning."""
    rows = result["accuracy"]
    figure = Figure(figsize=(12.0, 6.6), layout="constrained")
    panels = figure.subplots(2, 1, sharex=True)
    where = np.arange(len(rows))
    for axes, kind, unit in zip(panels, ("force", "torque"), ("mN", "mNm"), strict=True):
        for i, (key, label, colour) in enumerate(_BARS):
            axes.bar(
                where + 0.16 * (i - 2),
                [1e3 * row[key][kind] for row in rows],
                0.15,
                color=colour,
                label=label,
            )
        axes.set_yscale("log")
        axes.set_ylabel(f"RMSE of the {kind}, {unit}")
        axes.grid(alpha=0.25, axis="y")
    panels[1].set_xticks(where, [row["flight"].replace(", ", "\n") for row in rows], fontsize=9)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=5, frameon=False)
    return figure


def _times(value: float) -> str:
    return f"{value:.2f}" if value < 10.0 else f"{value:.0f}"


def _accuracy(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    out = [
        "| flight | NIS before, after | rise, s | default | fitted | best | fitted / best "
        "| fitted, smoothed |",
        "| --- | --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        cells = [
            f"{1e3 * row[key]['force']:.1f}; {1e3 * row[key]['torque']:.2f}"
            for key in ("given", "fitted", "best")
        ]
        ratios = [row["fitted"][k] / row["best"][k] for k in ("force", "torque")]
        both = "; ".join(f"**{r:.2f}**" if r > _NEAR_BEST else f"{r:.2f}" for r in ratios)
        smooth = row["fitted, smoothed"]
        last = "; ".join(
            f"**{1e3 * v:.2f}**" if v > most else f"{1e3 * v:.2f}"
            for v, most in ((smooth["force"], _SMOOTH_N), (smooth["torque"], _SMOOTH_NM))
        )
        out.append(
            f"| {row['flight']} | {row['nis_before']:.2f}, {row['nis_after']:.2f} "
            f"| {row['rise_s']:.2f} | {' | '.join(cells)} | {both} | {last} |"
        )
    return [*out, ""]


def _poses(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    out = [
        "| flights | bad poses | filter | smoothed | no gate |",
        "| --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        most = _ISOLATED if "%" in row["case"] else _BURST
        cells = []
        for key in ("filter", "smoothed", "no gate"):
            found = row[key]
            low, high = (_times(v) for v in found["ci95"])
            text = f"{_times(found['ratio'])} ({low}-{high}), {_times(found['largest'])}"
            cells.append(f"**{text}**" if found["ratio"] > most and key != "no gate" else text)
        out.append(f"| {row['flights']} ({row['count']}) | {row['case']} | {' | '.join(cells)} |")
    return [*out, ""]


def _jumps(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    out = [
        "| vehicle | filter | restarted | after, s | force error |",
        "| --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        low, high = row["ci95"]
        out.append(
            f"| {row['vehicle']} | {row['filter']} | {row['restarted']} of {row['count']} "
            f"| {row['after_s']:.2f} | {row['ratio']:.3f} ({low:.3f}-{high:.3f}) |"
        )
    return [*out, ""]


def _losses(result: Result) -> list[str]:
    rows, spoiled = result["accuracy"], result["outliers"]
    out = []
    for kind, most, unit in (("force", _SMOOTH_N, "mN"), ("torque", _SMOOTH_NM, "mNm")):
        over = [
            f"{row['flight']} ({row['fitted'][kind] / row['best'][kind]:.2f})"
            for row in rows
            if row["fitted"][kind] > _NEAR_BEST * row["best"][kind]
        ]
        out.append(
            f"* Fitted {kind} tuning more than 15 % worse than the best that knows the truth: "
            + (f"{len(over)} of {len(rows)} flights: {'; '.join(over)}." if over else "none.")
            + (" In the hover no torque acts." if kind == "torque" and over else "")
        )
        rough = [
            f"{row['flight']} ({1e3 * row['fitted, smoothed'][kind]:.3g} {unit})"
            for row in rows
            if row["fitted, smoothed"][kind] > most
        ]
        out.append(
            f"* Smoothed {kind} off by more than {1e3 * most:g} {unit}: "
            + (f"{len(rough)} of {len(rows)} flights: {'; '.join(rough)}." if rough else "none.")
        )
    isolated = [r["filter"]["ratio"] for r in spoiled if "%" in r["case"]]
    out.append(
        f"* Isolated bad poses raise the filter's error by at most "
        f"{100 * (max(isolated) - 1):.0f} % (mean of a group of flights)."
    )
    dear = [r for r in spoiled if "bursts" in r["case"] and r["filter"]["ratio"] > _BURST]
    count = sum("bursts" in r["case"] for r in spoiled)
    if dear:
        out.append(
            f"* In {len(dear)} of {count} groups a burst more than doubles the filter's error "
            "while it lasts, all where the filter is fast. Without any pose the force of that time "
            "is not known better: see the gaps beside. The groups:"
        )
        out += [f"    * {r['case']}, {r['flights']}: {_times(r['filter']['ratio'])}" for r in dear]
    return out


def write_page(result: Result, data: Path, picture: Path, page: Path) -> None:
    """Write the page from results that lie in a file beside their picture."""
    # the first flight's include what is compiled once
    smoothing = median(row["given, smoothed"]["seconds"] for row in result["accuracy"])
    fitting = median(row["fit_s"] for row in result["accuracy"])
    command = (
        f"python -m studies.log_estimates --seconds {result['seconds']:g} "
        f"--flights {result['flights']} --seed {result['seed']}"
    )
    lines = [
        "# How good the wrench from a log is",
        "",
        made_by(command, [result["commit"], result.get("poses_commit")], result["version"]),
        "",
        "`windwrench estimate` reads a log, and `--tune` fits the filter's noise to it "
        "([the filter](estimator.md)). Here the true wrench is known.",
        "",
        "## Where it falls short",
        "",
        *_losses(result),
        "",
        "## Tuning and smoothing",
        "",
        f"{len(result['accuracy'])} flights of {result['seconds']:g} s of RotorPy's Hummingbird, "
        "with its aerodynamics and wind; the declared vehicle has neither, so they are the "
        "external wrench. Pose noise 1 mm and 5 mrad at 200 Hz. RMSE over all axes, force in mN; "
        f"torque in mNm, without the first 2 s. Default: a rise time of 1 s. Best: the walk and "
        "white noise for which the filter's error is least, found with the truth. Rise: that of "
        "the horizontal force as fitted. Bold: a target missed (15 % of the best; 30 mN; 2 mNm).",
        "",
        *_accuracy(result["accuracy"]),
        f"![Errors by tuning]({picture.relative_to(page.parent).as_posix()})",
        "",
        f"Smoothing a flight of {result['seconds']:g} s, the filter's run included, took "
        f"{smoothing:.1f} s, fitting the tuning {fitting:.1f} s: medians of the flights, on a "
        "machine that was busy with other work.",
        "",
        "## Bad poses",
        "",
        f"The error of the force over that of the clean log: {100 * SHARE:g} % of the poses, or "
        f"all poses of a burst every {EVERY:g} s, lie {100 * FAR:g} cm off. For a "
        "burst, the error is that while it lasts. Ratio of pooled errors, its 95 % interval "
        "(flights drawn anew, 2,000 times), and "
        "the largest of one flight. The gaps have no pose at all for as long: no gate can do "
        "better. The kit's vehicles fly in five times the usual disturbance, calmly and fast.",
        "",
        *_poses(result["outliers"]),
        "## A pose that moves for good",
        "",
        f"By {JUMP:g} m, half way. When the filter restarts there, and the error of the force from "
        "2 s later on over that of the clean log.",
        "",
        *_jumps(result["jumps"]),
        f"Data: [{data.name}]({data.relative_to(page.parent).as_posix()}).",
        "",
    ]
    write_text("\n".join(lines), page)
