"""What an experiment gives: numbers, data, a picture, and how it compares with the paper."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from matplotlib.figure import Figure
from numpy.typing import NDArray

# An experiment calls it with the share of its work that is done, 0 to 1.
Progress = Callable[[float], None]


@dataclass(frozen=True)
class Comparison:
    """One line of the table "the paper / this kit"."""

    quantity: str  # with its unit
    paper: str  # what the paper reports, or "-" where it says nothing
    here: str


@dataclass(frozen=True)
class Result:
    """An experiment's outcome. Every experiment is a module with ``TITLE``, ``SEEDS`` and
    ``run(seeds, progress)``.
    """

    figures: Mapping[str, Any]  # figures of merit, as JSON
    data: Mapping[str, NDArray[np.generic]]  # columns (rows,) of the table, numbers or text
    picture: Figure
    comparison: list[Comparison]
    remarks: list[str] = field(
        default_factory=list
    )  # what the reader should know, one paragraph each
    timing: list[Comparison] = field(
        default_factory=list
    )  # what differs from run to run, and is kept apart for that


def remarks(name: str, /, **values: Any) -> list[str]:
    """Return the paragraphs of a figure's template, ``remarks/NAME.md.j2``, with these values."""
    loader = PackageLoader(__package__, "remarks")
    template = Environment(loader=loader, undefined=StrictUndefined).get_template(f"{name}.md.j2")
    paragraphs = template.render(values).split("\n\n")
    return [" ".join(text.split()) for text in paragraphs if text.strip()]
