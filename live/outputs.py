"""An estimate as it is told: the columns of ``wrench.csv``."""

from typing import Any

from .filtering import Output

COLUMNS = (
    "t",
    *(f"{kind}{axis}" for kind in ("f", "t") for axis in "xyz"),
    *(f"std_{kind}{axis}" for kind in ("f", "t") for axis in "xyz"),
    "nis",
    "status",
)


def _values(output: Output) -> list[float]:
    """Return an estimate by ``COLUMNS``, but the status."""
    return [round(output.t, 9), *output.wrench.tolist(), *output.std.tolist(), output.estimate.nis]


def as_fields(output: Output) -> dict[str, Any]:
    """Return an estimate by the names of ``COLUMNS``, JSON's numbers; the status in a word."""
    values = [x if x == x else None for x in _values(output)]
    return dict(zip(COLUMNS, [*values, output.estimate.status], strict=True))


def as_line(output: Output) -> str:
    """Return an estimate as a line of ``wrench.csv``."""
    return ",".join(map(repr, [*_values(output), float(output.estimate.status_code)])) + "\n"
