"""What is timed, and how: every round runs all contenders one after the other, so that a machine
whose speed drifts slows all of them alike.
"""

import statistics
from collections.abc import Callable
from dataclasses import dataclass

HEADER = ["what", "median", "least - largest", "ratio to the first of its kind", "includes"]


@dataclass(frozen=True)
class Contender:
    """One thing that is timed.

    Attributes:
        name: of the contender.
        unit: of its figure: "us a step", "x real time", "s" or "ms".
        includes: the work that the figure covers.
        run: does the work once and returns the figure.
    """

    name: str
    unit: str
    includes: str
    run: Callable[[], float]


@dataclass(frozen=True)
class Figure:
    """A contender's figure over the rounds, and its ratio to the first contender of its unit in the
    same round; each as median, least and largest.
    """

    contender: Contender
    value: tuple[float, float, float]
    ratio: tuple[float, float, float]


def measure(
    contenders: list[Contender], rounds: int, advance: Callable[[], None] = lambda: None
) -> list[Figure]:
    """Run all contenders in turn ``rounds`` times; ``advance`` is called after each run."""
    values: list[list[float]] = [[] for _ in contenders]
    for _ in range(rounds):
        for kept, contender in zip(values, contenders, strict=True):
            kept.append(contender.run())
            advance()
    first: dict[str, list[float]] = {}
    for contender, kept in zip(contenders, values, strict=True):
        first.setdefault(contender.unit, kept)
    return [
        Figure(
            contender,
            _spread(kept),
            _spread([a / b for a, b in zip(kept, first[contender.unit], strict=True)]),
        )
        for contender, kept in zip(contenders, values, strict=True)
    ]


def _spread(numbers: list[float]) -> tuple[float, float, float]:
    return statistics.median(numbers), min(numbers), max(numbers)


def cells(figure: Figure) -> list[str]:
    """Return a figure as the cells of a table, in the order of ``HEADER``."""
    unit = figure.contender.unit
    digits = 2 if unit in ("s", "ms") else 1 if figure.value[0] < 100 else 0
    value, low, high = (f"{number:.{digits}f}" for number in figure.value)
    middle, least, largest = figure.ratio
    ratio = "1" if least == largest == 1.0 else f"{middle:.3g} ({least:.3g} - {largest:.3g})"
    name, includes = figure.contender.name, figure.contender.includes
    return [name, f"{value} {unit}", f"{low} - {high}", ratio, includes]
