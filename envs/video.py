"""Films: pictures one after the other as an mp4 or a GIF, whole or not at all."""

from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from matplotlib.image import imsave
from numpy.typing import NDArray

from ..runtime.extras import need
from ..runtime.whole_files import replaced
from .scene_shapes import MARKS

Picture = NDArray[np.uint8]

FPS = 12.5  # of an episode: a picture a decision
_GIF_WIDTH = 960  # pixels
_GIF_COLOURS = 96
_GIF_SAMPLES = 6  # pictures from which colours are chosen
_SHADES, _DARKEST = 4, 0.4  # of a mark's colour in the light, and the darkest one's share of it


class Film:
    """Appends pictures to a ``.mp4`` or ``.gif`` file that appears only when it is whole.

    Args:
        path: of the film; its ending says which kind.
        width: of the pictures, in pixels; a GIF is made narrower.
        height: likewise.
        fps: pictures a second.
        longest: s of film, after which pictures are left out; default: none are.

    Raises:
        InputError: an mp4 without the video extra.
    """

    def __init__(
        self, path: Path, width: int, height: int, fps: float = FPS, longest: float | None = None
    ) -> None:
        self.path, self.width, self.height, self.fps = path, width, height, fps
        self._left = None if longest is None else max(1, round(longest * fps))
        self._whole = ExitStack()
        self._stream: Any = None
        self._pictures: list[Any] = []
        if path.suffix == ".mp4":
            need("imageio_ffmpeg", "video", path)
            import imageio_ffmpeg

            self._stream = imageio_ffmpeg.write_frames(
                str(self._whole.enter_context(replaced(path))),
                (width, height),
                fps=fps,
                quality=7,
                macro_block_size=16,
                output_params=["-f", "mp4"],
            )
            self._stream.send(None)
            self._whole.callback(self._stream.close)  # first, and then the film takes its place

    def add(self, picture: Picture | None) -> None:
        """Append a picture (height, width, 3); None, which a window returns, is none."""
        if picture is None or self.is_full:
            return
        if self._left is not None:
            self._left -= 1
        if self._stream is not None:
            self._stream.send(picture.tobytes())
            return
        from PIL import Image

        width = min(_GIF_WIDTH, self.width)
        size = width, round(self.height * width / self.width)
        self._pictures.append(Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS))

    @property
    def is_full(self) -> bool:
        """Whether no more pictures are wanted."""
        return self._left == 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._whole.__exit__(kind, error, trace)
        if kind is None and self._pictures:
            first, *others = _reduced(self._pictures)
            with replaced(self.path) as partial:
                first.save(
                    partial,
                    format="GIF",
                    save_all=True,
                    append_images=others,
                    duration=round(1000 / self.fps),
                    loop=0,
                    optimize=False,
                )


def _reduced(images: list[Any]) -> list[Any]:
    """Return images in the same few colours, which neither flicker nor cost space
    in every picture.
    """
    from PIL import Image

    width, height = images[0].size
    some = images[:: max(1, len(images) // _GIF_SAMPLES)]
    sheet = Image.new("RGB", (width, height * len(some)))
    for i, image in enumerate(some):
        sheet.paste(image, (0, i * height))
    # arrows are small, and colours are chosen by the area that they cover: theirs are given
    marks = [
        round(255 * float(c) * (_DARKEST + (1.0 - _DARKEST) * (i + 1) / _SHADES))
        for colour in MARKS
        for i in range(_SHADES)
        for c in colour[:3]
    ]
    few = sheet.quantize(_GIF_COLOURS - len(marks) // 3, dither=Image.Dither.NONE)
    palette = Image.new("P", (1, 1))
    palette.putpalette([*(few.getpalette() or []), *marks])
    return [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]


def save_picture(picture: Picture, path: Path) -> None:
    """Write a picture (height, width, 3) as a PNG."""
    with replaced(path) as partial:
        imsave(partial, picture, format="png")
