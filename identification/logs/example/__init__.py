"""A measured flight that comes with the kit, and what is known of it."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import yaml


@dataclass(frozen=True)
class Known:
    """Something that is known of the flight.

    Attributes:
        effects: names, any of which says it.
        why: it is known.
    """

    effects: tuple[str, ...]
    why: str


@dataclass(frozen=True)
class Example:
    """The flight.

    Attributes:
        log: its path.
        vehicle: a preset's name.
        what: flew, where and how long.
        source: and licence.
        known: of it.
        unknown: of it.
    """

    log: Path
    vehicle: str
    what: str
    source: str
    known: tuple[Known, ...]
    unknown: str


@contextmanager
def example_flight() -> Iterator[Example]:
    """Give the flight; its file is there for as long as the block lasts."""
    folder = resources.files(__package__)
    about = yaml.safe_load((folder / "about.yaml").read_text(encoding="utf-8"))
    with ExitStack() as kept:
        yield Example(
            kept.enter_context(resources.as_file(folder / about["log"])),
            about["vehicle"],
            about["what"],
            about["source"],
            tuple(Known(tuple(k["effects"]), k["why"]) for k in about["known"]),
            about["unknown"],
        )
