"""The outcome of an experiment: numbers, data, a picture, and a comparison with the paper."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jinja2 import Template
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..runtime.page_files import page_template

# An experiment calls it with the share of its work that is done, 0 to 1.
Progress = Callable[[float], None]
Columns = Mapping[str, NDArray[np.generic]]  # of a table, each (rows,), numbers or text


@dataclass(frozen=True)
class Comparison:
    """One line of the table "the paper / this kit"."""

    quantity: str  # with its unit
    paper: str  # the paper's value, or "-" where the paper says nothing
    here: str


@dataclass(frozen=True)
class Result:
    """An experiment's outcome. Every experiment is a module with ``TITLE``, ``SEEDS`` and
    ``run(seeds, progress)``.
    """

    figures: Mapping[str, Any]  # figures of merit, as JSON
    data: Columns
    picture: Figure
    comparison: list[Comparison]
    remarks: list[str]  # for the reader of the page, one paragraph each


def table(blocks: Sequence[Mapping[str, Any]]) -> Columns:
    """Return the columns of blocks of rows, one below the other; a block's single values stand in
    each of its rows.
    """
    whole = [np.broadcast_arrays(*block.values()) for block in blocks]
    return {
        name: np.concatenate([np.atleast_1d(block[i]) for block in whole])
        for i, name in enumerate(blocks[0])
    }


def template(name: str) -> Template:
    """Return the template ``templates/NAME.md.j2``; a name without a value is an error."""
    return page_template(__package__, f"templates/{name}.md.j2", html=False)


def compared(
    name: str, module: Mapping[str, Any], /, **values: Any
) -> tuple[list[Comparison], list[str]]:
    """Return the table and the remarks of a figure's template, filled with the constants of the
    figure's module, by their names, and with values.

    A line ``| quantity | the paper | this kit |`` is a row of the table. Empty lines separate
    the remarks.
    """
    constants = {word: value for word, value in module.items() if word.isupper()}
    lines = template(name).render(constants | values).splitlines()
    rows = [Comparison(*line.strip("| ").split(" | ")) for line in lines if line.startswith("|")]
    text = "\n".join(line for line in lines if not line.startswith("|"))
    return rows, [" ".join(part.split()) for part in text.split("\n\n") if part.strip()]
