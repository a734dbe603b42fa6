"""The study's table: a line for each model of each log."""

from collections.abc import Mapping, Sequence
from typing import Any

from windwrench.studies.page_tables import table

MARKS = "motor_lag"  # the page has the table of another study, too
_HEAD = (
    "model, thrust alone",
    "lag, 95 %",
    "time offset, 95 %",
    "residual of the specific force, rms",
)
_OF_IDENTIFY = ("commands", True)  # what `windwrench identify` fits, among other signals


def tables(outcomes: Sequence[Mapping[str, Any]]) -> str:
    """Return a table for each log as Markdown."""
    parts = []
    for log in dict.fromkeys(one["log"] for one in outcomes):
        rows = [_row(one) for one in outcomes if one["log"] == log]
        parts.append(f"`{log}`:\n\n{table(_HEAD, rows)}")
    return "\n\n".join(parts)


def _row(one: Mapping[str, Any]) -> list[str]:
    model = (one["on"], one["offset_fitted"])
    name = f"lag on {one['on']}, {'a' if one['offset_fitted'] else 'no'} time offset"
    lag, lag_width = 1e3 * one["lag_s"], 1e3 * one["lag_half_width_s"]
    offset, offset_width = 1e3 * one["offset_s"], 1e3 * one["offset_half_width_s"]
    return [
        f"{name} (the kit's model)" if model == _OF_IDENTIFY else name,
        f"{lag:.0f} ± {lag_width:.0f} ms",
        f"{offset:.1f} ± {offset_width:.1f} ms" if one["offset_fitted"] else "none",
        f"{one['residual_rms_mps2']:.3f} m/s2",
    ]
