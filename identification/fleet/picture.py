"""The picture of a fleet: coefficients from flight to flight, those that drift first."""

from pathlib import Path

import numpy as np

from ...runtime.drawing import AFTER, BEFORE, GREY, new_figure, styled
from ...runtime.page_files import write_figure
from .drift import Fleet

_MOST_PANELS = 12
_ACROSS = 3


@styled()
def draw_fleet(fleet: Fleet, folder: Path) -> Path:
    """Write ``fleet.png`` and ``fleet.svg``; return the first's path.

    Raises:
        InputError: it cannot be written.
    """
    from matplotlib.ticker import MaxNLocator

    shown = sorted(
        fleet.trends,
        key=lambda one: (not one.told, one.adjusted_p or 1.0, -len(one.points)),
    )[:_MOST_PANELS]
    down = max(1, -(-len(shown) // _ACROSS))
    figure = new_figure(0.5 + 1.9 * down)
    panels = figure.subplots(down, _ACROSS, squeeze=False).ravel()
    for panel, one in zip(panels, shown, strict=False):
        of, colour = one.of, BEFORE if one.told else AFTER
        x, y, s = one.points[:, :3].T
        sure = one.points[:, 3] > 0.0
        panel.errorbar(x, y, 1.96 * np.nan_to_num(s), fmt="none", ecolor=GREY, elinewidth=0.7)
        panel.plot(x[sure], y[sure], "o", color=colour, ms=3.5)
        panel.plot(x[~sure], y[~sure], "o", mfc="white", mec=colour, ms=3.5)
        if one.ends is not None:
            panel.plot([x[0], x[-1]], one.ends, color=colour, lw=1.2)
        unit = "" if of.unit == "1" else f" ({of.unit})"
        # names of users may hold what mathematical text would choke on
        panel.set_title(f"{of.id[:24]}: {of.effect}\n{of.coefficient}{unit}", parse_math=False)
        panel.ticklabel_format(axis="y", style="sci", scilimits=(-3, 4), useMathText=False)
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
        panel.set_xlabel("flight")
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
