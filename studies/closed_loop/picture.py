"""The picture of the loop closed in flight: errors before and after, an effect a row."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from windwrench.runtime.page_files import write_figure
from windwrench.studies.closed_loop.closed_loop import MEASURES, Measure

Result = Mapping[str, Any]  # as ``close_loop`` returns it

_BEFORE, _AFTER, _EXACT = "#d1495b", "#30638e", "#8a8a8a"
_APART = 0.13  # rows, between before and after
_FACES = {"falls": _AFTER, "rises": _BEFORE, "unchanged": "#4a4a4a"}  # of the ratio's text


def draw(results: Sequence[Result]) -> Figure:
    """Draw wrench errors and tracking before and after, an effect a row, with 95 % intervals of the
    means and the ratio.
    """
    figure = Figure(figsize=(15.5, 1.9 + 0.48 * len(results)), layout="constrained")
    panels = figure.subplots(1, len(MEASURES), sharey=True, squeeze=False)[0]
    for axes, measure in zip(panels, MEASURES, strict=True):
        _draw_measure(axes, measure, results)
    panels[0].set_yticks(range(len(results)), [r["name"] for r in results])
    panels[0].set_ylim(len(results) - 0.4, -0.6)
    request = results[0]["request"]
    handles, labels = panels[0].get_legend_handles_labels()
    kinds = dict(zip(labels, handles, strict=True))  # one of a kind, not one a row
    figure.legend(
        list(kinds.values()), list(kinds), loc="outside lower center", ncols=3, frameon=False
    )
    figure.suptitle(
        "An effect that nobody declared, before and after it was named from a flight log and "
        "declared.  "
        f"{request['episodes']} paired episodes of fan tracking an effect; bars: 95 % of a mean, "
        f"brackets: of the "
        "paired ratio",
        fontsize=11,
    )
    return figure


def _draw_measure(axes: Any, measure: Measure, results: Sequence[Result]) -> None:
    top = 0.0
    for row, result in enumerate(results):
        summary = result["summary"][measure.key]
        before, after, exact = (
            measure.factor * summary[m]["mean"] for m in ("declared", "amended", "exact")
        )
        above, below = row - _APART, row + _APART
        axes.plot([before, after], [above, below], color="#c9c9c9", lw=2, zorder=1)
        axes.plot(
            exact,
            below,
            "|",
            color=_EXACT,
            ms=15,
            mew=2,
            zorder=2,
            label="exact coefficients declared",
        )
        for model, y, value, colour, fill, text in (
            ("declared", above, before, _BEFORE, "white", "effect not declared"),
            ("amended", below, after, _AFTER, _AFTER, "named by the diagnosis, declared"),
        ):
            low, high = (measure.factor * v for v in summary[model]["ci95"])
            axes.errorbar(
                value,
                y,
                xerr=[[max(value - low, 0.0)], [max(high - value, 0.0)]],
                fmt="o",
                color=colour,
                mfc=fill,
                ms=5,
                lw=1.3,
                zorder=3,
                label=text,
            )
            top = max(top, high)
    axes.set_xlim(0.0, 1.75 * top)
    for row, result in enumerate(results):
        summary = result["summary"][measure.key]
        low, high = summary["ratio_ci95"]
        axes.annotate(
            f"x{summary['ratio']:.2f} [{low:.2f}, {high:.2f}]",
            (1.0, row),
            xycoords=("axes fraction", "data"),
            ha="right",
            va="center",
            fontsize=7.5,
            color=_FACES[summary["verdict"]],
        )
    axes.set_title(f"{measure.title} ({measure.unit})", loc="left", fontsize=10)
    axes.grid(axis="x", alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)


def write_picture(results: Sequence[Result], folder: Path) -> Path:
    """Write ``close_loop.png`` and ``.svg``, the same bytes for the same results; return the
    first's path.
    """
    return write_figure(draw(results), folder, "close_loop")
