"""The page of the demonstration: one file, without a network."""

import base64
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any

from .. import __version__
from ..runtime.whole_files import replaced
from .story import Step


def write_page(
    steps: Sequence[Step],
    report_step: Step,
    board_step: Step,
    board: Sequence[Mapping[str, Any]],
    command: str,
    seconds: float,
    path: Path,
) -> None:
    """Write the page.

    Args:
        steps: of the story, in order.
        report_step: the one that has a report of its own.
        board_step: the one that has the leaderboard.
        board: the leaderboard's rows.
        command: that made the page.
        seconds: that it took.
        path: of the page.

    Raises:
        InputError: it cannot be written.
    """
    from jinja2 import Environment, StrictUndefined

    template = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    ).from_string((resources.files(__package__) / "page.html.j2").read_text(encoding="utf-8"))
    text = template.render(
        steps=steps,
        report_step=report_step,
        board_step=board_step,
        board=board,
        command=command,
        seconds=seconds,
        version=__version__,
        data=lambda picture: base64.b64encode(Path(picture).read_bytes()).decode(),
    )
    with replaced(path) as partial:
        partial.write_text(text + "\n", encoding="utf-8")
