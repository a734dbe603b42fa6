"""Films of a flight: what each picture says, and where it goes."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..envs.captions import Caption, with_caption
from ..envs.video import FPS, Film, save_picture

SIZE = 960, 540  # pixels


@dataclass
class Tally:
    """Errors and rewards of a flight so far, for the corner of its film."""

    squares: list[float] = field(default_factory=list)  # m2
    rewards: list[float] = field(default_factory=list)  # at most 1

    def add(self, info: Mapping[str, Any]) -> None:
        """Count a decision."""
        self.squares.append(float(info.get("error", info.get("offset"))) ** 2)
        self.rewards.append(float(info["reward_tracking"]))

    def lines(self) -> tuple[str, ...]:
        """Return the lines of text for now."""
        return (
            f"error {np.sqrt(self.squares[-1]):.2f} m",
            f"RMSE so far {np.sqrt(np.mean(self.squares)):.2f} m",
            f"score {np.mean(self.rewards):.2f} (mean reward, best 1)",
        )


def caption_of(
    loop: Any, viewer: Any, title: str, info: Mapping[str, Any], tally: Tally
) -> Caption:
    """Return the caption of a picture of a task's closed loop."""
    state, external, wind = loop.state, loop.external, info.get("wind")
    lines = () if wind is None else (f"wind {np.linalg.norm(wind):.1f} m/s",)
    return Caption(
        title,
        float(info["time"]),
        state[16:19].copy(),
        float(state[15]),
        external[:3].copy(),
        float(external[5]),
        (*tally.lines(), *lines),
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
    last: list[Any] = []
    count = 0
    paths = [folder / f"{name}.{kind}" for kind in kinds]
    scene = folder / f"{name}.{still}"
    with ExitStack() as stack:
        made = [stack.enter_context(Film(path, *SIZE, fps, seconds)) for path in paths]

        def add(draw: Callable[[], Any], caption: Callable[[], Caption]) -> None:
            nonlocal count
            count += 1
            wanted = [film for film in made if not film.is_full]
            if wanted and count % every == 0:
                picture = with_caption(draw(), caption())
                last[:] = [picture]
                for film in wanted:
                    film.add(picture)

        yield add, [*paths, scene] if paths else []
    if last:
        save_picture(last[0], scene)
