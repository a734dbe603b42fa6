"""The page of the filter with an IMU, and its picture: every number from the results."""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import made_by
from windwrench.studies.inertial.study import AT_FORCE, AT_TORQUE, DOF, NOISES, VEHICLE

Result = Mapping[str, Any]  # as ``study.run`` returns it

_COLOURS = {0: "#4a4a4a", 200: "#edae49", 500: "#30638e", 1000: "#d1495b"}
_KINDS = (("force", "force, mN", AT_FORCE), ("torque", "torque, mNm", AT_TORQUE))


def _name(hz: int) -> str:
    return f"IMU at {hz} Hz" if hz else "pose alone"


def draw(result: Result) -> Figure:
    """Draw rise time against spread, a pose noise a row, force and torque side by side; filled
    where the filter is told the rotors' true noise.
    """
    figure = Figure(figsize=(11.0, 7.6), layout="constrained")
    panels = figure.subplots(len(NOISES), 2, squeeze=False)
    for line, pose in enumerate(NOISES):
        for column, (kind, title, _) in enumerate(_KINDS):
            axes = panels[line][column]
            for row in result["sweep"]:
                if row["pose"] != pose:
                    continue
                told = row["trust"] < 1.0
                found = row[kind]
                axes.loglog(
                    [1e3 * r if r else math.nan for r in found["rise_s"]],
                    [1e3 * s for s in found["spread"]],
                    "o-" if told else "s--",
                    ms=4,
                    lw=1.6 if told else 1.0,
                    mfc=_COLOURS[row["imu_hz"]] if told else "white",
                    color=_COLOURS[row["imu_hz"]],
                    label=_name(row["imu_hz"]) + ("" if told else ", default rotor noise"),
                )
            axes.set_title(f"{kind}, pose noise {pose}", fontsize=10)
            axes.set_xlabel("10-90 % rise time, ms")
            axes.set_ylabel(f"RMS of the {title}")
            axes.grid(alpha=0.25, which="both")
    handles, labels = panels[0][0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9)
    figure.suptitle(
        "Down and to the left is better: how fast the estimate follows a step, and how much it "
        f"scatters ({result['runs']} flights a point)",
        fontsize=11,
    )
    return figure


def _ms(value: float) -> str:
    return "none" if value is None or not math.isfinite(value) else f"{1e3 * value:.0f}"


def _rise(found: Mapping[str, Any]) -> str:
    low, high = found["at_s_ci95"]
    if not math.isfinite(found["at_s"]):
        return "not reached"
    return f"{_ms(found['at_s'])} ({_ms(low)}-{_ms(high)})"


def _at_equal_spread(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    out = [
        f"| pose noise | rotor noise told | sensors | force, ms at {1e3 * AT_FORCE:g} mN | torque, "
        f"ms at {1e3 * AT_TORQUE:g} mNm |",
        "|---|---|---|---|---|",
    ]
    out += [
        f"| {row['pose']} | {'true' if row['trust'] < 1 else 'default, ten times the true'} "
        f"| {_name(row['imu_hz'])} | {_rise(row['force'])} | {_rise(row['torque'])} |"
        for row in rows
    ]
    return [*out, ""]


def _consistency(rows: Sequence[Mapping[str, Any]]) -> tuple[int, list[str]]:
    """Return how many figures lie outside their band, and the table."""
    outside = 0
    out = [
        "| IMU, Hz | pose, Hz | " + " | ".join(f"{n} ({d})" for n, d in DOF.items()) + " |",
        "|---|---|" + "---|" * len(DOF),
    ]
    for row in rows:
        cells = []
        for name in DOF:
            low, high = row[name]["band"]
            inside = low <= row[name]["mean"] <= high
            outside += not inside
            text = f"{row[name]['mean']:.2f} ({low:.2f}-{high:.2f})"
            cells.append(text if inside else f"**{text}**")
        out.append(f"| {row['imu_hz']} | {row['pose_hz']} | " + " | ".join(cells) + " |")
    return outside, [*out, ""]


def _faults(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    labels = ("pose alone", "no gate", "gate")
    out = [
        "| fault | " + " | ".join(labels) + " |",
        "|---|" + "---|" * len(labels),
    ]
    for row in rows:
        cells = (
            f"{1e3 * row[k]['rms_N']:.0f} (largest {1e3 * row[k]['largest_N']:.0f})" for k in labels
        )
        fault = row["fault"].replace("a push", "a transient disturbance")
        out.append(f"| {fault} | " + " | ".join(cells) + " |")
    return [*out, ""]


def write_page(result: Result, data: Path, picture: Path, page: Path) -> None:
    """Write the page from results that lie in a file beside their picture."""
    sweep, checks = result["sweep"], result["consistency"]
    outside, table = _consistency(checks)
    costs = result["costs"]
    lines = [
        "# The filter with an IMU",
        "",
        made_by(
            f"python -m studies.inertial --runs {result['runs']} --seed {result['seed']}",
            [result["commit"]],
            result["version"],
        ),
        "",
        "`correct_imu(gyro, accelerometer)` takes inertial measurements beside a slower pose, and "
        "the filter then also estimates the biases of both ([the filter](estimator.md)). This page "
        f"measures what that gains. Flights of the {VEHICLE} are drawn from the filter's own model "
        "at 1 kHz, with a pose at 100 Hz and biases drawn from their priors. Noise is 0.005 rad/s "
        "for the gyro and 0.05 m/s2 for the accelerometer, a sample. Vibration of a real vehicle "
        "is not part of it.",
        "",
        "## What it does not do",
        "",
        f"* {_losses(sweep)}",
        f"* Of {len(checks) * len(DOF)} consistency figures below, {outside} lie outside their "
        "95 % band" + (" (bold)." if outside else "."),
        "* At one attitude an accelerometer cannot tell its bias from a constant force, unless a "
        "position is measured too. " + _observed(result["observability"]),
        f"* It costs time: a step takes {costs['step_us']:.1f} us without an IMU, "
        f"{costs['step_with_biases_us']:.1f} us with biases, and `correct_imu` "
        f"{costs['correct_imu_us']:.1f} us more.",
        "",
        "## Rise time at equal spread",
        "",
        f"A step of {0.72:.2f} N and 30 mNm. The rise time is that of the mean estimate of "
        f"{result['runs']} flights, from 10 to 90 %, with its 95 % interval (bootstrap over "
        "flights, 1,000 times). Each column has the tuning whose scatter at rest it states. The "
        "rotors' true noise is a tenth of the default tuning's; the filter is told the one or the "
        "other.",
        "",
        *_at_equal_spread(sweep),
        f"![Rise time against spread]({picture.relative_to(page.parent).as_posix()})",
        "",
        "## Consistency",
        "",
        "Flights in which the model holds exactly, with yaw at 1 rad/s. The table has the mean "
        f"over {checks[0]['runs']} flights of 2 s, and the 95 % band of a consistent filter "
        "(degrees of freedom in brackets).",
        "",
        *table,
        "## Faults of the IMU",
        "",
        "RMS and largest error of an axis of the force in mN, during the fault and half a second "
        "after, IMU at 500 Hz, pose noise 1 mm; the gate is 0.999.",
        "",
        *_faults(result["faults"]),
        f"Data: [{data.name}]({data.relative_to(page.parent).as_posix()}).",
        "",
    ]
    write_text("\n".join(lines), page)


def _losses(sweep: Sequence[Mapping[str, Any]]) -> str:
    """Say where an IMU makes the estimate slower at equal spread than the pose alone."""
    worse, compared = [], 0
    for row in sweep:
        if not row["imu_hz"]:
            continue
        alone = next(
            r
            for r in sweep
            if not r["imu_hz"] and (r["pose"], r["trust"]) == (row["pose"], row["trust"])
        )
        for kind, _, _ in _KINDS:
            with_imu, without = row[kind]["at_s"], alone[kind]["at_s"]
            if math.isfinite(with_imu) and math.isfinite(without):
                compared += 1
                if with_imu >= without:
                    worse.append(
                        f"{kind} at {row['pose']} with {_name(row['imu_hz'])} ({_ms(with_imu)} "
                        f"against {_ms(without)} ms)"
                    )
    if not worse:
        return (
            f"In none of the {compared} comparisons at equal spread below does the estimate rise "
            "later with an IMU than without."
        )
    return (
        f"In {len(worse)} of {compared} comparisons at equal spread the estimate rises no earlier "
        f"with an IMU: {'; '.join(worse)}."
    )


def _observed(rows: Sequence[Mapping[str, Any]]) -> str:
    last = max(row["after_s"] for row in rows)
    said = [
        f"with {row['measured']} {row['accelerometer_bias_std']:.3f} m/s2"
        for row in rows
        if row["after_s"] == last and "known" not in row["measured"]
    ]
    return (
        f"After {last:g} s at hover the standard deviation of its bias is " + ", ".join(said) + "."
    )
