"""Writing an episode as a film."""

from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from matplotlib.image import imsave
from numpy.typing import NDArray

from ..dynamics.errors import InputError
from ..dynamics.files import replaced
from .fan_tracking import FanTrackingEnv


class VideoWriter:
    """Appends pictures of an environment to an mp4; it and the last picture beside it appear only when it is whole.

    Raises:
        InputError: the video extra is not installed.
    """

    def __init__(self, path: Path, env: FanTrackingEnv) -> None:
        try:
            import imageio_ffmpeg
        except ImportError as error:
            raise InputError("--video needs the video extra: pip install 'windwrench[video]'") from error
        self.path, self.env = path, env
        self._partial = path.with_suffix(".partial.mp4")
        self._stream: Any = imageio_ffmpeg.write_frames(
            str(self._partial), (env.width, env.height), fps=12.5, quality=7, macro_block_size=16)
        self._stream.send(None)
        self._last: NDArray[np.uint8] | None = None

    def add(self) -> None:
        """Append a picture of the environment as it is now."""
        self._last = self.env.render()
        if self._last is not None:
            self._stream.send(self._last.tobytes())

    def __enter__(self) -> "VideoWriter":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self._stream.close()
        if kind is None:
            self._partial.replace(self.path)
            if self._last is not None:
                with replaced(self.path.with_suffix(".scene.png")) as partial:
                    imsave(partial, self._last, format="png")
        else:
            self._partial.unlink(missing_ok=True)
