"""A measured flight that comes with the kit, and what is known of it."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

import yaml


@dataclass(frozen=True)
class Known:
    """Something that is known of the flight."""

    effects: tuple[str, ...]  # names, any of which says it
    why: str  # it is known


@dataclass(frozen=True)
class Example:
    """The flight."""

    log: Path
    vehicle: str  # that flew
    what: str  # flew, where and how long
    source: str  # and licence
    known: tuple[Known, ...]
    unknown: str  # of it


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
