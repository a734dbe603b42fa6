"""Films of a flight: what each picture says, and where it goes."""

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from ..envs.captions import Caption, with_caption
from ..envs.video import FPS, Film, save_picture

SIZE = 960, 540  # pixels


def caption_of(loop: Any, viewer: Any, title: str, flown: Sequence[Mapping[str, Any]]) -> Caption:
    """Return the caption of a picture of a task's closed loop, after its decisions so far."""
    state, external, info = loop.state, loop.external, flown[-1]
    errors = np.abs([each.get("error", each.get("offset")) for each in flown])
    score = np.mean([each["reward_tracking"] for each in flown])
    lines = [
        f"error {errors[-1]:.2f} m",
        f"RMSE so far {np.sqrt(np.mean(errors**2)):.2f} m",
        f"score {score:.2f} (mean reward, best 1)",
    ]
    if (wind := info.get("wind")) is not None:
        lines.append(f"wind {np.linalg.norm(wind):.1f} m/s")
    return Caption(
        title,
        float(info["time"]),
        state[16:19].copy(),
        float(state[15]),
        external[:3].copy(),
        float(external[5]),
        tuple(lines),
        viewer.pixels_per_metre(loop.position),
        viewer.scales,
    )


@contextmanager
def films(
    folder: Path,
    name: str,
    kinds: list[str],
    seconds: float,
    every: int = 1,
    fps: float = FPS,
    still: str = "scene.png",
) -> Iterator[tuple[Callable[[Callable[[], Any], Callable[[], Caption]], None], list[Path]]]:
    """Give what films a decision, and the paths of what is filmed: the former takes what draws, and
    what tells the caption after that.

    Args:
        folder: for the films ``name.gif`` and ``name.mp4``, and the last picture.
        name: of the films.
        kinds: ``gif``, ``mp4`` or both.
        seconds: after which nothing is filmed.
        every: so many decisions there is a picture; a GIF alone, which is large, has half of
            them.
        fps: decisions a second.
        still: ending of the last picture's name.
    """
    every *= 2 if kinds == ["gif"] else 1
    fps /= every
    last, counts = None, itertools.count(1)
    paths = [folder / f"{name}.{kind}" for kind in kinds]
    scene = folder / f"{name}.{still}"
    with ExitStack() as stack:
        made = [stack.enter_context(Film(path, *SIZE, fps, seconds)) for path in paths]

        def add(draw: Callable[[], Any], caption: Callable[[], Caption]) -> None:
            nonlocal last
            wanted = [film for film in made if not film.is_full]
            if next(counts) % every == 0 and wanted:
                last = with_caption(draw(), caption())
                for film in wanted:
                    film.add(last)

        yield add, [*paths, scene] if paths else []
    if last is not None:
        save_picture(last, scene)
