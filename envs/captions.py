"""Pictures of an episode with words: time, arrows, errors, score, and a scale."""

from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

import numpy as np

from ..runtime.arrays import Array, Picture
from .scene_shapes import ESTIMATED, TRUE, TURNING, TURNING_TRUE
from .task import Task

_HEIGHT = 540  # pixels, of the picture for which sizes are stated
_MARGIN, _LINE = 14, 21
_FONT, _SMALL = 16, 14
_INK, _PAPER = (28, 36, 48), (255, 255, 255)
_STEPS = (0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0)  # m, of a scale
_WIDE, _NARROW = 8, 3  # pixels of a line in the legend: true, estimated


@cache
def _font(size: int, bold: bool) -> Any:
    from matplotlib import get_data_path
    from PIL import ImageFont

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return ImageFont.truetype(f"{get_data_path()}/fonts/ttf/{name}", size)


def captioned(env: Task, title: str, flown: Sequence[Mapping[str, Any]]) -> Picture:
    """Return a task's picture (height, width, 3) with its caption.

    Args:
        env: the task, drawn as ``"rgb_array"``.
        title: the episode's.
        flown: ``info`` of its decisions so far.
    """
    from PIL import Image, ImageDraw

    image = Image.fromarray(np.asarray(env.render()))
    loop, viewer, info = env.loop, env.many.viewers[0], flown[-1]
    width, height = image.size
    size = height / _HEIGHT
    draw = ImageDraw.Draw(image)
    margin, line = round(_MARGIN * size), round(_LINE * size)

    def write(
        x: float, y: float, text: str, anchor: str, points: int = _SMALL, bold: bool = False
    ) -> None:
        font = _font(max(8, round(points * size)), bold)
        draw.text((x, y), text, _INK, font, anchor, stroke_width=2, stroke_fill=_PAPER)

    write(margin, margin, title, "la", _FONT, True)
    write(width - margin, margin, f"{info['time']:.1f} s", "ra", _FONT, True)

    # the legend: a wide pale arrow is the truth, a narrow dark one the estimate, as in the picture
    middle = margin + 2.0 * line
    for label, stroke, mark, label_text in (
        ("true force", _WIDE, TRUE, _newtons(loop.external[:3])),
        ("estimated force", _NARROW, ESTIMATED, _newtons(loop.state[16:19])),
        ("true yaw torque", _WIDE, TURNING_TRUE, _millis(loop.external[5])),
        ("estimated yaw torque", _NARROW, TURNING, _millis(loop.state[15])),
    ):
        colour = tuple(np.round(255 * mark[:3]).astype(int).tolist())
        shown = margin, middle, margin + 34 * size, middle
        draw.line(shown, colour, max(1, round(stroke * size)))
        write(margin + 44 * size, middle, label, "lm")
        write(margin + 305 * size, middle, label_text, "rm")
        middle += line
    for row, text in enumerate(_scores(flown)):
        write(width - margin, margin + (2.0 + row) * line, text, "rm", _FONT)

    pixels = viewer.pixels_per_metre(loop.position)
    length = max((s for s in _STEPS if s * pixels <= 0.2 * width), default=_STEPS[0])
    right, below = margin + length * pixels, height - margin - 0.4 * line
    draw.line((margin, below, right, below), _INK, max(1, round(3 * size)))
    for x in (margin, right):
        draw.line((x, below - 5 * size, x, below + 5 * size), _INK, max(1, round(2 * size)))
    newtons, millis = length / viewer.scales[0], 1e3 * length / viewer.scales[1]
    label_text = (
        f"this long: {length:g} m at the vehicle, {_short(newtons)} N, {_short(millis)} mNm"
    )
    write(margin, below - 8 * size, label_text, "lb")
    return np.asarray(image, dtype=np.uint8)


def _scores(flown: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return errors, mean reward and wind of the decisions so far, a line each."""
    errors = np.abs([each.get("error", each.get("offset")) for each in flown])
    score = np.mean([each["reward_tracking"] for each in flown])
    lines = [
        f"error {errors[-1]:.2f} m",
        f"RMSE so far {np.sqrt(np.mean(errors**2)):.2f} m",
        f"score {score:.2f} (mean reward, best 1)",
    ]
    if (wind := flown[-1].get("wind")) is not None:
        lines.append(f"wind {np.linalg.norm(wind):.1f} m/s")
    return lines


def _short(value: float) -> str:
    """Return a number with two digits at least and no exponent."""
    return f"{value:.0f}" if value >= 10.0 else f"{value:.2g}"


def _newtons(force: Array) -> str:
    return f"{np.linalg.norm(force):.2f} N"


def _millis(torque: float) -> str:
    size = abs(1e3 * torque)
    digits = 0 if size >= 10.0 else 1 if size >= 1.0 else 2
    return f"{round(1e3 * torque, digits) + 0.0:+.{digits}f} mNm"
