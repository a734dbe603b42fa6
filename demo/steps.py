"""Steps of a command as one page: findings in words, a picture, and the command of each step."""

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from .. import __version__
from ..evaluation.leaderboard import Standing
from ..runtime.page_files import page_template, write_text


class Step(NamedTuple):
    """One step.

    Attributes:
        title: a few words.
        sentences: results.
        command: to be typed for this step alone.
        picture: PNG, or None.
        report: linked page, or empty.
        board: rows of a leaderboard.
    """

    title: str
    sentences: tuple[str, ...]
    command: str
    picture: Path | None = None
    report: str = ""
    board: Sequence[Standing] = ()


def write_page(
    title: str,
    lead: str,
    steps: Sequence[Step],
    then: str,
    command: str,
    path: Path,
    doubts: Sequence[str] = (),
) -> None:
    """Write steps as one page without a need of a network.

    Args:
        title: heading of the page.
        lead: the sentence below the heading.
        steps: in order.
        then: next steps of the user; a line beginning with ``windwrench`` is a command. Empty:
            nothing.
        command: behind the page.
        path: the page's.
        doubts: above the lead.

    Raises:
        InputError: the page cannot be written.
    """
    pictures = [
        "" if step.picture is None else base64.b64encode(step.picture.read_bytes()).decode()
        for step in steps
    ]
    text = page_template(__package__, "page.html.j2").render(
        title=title,
        lead=lead,
        doubts=doubts,
        steps=list(zip(steps, pictures, strict=True)),
        then=then.splitlines(),
        command=command,
        version=__version__,
    )
    write_text(text + "\n", path)
