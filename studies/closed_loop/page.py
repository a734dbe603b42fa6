"""The page of the loop closed in flight: every number from the results, and sentences that say what
they are worth.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from windwrench.runtime.errors import InputError
from windwrench.runtime.page_files import write_text
from windwrench.runtime.provenance import made_by
from windwrench.studies.closed_loop.closed_loop import DEFAULT_EFFECTS, MARGIN, MEASURES, Measure
from windwrench.studies.closed_loop.wind_section import wind_section

Result = Mapping[str, Any]  # as ``close_loop`` returns it

_SHIFT = 0.01  # m: a mean offset that grows by more is said to


def coefficients_text(
    coefficients: Mapping[str, float], std: Mapping[str, float] | None = None
) -> str:
    """Return coefficients as text, those that are nothing left out, with their standard deviation
    where it is known.
    """
    some = {k: v for k, v in coefficients.items() if v != 0.0} or coefficients
    return ", ".join(
        f"{k} {v:.4g}" + (f" ± {std[k]:.2g}" if std and std.get(k) else "") for k, v in some.items()
    )


def found_text(result: Result) -> str:
    """Return what the diagnosis named, as text."""
    effects = result["diagnosis"]["effects"]
    if not effects:
        return "nothing"
    return "; ".join(
        e["name"]
        + ": "
        + coefficients_text(e["coefficients"], e["std"])
        + (", tentative" if e["tentative"] else "")
        + (f" (or {', '.join(e['indistinguishable_from'])})" if e["indistinguishable_from"] else "")
        for e in effects
    )


def shown(value: float, measure: Measure) -> str:
    """Return a figure in SI as text in the measure's unit."""
    return f"{measure.factor * value:.{3 if measure.factor == 1.0 else 1}f}"


def cell(summary: Mapping[str, Any], measure: Measure) -> str:
    """Return one measure of one effect as text: before, after, and the ratio with its interval."""
    before, after = (shown(summary[m]["mean"], measure) for m in ("declared", "amended"))
    low, high = summary["ratio_ci95"]
    return f"{before} to {after}: x{summary['ratio']:.3f} [{low:.3f}, {high:.3f}]"


def conclusions(results: Sequence[Result]) -> list[str]:
    """Return, as sentences, where declaring the named effects helps, where it makes no difference,
    and where it hurts.
    """
    out = [_in_short(results)]
    for measure in MEASURES:
        groups: dict[str, list[str]] = {"falls": [], "unchanged": [], "rises": []}
        for result in results:
            summary = result["summary"][measure.key]
            text = f"x{summary['ratio']:.2f}"
            if summary["verdict"] == "rises":
                # whether the diagnosis is to blame, or the effect's own model
                exact = summary["exact"]["mean"] / summary["declared"]["mean"]
                text += f", with the exact coefficients x{exact:.2f}"
            groups[summary["verdict"]].append(f"{result['name']} ({text})")
        words = {
            "falls": "falls with",
            "unchanged": f"does not change by a resolved {100 * MARGIN:g} % with",
            "rises": "rises with",
        }
        out.append(
            f"**{measure.title[0].upper()}{measure.title[1:]}** "
            + ". It ".join(f"{words[k]} {', '.join(names)}" for k, names in groups.items() if names)
            + "."
        )
    shifted = [
        r
        for r in results
        if abs(r["mean_offset_m"]["amended"]) > abs(r["mean_offset_m"]["declared"]) + _SHIFT
    ]
    for r in shifted:
        offset = r["mean_offset_m"]
        text = (
            f"With {r['name']} declared the vehicle flies {offset['amended']:+.3f} m beside the "
            f"fan's axis in the mean, "
            f"with the effect undeclared {offset['declared']:+.3f} m."
        )
        if r["request"]["effect"] == "com_offset":
            text += (
                " The filter now gives the torque about the true centre of mass, where the jet's "
                "force has an arm. The "
                "admittance controller steers to where that torque vanishes, which is not the "
                "axis. A better estimate "
                "is not a better command here, because the controller reads torque as offset."
            )
        out.append(text)
    wrong = [
        r["name"]
        for r in results
        if [e["name"] for e in r["diagnosis"]["effects"]] != [r["request"]["effect"]]
    ]
    if not wrong:
        out.append("The diagnosis named each effect that was added, and no other beside it.")
    else:
        out.append(
            f"The diagnosis did not name exactly the effect that was added for: {', '.join(wrong)}."
        )
    lost = {r["name"]: r["lost"] for r in results if any(r["lost"].values())}
    if lost:
        out.append(
            "Lost episodes (declared, amended, exact): "
            + "; ".join(
                f"{name} {n['declared']}, {n['amended']}, {n['exact']}" for name, n in lost.items()
            )
            + "."
        )
    return out


def _in_short(results: Sequence[Result]) -> str:
    def count(keys: Sequence[str], verdict: str) -> int:
        return sum(any(r["summary"][key]["verdict"] == verdict for key in keys) for r in results)

    wrench, tracking = ("force_error_N", "torque_error_Nm"), ("tracking_m",)
    much = sum(any(r["summary"][key]["ratio_ci95"][1] < 0.9 for key in wrench) for r in results)
    return (
        f"Of {len(results)} effects, declaring what the diagnosis named lowers the wrench error "
        f"(force or torque) with "
        f"{count(wrench, 'falls')}, by more than a tenth with {much}. It raises one of the two "
        f"with "
        f"{count(wrench, 'rises')}. It improves tracking with {count(tracking, 'falls')} and makes "
        f"it worse with "
        f"{count(tracking, 'rises')}. The admittance controller reads "
        f"the yaw torque alone: what an "
        f"undeclared effect adds to the "
        "other five components of the estimate does not reach its command."
    )


def command(results: Sequence[Result]) -> str:
    """Return the command line that gives these results."""
    request = results[0]["request"]
    names = [r["name"] for r in results]
    effects = (
        ""
        if tuple(names) == DEFAULT_EFFECTS
        else "".join(
            f" --effect {r['request']['effect']}"
            + (
                ""
                if r["name"] == r["request"]["effect"]
                else ":" + ",".join(f"{k}={v:g}" for k, v in r["request"]["coefficients"].items())
            )
            for r in results
        )
    )
    vehicle = "" if request["vehicle"] == "ardrone2" else f" --vehicle {request['vehicle']}"
    options = f"--episodes {request['episodes']} --seed {request['seed']}"
    return f"windwrench close-loop{effects}{vehicle} {options}"


def write_page(results: Sequence[Result], folder: Path, page: Path) -> None:
    """Write the page from the results whose files and picture lie in a folder.

    Raises:
        InputError: there are no results, or the page cannot be written.
    """
    if not results:
        raise InputError(f"{page}: there are no results to write; expected at least one effect")
    where = Path(os.path.relpath(folder, page.parent)).as_posix()
    out, markdown = (Path(os.path.relpath(path)).as_posix() for path in (folder, page))
    lines = [
        "# The loop closed in flight",
        "",
        *wind_section(folder, where),
        made_by(
            f"{command(results)} --out {out} --markdown {markdown}",
            [r.get("commit") for r in results],
            results[0]["request"]["version"],
        ),
        "",
        *_what_was_done(results[0]["request"]),
        f"![Wrench error and tracking before and after]({where}/close_loop.png)",
        "",
        *_what_is_measured(results[0]["request"]),
        *_errors_table(results),
        *_exact_table(results),
        "## What the diagnosis named",
        "",
        *_findings_table(results, where),
        "## What it is worth",
        "",
    ]
    for sentence in conclusions(results):
        lines += [sentence, ""]
    lines += [
        "The command also writes the picture as SVG, beside the results.",
        "",
    ]
    write_text("\n".join(lines), page)


def _what_was_done(request: Mapping[str, Any]) -> list[str]:
    return [
        "For each effect:",
        "",
        f"1. A vehicle ({request['vehicle']}) that has the effect and does not declare it flies "
        f"{request['seconds']:g} s in "
        "MuJoCo, on a trajectory in which the effect shows.",
        "2. Its log is diagnosed against the declared vehicle (`windwrench diagnose`).",
        "3. The named effects, with the fitted coefficients, go into the model of the wrench "
        "filter; those of the body (mass, "
        "inertia, centre of mass) into the flight loop's, too.",
        f"4. The fan-tracking benchmark (scenario `{request['scenario']}`, controller "
        f"`{request['controller']}`) is flown with "
        "the declared model and with the amended one. The true vehicle has the effect both times, "
        "and the episodes are paired: "
        "fan, gusts, unmodelled disturbance and sensor noise are the same. In a third flight the "
        "effect's exact coefficients "
        "are declared: the bound for any diagnosis.",
        "",
    ]


def _what_is_measured(request: Mapping[str, Any]) -> list[str]:
    return [
        "The wrench error is the difference between the estimate and the true wrench of the jet "
        "together with the actuators' "
        "unmodelled disturbance, in the world frame, about the true centre of mass. The effect's "
        "own share is no part of this "
        "truth in either case, so what of it is left in the estimate counts as error. RMS over the "
        "three axes (yaw torque: the "
        "vertical one, the only one that the admittance controller "
        "reads) and an episode, then the mean "
        "over episodes. What is left "
        "even with the exact model is mostly the filter's rise time: gusts and disturbance change "
        "faster than it follows. "
        "Tracking is the RMS offset from the fan's axis over 20 s.",
        "",
        f"x: mean after by mean before, with the 95 % bootstrap interval over "
        f"{request['episodes']} paired episodes. In words, "
        f"a change counts only where the whole interval lies more than {100 * MARGIN:g} % from "
        f"one. One interval in twenty "
        "misses its ratio by chance.",
        "",
    ]


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    return [
        f"| {' | '.join(header)} |",
        f"|{' --- |' * len(header)}",
        *(f"| {' | '.join(row)} |" for row in rows),
        "",
    ]


def _errors_table(results: Sequence[Result]) -> list[str]:
    rows = []
    for r in results:
        offset = r["mean_offset_m"]
        rows.append(
            [
                r["name"],
                *(cell(r["summary"][m.key], m) for m in MEASURES),
                f"{offset['declared']:+.3f} to {offset['amended']:+.3f}",
            ]
        )
    return _table(["effect", *(f"{m.title} ({m.unit})" for m in MEASURES), "mean offset (m)"], rows)


def _exact_table(results: Sequence[Result]) -> list[str]:
    rows = [
        [r["name"], *(shown(r["summary"][m.key]["exact"]["mean"], m) for m in MEASURES)]
        for r in results
    ]
    return [
        "With the exact coefficients declared, means:",
        "",
        *_table(["effect", *(f"{m.title} ({m.unit})" for m in MEASURES)], rows),
    ]


def _findings_table(results: Sequence[Result], where: str) -> list[str]:
    rows = []
    for r in results:
        added = r["request"]
        rows.append(
            [
                f"{added['effect']}: {coefficients_text(added['coefficients'])}",
                r["trajectory"],
                found_text(r),
                r["diagnosis"]["verdict"],
                f"[{r['name']}.json]({where}/{r['name']}.json)",
            ]
        )
    return _table(
        [
            "added",
            "trajectory of the diagnosed flight",
            "named, ± one standard deviation",
            "verdict",
            "result",
        ],
        rows,
    )
