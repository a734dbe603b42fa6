"""Pictures one after the other as a GIF."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ..runtime.arrays import Picture
from ..runtime.whole_files import replaced
from .scene_shapes import MARKS

_COLOURS = 96
_SAMPLES = 6  # pictures from which colours are chosen
_SHADES, _DARKEST = 4, 0.4  # shades of a mark's colour in the light, and the darkest one's share


def write_gif(pictures: Sequence[Picture], fps: float, path: Path) -> None:
    """Write pictures (height, width, 3) as a GIF, whole or not at all.

    All share the same few colours: these neither flicker nor cost space in every picture.
    """
    from PIL import Image

    sheet = Image.fromarray(np.concatenate(pictures[:: max(1, len(pictures) // _SAMPLES)]))
    # colours are chosen by area and arrows are small: their colours are given
    shares = _DARKEST + (1.0 - _DARKEST) * np.arange(1, _SHADES + 1) / _SHADES
    marks = np.round(255 * np.array(MARKS)[:, None, :3] * shares[:, None]).astype(int)
    few = sheet.quantize(_COLOURS - marks.size // 3, dither=Image.Dither.NONE)
    palette = Image.new("P", (1, 1))
    palette.putpalette([*(few.getpalette() or []), *marks.ravel().tolist()])
    first, *others = (
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in pictures
    )
    with replaced(path) as partial:
        first.save(
            partial,
            format="GIF",
            save_all=True,
            append_images=others,
            duration=round(1000 / fps),
            loop=0,
            optimize=True,  # parts that stay are transparent: 3 to 6 times smaller
        )
