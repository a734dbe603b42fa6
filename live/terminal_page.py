"""The page of a stream on a terminal, drawn a few times a second."""

import math

from rich import box
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from ..estimator.consistency import Consistency
from .session import SILENT, Session

_BAR = 20  # characters

# counts that are no trouble
_HARMLESS = ("late", "doubled")


def page(session: Session) -> RenderableType:
    """Return the page of a stream; half of the vehicle's weight is a long bar."""
    source = session.source
    weight = source.vehicle.weight
    arm = source.vehicle.arm_l
    head = Text(f"{source.name}, {source.vehicle.name}", style="bold")
    output = session.output
    if output is None:
        return Group(head, Text(f"waiting for messages ... {session.silence:.0f} s", style="dim"))
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
    return Group(head, table, *_lines(session))


def _lines(session: Session) -> list[Text]:
    output = session.output
    tallies = session.tallies
    assert output is not None
    silence = session.silence
    counts = tallies.found
    drift = session.clocks.drift
    watch = session.watch
    silent = silence > SILENT
    status = f"SILENT for {silence:.1f} s" if silent else output.estimate.status
    good = not silent and output.estimate.status == "tracking"
    nis = output.estimate.nis
    rates = sorted(tallies.hertz.items())
    lines = [
        Text.assemble(
            "status   ",
            (status, "green" if good else "bold red" if silent else "yellow"),
            f"   t {output.t:.2f} s{f'   NIS {nis:.1f} (6 on average)' if nis == nis else ''}",
            f"   restarts {session.filter.restarts}",
        ),
        Text("rates    " + ", ".join(f"{kind} {rate:.0f} Hz" for kind, rate in rates)),
    ]
    if tallies.consistency.seconds:
        style = "yellow" if tallies.consistency.too_slow else ""
        lines.append(Text(f"tuning   {tuning_words(tallies.consistency)}", style))
    median, most = tallies.latency.median_and_most
    timing = f"latency  {median:.2f} ms, 99 % within {most:.2f} ms" if median == median else ""
    if drift is not None and not watch.rate_words:
        timing += f"   vehicle's clock {drift:+.0f} ppm"
    if session.clocks.count > 1:
        timing += f"   {session.clocks.count} clocks"
    if timing:
        lines.append(Text(timing))
    lines += [Text(f"warning  {words}", "yellow") for words in watch.words]
    trouble = {k: n for k, n in counts.items() if k not in _HARMLESS}
    lines.append(
        Text("dropped  " + (counts_words(counts) or "nothing"), "yellow" if trouble else "")
    )
    if session.recorded:
        lines.append(Text(f"recorded {session.recorded} rows"))
    return lines


def tuning_words(consistency: Consistency) -> str:
    """Return the innovations' verdict on the tuning, with advice for a slow one."""
    advice = (
        "; the tuning is too slow for this flight: --record the flight, fit a tuning with "
        "windwrench estimate, and give its tuning.yaml as --tuning"
    )
    return f"{consistency}{advice if consistency.too_slow else ''}"


def counts_words(counts: dict[str, int]) -> str:
    """Return the counts in words."""
    return ", ".join(f"{name} {n}" for name, n in sorted(counts.items()))
