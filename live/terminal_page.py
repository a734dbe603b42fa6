"""The stream as a terminal shows it, a few times a second."""

import math

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from ..estimator.consistency import Consistency
from .session import SILENT, Snapshot
from .sources.base import Source

_BAR = 20  # characters

# words for counts that are good to know and no trouble
_HARMLESS = ("late", "doubled")


def page(snapshot: Snapshot, source: Source) -> RenderableType:
    """Return the page of a stream; half of the vehicle's weight is a long bar."""
    weight, arm = source.vehicle.weight, source.vehicle.arm_l
    head = Text(f"{source.name}, {source.vehicle.name}", style="bold")
    output = snapshot.output
    if output is None:
        return Group(head, Text(f"waiting for messages ... {snapshot.silence:.0f} s", style="dim"))
    table = Table("", "x", "y", "z", "size", "", box=box.SIMPLE_HEAD)
    for name, values, std, unit, scale in (
        ("force", output.estimate.force, output.std[:3], "N", 0.5 * weight),
        ("torque", output.estimate.torque, output.std[3:], "mNm", 0.25 * weight * arm),
    ):
        size = math.sqrt(float(values @ values))
        factor = 1e3 if unit == "mNm" else 1.0
        length = min(_BAR, round(_BAR * size / scale)) if scale > 0.0 else 0
        table.add_row(
            f"{name} ({unit})",
            *(f"{factor * x:+.3f}" for x in values),
            f"{factor * size:.3f}",
            Text("█" * length + "·" * (_BAR - length), style="cyan"),
        )
        table.add_row(f"  +- ({unit})", *(f"{factor * x:.3f}" for x in std), "", "", style="dim")
    return Group(head, table, *_lines(snapshot))


def _lines(snapshot: Snapshot) -> list[Text]:
    output = snapshot.output
    assert output is not None
    silent = snapshot.silence > SILENT
    status = f"SILENT for {snapshot.silence:.1f} s" if silent else output.estimate.status
    good = not silent and output.estimate.status == "tracking"
    nis, rates = output.estimate.nis, sorted(snapshot.rates.items())
    lines = [
        Text.assemble(
            "status   ",
            (status, "green" if good else "bold red" if silent else "yellow"),
            f"   t {output.t:.2f} s   NIS {nis:.1f} (6 on average)"
            if nis == nis
            else f"   t {output.t:.2f} s",
            f"   restarts {snapshot.restarts}",
        ),
        Text("rates    " + ", ".join(f"{kind} {rate:.0f} Hz" for kind, rate in rates)),
    ]
    if snapshot.consistency.seconds:
        style = "yellow" if snapshot.consistency.too_slow else ""
        lines.append(Text(f"tuning   {tuning_words(snapshot.consistency)}", style))
    median, most = snapshot.latency_ms
    timing = f"latency  {median:.2f} ms, 99 % within {most:.2f} ms" if median == median else ""
    if snapshot.drift_ppm is not None:
        timing += f"   vehicle's clock {snapshot.drift_ppm:+.0f} ppm"
    if snapshot.clocks > 1:
        timing += f"   {snapshot.clocks} clocks"
    if timing:
        lines.append(Text(timing))
    trouble = {k: n for k, n in snapshot.counts.items() if k not in _HARMLESS}
    lines.append(
        Text(
            "dropped  " + (counts_words(snapshot.counts) or "nothing"), "yellow" if trouble else ""
        )
    )
    if snapshot.recorded:
        lines.append(Text(f"recorded {snapshot.recorded} rows"))
    return lines


def tuning_words(consistency: Consistency) -> str:
    """Return what the innovations say of the tuning, and what to do where it is too slow."""
    advice = (
        "; the tuning is too slow for this flight: --record it, have windwrench estimate fit one, "
        "and give that with --tuning"
    )
    return f"{consistency}{advice if consistency.too_slow else ''}"


def counts_words(counts: dict[str, int]) -> str:
    """Return what was counted."""
    return ", ".join(f"{name} {n}" for name, n in sorted(counts.items()))
