"""The kit's measured example flight, and its known effects."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import resources
from pathlib import Path

from ....runtime.yaml_file import read_yaml


@dataclass(frozen=True)
class Known:
    """A known fact of the flight."""

    effects: list[str]  # names, any of which says it
    why: str  # it is known


@dataclass(frozen=True)
class Example:
    """The flight."""

    log: Path
    vehicle: str  # that flew
    what: str  # flew, where and how long
    source: str  # and licence
    known: list[Known]
    unknown: str  # of it


@contextmanager
def example_flight() -> Iterator[Example]:
    """Give the flight; its file is there for as long as the block lasts."""
    folder = resources.files(__package__)
    about = read_yaml(Path(__file__).with_name("about.yaml"), "what is known of the example")
    with resources.as_file(folder / about["log"]) as log:
        yield Example(**about | {"log": log, "known": [Known(**one) for one in about["known"]]})
