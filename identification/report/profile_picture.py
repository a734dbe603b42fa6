"""The picture of a wind's profile: torque and force over the place, and the law's limits."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.drawing import BLACK, ESTIMATE, GREY, JET, SERIES, new_figure, room_above, styled
from ...runtime.page_files import write_png
from ..profile_law import ProfiledJet
from .words import scale_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_PARTS = ((5, "torque about z", "Nm"), (0, "force along the wind", "N"))


@styled()
def draw_profile(found: ProfiledJet, title: str, path: Path) -> Path:
    """Draw torque about z and force along the wind with their 95 % intervals into a PNG.

    Raises:
        InputError: the file cannot be written.
    """
    figure = new_figure(6.2)
    panels = figure.subplots(2, 1, sharex=True, height_ratios=[1.35, 1.0])
    for panel, (part, name, unit) in zip(panels, _PARTS, strict=True):
        _part(panel, found, part, name, unit)
    if found.shape is not None:
        _limits(panels[0], found)
    room_above(panels[0], 0.35)
    panels[0].legend(loc="upper left", ncols=3)
    angle = math.degrees(found.profile.direction)
    panels[1].set_xlabel(f"place along the line (m), {angle:.0f}° from the world's x")
    figure.suptitle(title, parse_math=False)
    write_png(figure, path)
    return path


def _part(panel: "Axes", found: ProfiledJet, part: int, name: str, unit: str) -> None:
    """Draw one part of the wrench over the place, with other lines and hovers."""
    p = found.profile
    low, high = (end[part] for end in p.interval)
    scale, unit = scale_of([float(np.abs(p.wrench[part]).max())], unit)
    for other in found.others:
        label = f"line at {other.beside:.2f} m"
        panel.plot(other.place, scale * other.wrench[part], color=GREY, lw=0.8, label=label)
    panel.fill_between(p.place, scale * low, scale * high, color=ESTIMATE, alpha=0.22, lw=0)
    label = f"line at {p.beside:.2f} m, 95 % interval"
    panel.plot(p.place, scale * p.wrench[part], color=ESTIMATE, lw=1.8, label=label)
    if len(p.hovers):
        place, mean, std = p.hovers[:, 0], p.hovers[:, 1 + part], p.hovers[:, 7 + part]
        style = {"fmt": "o", "ms": 3.0, "lw": 0.8, "color": BLACK, "label": "hovers, 95 %"}
        panel.errorbar(place, scale * mean, 1.96 * scale * std, **style)
    panel.axhline(0.0, color=BLACK, lw=0.5)
    panel.set_ylabel(f"{name} ({unit})")


def _limits(panel: "Axes", found: ProfiledJet) -> None:
    """Mark the jet, the places of the largest torques, and the gain."""
    shape = found.shape
    assert shape is not None
    panel.axvspan(*shape.edges, color=JET, alpha=0.45, lw=0, zorder=0, label="jet")
    for peak in shape.peaks:
        label = "largest torque: beyond, the fan is lost" if peak == shape.peaks[0] else None
        panel.axvline(peak, color=SERIES[1], ls="--", lw=1.1, label=label)
    panel.axvline(shape.centre, color=SERIES[2], ls=":", lw=1.1, label="rest, torque zero")
