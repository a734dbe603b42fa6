"""What a film says beside its picture: time, what the arrows are, numbers, score, and a scale."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .scene_shapes import ESTIMATED, TRUE, TURNING, TURNING_TRUE

Picture = NDArray[np.uint8]
Array = NDArray[np.float64]

_HEIGHT = 540  # pixels, of the picture that sizes below are for
_MARGIN, _LINE = 14, 21
_FONT, _SMALL = 16, 14
_INK, _PAPER = (28, 36, 48), (255, 255, 255)
_STEPS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # m, of a scale
_WIDE, _NARROW = 8, 3  # pixels of a line in the legend: true, estimated


@dataclass(frozen=True)
class Caption:
    """What is said of one picture."""

    title: str  # of the film
    time: float  # s
    force: Array  # (3,) N, estimated
    torque_z: float  # Nm, estimated, about the vertical
    true_force: Array | None  # (3,) N; None: nobody knows it
    true_torque_z: float | None  # Nm
    lines: tuple[str, ...]  # what else is said, such as the offset and the score
    pixels_per_metre: float  # at the vehicle
    scales: tuple[float, float]  # m that 1 N and 1 Nm are drawn as


@cache
def _font(size: int, bold: bool) -> Any:
    from matplotlib import get_data_path
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(f"{get_data_path()}/fonts/ttf/{name}", size)


def scale_of(pixels_per_metre: float, longest: float) -> float:
    """Return the length, m, of a scale of a round number that is at most ``longest`` pixels
    long.
    """
    fitting = [step for step in _STEPS if step * pixels_per_metre <= longest]
    return fitting[-1] if fitting else _STEPS[0]


def with_caption(picture: Picture, caption: Caption) -> Picture:
    """Return a picture (height, width, 3) with its caption."""
    from PIL import Image, ImageDraw

    height, width = picture.shape[:2]
    size = height / _HEIGHT
    image = Image.fromarray(picture)
    draw = ImageDraw.Draw(image)
    margin, line = round(_MARGIN * size), round(_LINE * size)
    plain, small, bold = (
        _font(max(8, round(points * size)), heavy)
        for points, heavy in ((_FONT, False), (_SMALL, False), (_FONT, True))
    )

    def write(x: float, y: float, text: str, font: Any, anchor: str = "la") -> None:
        draw.text((x, y), text, _INK, font, anchor, stroke_width=2, stroke_fill=_PAPER)

    write(margin, margin, caption.title, bold)
    write(width - margin, margin, f"{caption.time:.1f} s", bold, "ra")

    # the legend: a wide pale arrow is the truth, a narrow dark one the estimate, as in the picture
    rows: tuple[tuple[str, int, Array, Any, Callable[[Any], str]], ...] = (
        ("true force", _WIDE, TRUE, caption.true_force, _newtons),
        ("estimated force", _NARROW, ESTIMATED, caption.force, _newtons),
        ("true yaw torque", _WIDE, TURNING_TRUE, caption.true_torque_z, _millis),
        ("estimated yaw torque", _NARROW, TURNING, caption.torque_z, _millis),
    )
    middle = margin + 2.0 * line
    for label, stroke, mark, value, told in rows:
        if value is None:
            continue
        colour = tuple(np.round(255 * mark[:3]).astype(int).tolist())
        shown = margin, middle, margin + 34 * size, middle
        draw.line(shown, colour, max(1, round(stroke * size)))
        write(margin + 44 * size, middle, label, small, "lm")
        write(margin + 305 * size, middle, told(value), small, "rm")
        middle += line
    y = margin + 1.5 * line
    for text in caption.lines:
        write(width - margin, y + 0.5 * line, text, plain, "rm")
        y += line

    length = scale_of(caption.pixels_per_metre, 0.2 * width)
    right, below = margin + length * caption.pixels_per_metre, height - margin - 0.4 * line
    draw.line((margin, below, right, below), _INK, max(1, round(3 * size)))
    for x in (margin, right):
        draw.line((x, below - 5 * size, x, below + 5 * size), _INK, max(1, round(2 * size)))
    write(
        margin,
        below - 8 * size,
        f"this long: {length:g} m at the vehicle, {_short(length / caption.scales[0])} N, "
        f"{_short(1e3 * length / caption.scales[1])} mNm",
        small,
        "lb",
    )
    return np.asarray(image, dtype=np.uint8)


def _short(value: float) -> str:
    """Return a number with two digits at least and no exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def _newtons(force: Array) -> str:
    return f"{float(np.linalg.norm(force)):.2f} N"


def _millis(torque: float) -> str:
    size = abs(1e3 * torque)
    digits = 0 if size >= 10.0 else 1 if size >= 1.0 else 2
    return f"{round(1e3 * torque, digits) + 0.0:+.{digits}f} mNm"
