"""The picture of a wind's profile: torque and force over the place, and the law's limits."""

import math
from pathlib import Path

from ...runtime.drawing import BLACK, ESTIMATE, GREY, JET, SERIES, new_figure, room_above, styled
from ...runtime.page_files import write_png
from ..profile_law import ProfiledJet
from .words import scale_of

_PARTS = ((5, "torque about z", "Nm"), (0, "force along the wind", "N"))


@styled()
def draw_profile(found: ProfiledJet, title: str, path: Path) -> Path:
    """Draw torque about z and force along the wind with their 95 % intervals into a PNG.

    Raises:
        InputError: the file cannot be written.
    """
    figure, p, shape = new_figure(6.2), found.profile, found.shape
    panels = figure.subplots(2, 1, sharex=True, height_ratios=[1.35, 1.0])
    for panel, (part, name, unit) in zip(panels, _PARTS, strict=True):
        scale, unit = scale_of(p.wrench[part], unit)
        panel.plot(p.means[:, 0], scale * p.means[:, 1 + part], ".", color=GREY, ms=2, label="1 s")
        for other, style in zip(found.others, ("--", ":", "-."), strict=False):
            label = f"line at {other.beside:.2f} m"
            panel.plot(other.place, scale * other.wrench[part], style, color=BLACK, label=label)
        low, high = scale * p.low[part], scale * p.high[part]
        panel.fill_between(p.place, low, high, color=ESTIMATE, alpha=0.25, lw=0)
        label = f"line at {p.beside:.2f} m, 95 % interval"
        panel.plot(p.place, scale * p.wrench[part], color=ESTIMATE, lw=1.8, label=label)
        panel.axhline(0.0, color=BLACK, lw=0.5)
        panel.set_ylabel(f"{name} ({unit})")
    if shape is not None:
        panels[0].axvspan(*shape.edges, color=JET, alpha=0.45, lw=0, zorder=0, label="jet")
        for peak, once in zip(shape.peaks, ("beyond, the fan is lost", None), strict=True):
            panels[0].axvline(peak, color=SERIES[1], ls="--", lw=1.1, label=once)
    room_above(panels[0], 0.35)
    panels[0].legend(loc="upper left", ncols=3)
    angle = math.degrees(p.direction)
    panels[1].set_xlabel(f"place along the line (m), {angle:.0f}° from the world's x")
    figure.suptitle(title, parse_math=False)
    write_png(figure, path)
    return path
