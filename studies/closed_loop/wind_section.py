"""The part of the page, and the picture, that show the amended model in the flight loop."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from windwrench import __version__
from windwrench.runtime.page_files import write_figure
from windwrench.runtime.provenance import made_by
from windwrench.studies.closed_loop.closed_loop import DEFAULT_EFFECTS, MARGIN
from windwrench.studies.closed_loop.wind_tasks import (
    ADAPTIVE,
    LAWS,
    SETTINGS,
    Setting,
    compare,
    result_path,
)
from windwrench.studies.page_tables import table

_ASKED = 7  # effects that are better by a tenth, with none worse: what was asked of one task
_MUCH = 0.9  # a ratio whose whole interval lies below it is an improvement by a tenth
_PICTURE = "in_flight"
_TITLES = {"hover": "flight loop alone", "pid-force": "with the estimated force (`pid-force`)"}
_COLOURS = ("#d1495b", "#30638e")


def _results(folder: Path) -> list[tuple[Setting, Mapping[str, Any]]]:
    """Return the settings in which all effects were flown, with their results from a folder."""
    found = [
        (setting, json.loads(result_path(folder, setting).read_text(encoding="utf-8")))
        for setting in SETTINGS
        if result_path(folder, setting).exists()
    ]
    return [(s, result) for s, result in found if set(result["effects"]) >= set(DEFAULT_EFFECTS)]


def wind_section(folder: Path, where: str) -> list[str]:
    """Return the lines of the page on the flight loop; none where nothing was flown.

    Args:
        folder: of the results.
        where: the same folder as the page names it.
    """
    found = _results(folder)
    if not found:
        return []
    request = found[0][1]["request"]
    lines = [
        "## The amended model in the flight loop",
        "",
        made_by(
            f"python -m studies.closed_loop.in_flight --episodes {request['episodes']} "
            f"--seed {request['seed']}",
            [result["commit"] for _, result in found],
            __version__,
        ),
        "",
        "It flies the settings below on what the diagnosis found (further down). "
        "In the tasks in the wind the flight loop uses the model that its vehicle declares:",
        "",
        "* the wrench of the declared effects at the reference is subtracted from what the rotors "
        "have to make;",
        "* commands go through the inverse of what the rotors deliver, and a motor lag is "
        "compensated by a lead, as if the command were held for 20 ms;",
        "* mass, inertia and centre of mass are the model's;",
        "* sensing effects are removed from the pose first.",
        "",
        "The external wrench that is left is estimated as without these effects.",
        "",
        f"Before: the effect is not declared. After: as diagnosed. Exact: its true coefficients. "
        f"RMSE of the position in m, mean of {request['episodes']} paired episodes; x: mean after "
        "by mean before with its 95 % bootstrap interval. `l1` and `indi` adapt without knowing "
        "the effect (declared model, the same episodes).",
        "",
        *_reached(found),
        "",
        "Setting by setting:",
        "",
        *[f"* {_in_words(setting, result)}" for setting, result in found],
        "",
        "Motor lag gains least: an attitude loop of these gains is not limited by it. A surplus of "
        "thrust (battery sag: a full battery delivers 5 % more than declared) and drag damp an "
        "undeclared vehicle's errors in `pid-force`. With the effect declared, this damping is "
        "lost. What is left with the exact model is the actuators' unmodelled disturbance "
        "(0.01 Nm, 0.03 N) and, in `base`, the wind: no model of an effect lowers that. The quick "
        "attitude loop lowers that floor, and was added after the first results were seen. Its "
        "attitude gains are 440 and 36 in place of 110 and 18, before and after alike.",
        "",
        f"![Tracking before and after, each effect]({where}/{_PICTURE}.png)",
        "",
        "Data: "
        + ", ".join(
            f"[{setting.title}]({where}/{result_path(folder, setting).name})"
            for setting, _ in found
        )
        + ".",
        "",
    ]
    for setting, result in found:
        lines += [f"### {setting.title}", "", _table(result), ""]
    return [*lines, "## The loop closed in fan tracking", ""]


def _reached(found: Sequence[tuple[Setting, Mapping[str, Any]]]) -> list[str]:
    """Return, as lines, where what was asked is reached, and where it is missed."""
    reached: list[str] = []
    missed: list[str] = []
    for setting, result in found:
        for law in LAWS:
            by = [compare(flown, law) for flown in result["effects"].values()]
            much = sum(c["ci95"][1] < _MUCH for c in by)
            worse = sum(c["ci95"][0] > 1.0 + MARGIN for c in by)
            told = f"{setting.title}, {_TITLES[law]} ({much} of {len(by)}, worse: {worse})"
            (reached if much >= _ASKED and not worse else missed).append(told)
    lines = [
        f"Asked was a resolved improvement of a tenth with {_ASKED} of {len(DEFAULT_EFFECTS)} "
        "effects in one task, and none worse."
    ]
    for word, where in (("Missed", missed), ("Reached", reached)):
        if where:
            lines += ["", f"{word}:", "", *(f"* {told}" for told in where)]
        else:
            lines += ["", f"{word}: nowhere."]
    return lines


def _in_words(setting: Setting, result: Mapping[str, Any]) -> str:
    parts = []
    for law in LAWS:
        by = {name: compare(flown, law) for name, flown in result["effects"].items()}
        much = [n for n, c in by.items() if c["ci95"][1] < _MUCH]
        better = [n for n, c in by.items() if c["ci95"][1] < 1.0 - MARGIN]
        worse = [f"{n} (x{c['ratio']:.2f})" for n, c in by.items() if c["ci95"][0] > 1.0 + MARGIN]
        parts.append(
            f"{_TITLES[law]}: worse with {', '.join(worse) or 'none'}; better by a resolved tenth "
            f"with {len(much)} of {len(by)}, by a resolved {100 * MARGIN:g} % with {len(better)}"
        )
    beats = [
        n
        for n, f in result["effects"].items()
        if min(_mean(f, f"{law} declared") for law in ADAPTIVE) < _mean(f, "hover amended")
    ]
    both = [
        n
        for n, f in result["effects"].items()
        if min(_mean(f, f"{law} declared") for law in ADAPTIVE) < _mean(f, "pid-force amended")
    ]
    lost = sum(f["lost"] for flown in result["effects"].values() for f in flown.values())
    return (
        f"**{setting.title}**: {parts[0]}. {parts[1][0].upper()}{parts[1][1:]}. The better of `l1` "
        f"and `indi`, without the effect, has a smaller mean than the flight loop alone with the "
        f"amended model on {len(beats)} of {len(result['effects'])} effects. It has a smaller mean "
        f"than `pid-force` with that model on {len(both)}. Lost episodes: {lost}."
    )


def _mean(flown: Mapping[str, Any], key: str) -> float:
    values = flown[key]["rmse_m"]
    return float(sum(values) / len(values))


def _table(result: Mapping[str, Any]) -> str:
    rows = []
    for name, flown in result["effects"].items():
        row = [name]
        for law in LAWS:
            c = compare(flown, law)
            row += [
                f"{c['before']:.4f} to {c['after']:.4f}: x{c['ratio']:.3f} [{c['ci95'][0]:.3f}, "
                f"{c['ci95'][1]:.3f}]",
                f"{_mean(flown, f'{law} exact'):.4f}",
            ]
        rows.append([*row, *(f"{_mean(flown, f'{law} declared'):.4f}" for law in ADAPTIVE)])
    heads = [text for law in LAWS for text in (_TITLES[law], "exact")]
    return table(["effect", *heads, *(f"`{law}`, not knowing" for law in ADAPTIVE)], rows)


def write_wind_picture(folder: Path) -> None:
    """Draw before and after of every effect and setting into the folder."""
    found = _results(folder)
    if found:
        write_figure(_draw(found), folder, _PICTURE)


def _draw(found: Sequence[tuple[Setting, Mapping[str, Any]]]) -> Figure:
    figure = Figure(figsize=(13, 1.0 + 3.6 * len(found)), layout="constrained")
    grid = figure.subplots(len(found), len(LAWS), squeeze=False, sharey="row")
    for line, (setting, result) in zip(grid, found, strict=True):
        names = list(result["effects"])
        for axes, law in zip(line, LAWS, strict=True):
            _draw_panel(axes, result, law)
            title = f"{setting.title}: {_TITLES[law]}".replace("`", "")
            axes.set_title(title, loc="left", fontsize=9.5)
        line[0].set_yticks(range(len(names)), names)
        line[0].set_ylim(len(names) - 0.4, -0.6)
    handles, labels = grid[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, frameon=False)
    return figure


def _draw_panel(axes: Any, result: Mapping[str, Any], law: str) -> None:
    first, top = True, 0.0
    for row, flown in enumerate(result["effects"].values()):
        c = compare(flown, law)
        for key, at, colour, text in (
            ("before", row - 0.13, _COLOURS[0], "effect not declared"),
            ("after", row + 0.13, _COLOURS[1], "as diagnosed, declared"),
        ):
            low, high = c[f"{key}_ci95"]
            axes.plot([low, high], [at, at], color=colour, lw=1.3)
            axes.plot(c[key], at, "o", color=colour, ms=5, label=text if first else None)
            top = max(top, high)
        for key, mark, colour, text in (
            (f"{law} exact", "|", "#4a4a4a", "exact"),
            ("l1 declared", "x", "#2a9d8f", "l1, not declared"),
            ("indi declared", "+", "#8d5a97", "indi, not declared"),
        ):
            axes.plot(
                _mean(flown, key),
                row + (0.13 if mark == "|" else 0.0),
                mark,
                color=colour,
                ms=8,
                mew=1.5,
                label=text if first else None,
            )
            top = max(top, _mean(flown, key))
        axes.annotate(
            f"x{c['ratio']:.2f} [{c['ci95'][0]:.2f}, {c['ci95'][1]:.2f}]",
            (1.0, row),
            xycoords=("axes fraction", "data"),
            ha="right",
            va="center",
            fontsize=7.5,
            color=_COLOURS[0] if c["ci95"][0] > 1.0 + MARGIN else "#4a4a4a",
        )
        first = False
    axes.set_xlim(0.0, 1.45 * top)
    axes.set_xlabel("RMSE (m)")
    axes.grid(axis="x", alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
