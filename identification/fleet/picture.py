"""The picture of a fleet: coefficients from flight to flight, those that drift first."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.page_files import write_figure
from .drift import Fleet, Trend

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_MOST_PANELS = 12
_ACROSS = 3
_BLUE, _ORANGE, _GREY = "#0072b2", "#d55e00", "#6b7483"


def draw_fleet(fleet: Fleet, folder: Path) -> Path:
    """Write ``fleet.png`` and ``fleet.svg``; return the first's path.

    Raises:
        InputError: it cannot be written.
    """
    import matplotlib
    from matplotlib.figure import Figure

    shown = sorted(
        fleet.trends,
        key=lambda one: (not one.told, one.adjusted_p or 1.0, -len(one.points)),
    )[:_MOST_PANELS]
    down = max(1, -(-len(shown) // _ACROSS))
    # names of users may hold what mathematical text would choke on
    with matplotlib.rc_context({"text.parse_math": False, "font.size": 8.0}):
        figure = Figure(figsize=(10.0, 0.5 + 2.1 * down), layout="constrained")
        panels = figure.subplots(down, _ACROSS, squeeze=False).ravel()
        for panel, one in zip(panels, shown, strict=False):
            _draw(panel, one)
        for panel in panels[len(shown) :]:
            panel.set_axis_off()
        if not shown:
            panels[0].text(0.0, 0.5, "No effect was named on any flight.", va="center")
        left = len(fleet.trends) - len(shown)
        figure.suptitle(
            "Coefficients from flight to flight (orange: told as a drift; open: not sure)"
            + (f"; {left} more in fleet.html" if left else "")
        )
        return write_figure(figure, folder, "fleet")


def _draw(panel: "Axes", one: Trend) -> None:
    from matplotlib.ticker import MaxNLocator

    of, colour = one.of, _ORANGE if one.told else _BLUE
    x, y, s = one.points[:, :3].T
    sure = one.points[:, 3] > 0.0
    panel.errorbar(x, y, 1.96 * np.nan_to_num(s), fmt="none", ecolor=_GREY, elinewidth=0.7)
    panel.plot(x[sure], y[sure], "o", color=colour, ms=3.5)
    panel.plot(x[~sure], y[~sure], "o", mfc="white", mec=colour, ms=3.5)
    if one.ends is not None:
        panel.plot([x[0], x[-1]], one.ends, color=colour, lw=1.2)
    unit = "" if of.unit == "1" else f" ({of.unit})"
    panel.set_title(f"{of.id[:24]}: {of.effect}\n{of.coefficient}{unit}", fontsize=8, loc="left")
    panel.spines[["top", "right"]].set_visible(False)
    panel.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4), useMathText=False)
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.set_xlabel("flight")
