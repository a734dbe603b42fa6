"""An estimate as it is told: the columns of ``wrench.csv``."""

from typing import Any

from ..estimator.estimate import STATUSES
from .filtering import Output

COLUMNS = (
    "t",
    *(f"{kind}{axis}" for kind in ("f", "t") for axis in "xyz"),
    *(f"std_{kind}{axis}" for kind in ("f", "t") for axis in "xyz"),
    "nis",
    "status",
)


def as_fields(output: Output) -> dict[str, Any]:
    """Return an estimate by the names of ``COLUMNS``, JSON's numbers; the status in a word."""
    values = [round(output.t, 9), *output.estimate.force.tolist(), *output.estimate.torque.tolist()]
    nis = output.estimate.nis
    values += [*output.std.tolist(), nis if nis == nis else None, output.estimate.status]
    return dict(zip(COLUMNS, values, strict=True))


def as_line(output: Output) -> str:
    """Return an estimate as a line of ``wrench.csv``."""
    estimate = output.estimate
    numbers = [
        round(output.t, 9),
        *estimate.force.tolist(),
        *estimate.torque.tolist(),
        *output.std.tolist(),
        estimate.nis,
        float(STATUSES.index(estimate.status)),
    ]
    return ",".join(map(repr, numbers)) + "\n"
