"""The wrench while the vehicle flies."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import ExitStack, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.live import Live

from ..runtime.errors import InputError
from ..runtime.interrupts import INTERRUPTED, TERMINATED, taken, terminable
from .flight_logs import LogOptions
from .terminal import console, errors, gate_of, note, run

if TYPE_CHECKING:
    from ..live.session import Session

_PAGES = 5.0  # a second
_NOT_WRITTEN = 2  # exit code
_SIMULATED = "ardrone2"  # default vehicle of a simulation


def live(
    source: str,
    vehicle: str | None = None,
    map: str | None = None,
    record: Path | None = None,
    browser: bool = False,
    port: int = 8765,
    diagnose_after: bool = False,
    out: Path = Path("results/diagnose"),
    seconds: float | None = None,
    gate: float | None = None,
    tuning: Path | None = None,
    horizon: float = 0.3,
    rate: float | None = None,
    wait: float = 10.0,
) -> dict[str, Any]:
    """Estimate the wrench while the vehicle flies. Show or send the estimate, and record the
    flight. A terminal shows a live page; a pipe gets one line an estimate, as in wrench.csv.

    Example: windwrench live sim:base
    """
    from ..dynamics.vehicle_file import load_vehicle, name_in_log, preset_names
    from ..identification.logs.log_map import load_map
    from ..live.filtering import LiveSettings, Output
    from ..live.messages import Row
    from ..live.outlets import Outlet
    from ..live.outputs import Lines
    from ..live.recorder import Recorder
    from ..live.session import Session
    from ..live.sources.open import kind_of, make_source
    from ..live.tallies import Tallies
    from .tuning_file import load_tuning

    if vehicle is None and kind_of(source) != "sim":
        raise InputError(
            f"--vehicle: {source} does not say which vehicle flies; expected "
            f"{', '.join(preset_names())} or the path of a YAML file"
        )
    flown = vehicle or _SIMULATED
    model = load_vehicle(flown)
    if diagnose_after and record is None:
        raise InputError("--diagnose-after: expected --record LOG with it, the log to diagnose")
    given = None if tuning is None else load_tuning(tuning)
    settings = LiveSettings(gate_of(gate), horizon, rate, wait, seconds, given)
    tallies = Tallies()
    stream = make_source(source, model, None if map is None else load_map(map), tallies)
    recorder, recording, telling = None, None, None
    if record is not None:
        recorder = Recorder(record, name_in_log(model, flown), tallies, horizon)
        recording = Outlet[Row](recorder, tallies)
    if not console.is_terminal and not console.quiet:
        telling = Outlet[Output](
            Lines(sys.stdout),
            tallies,
            # the only reader of the estimates is gone
            failed=lambda: None if stream.answers or recorder or browser else session.stop(),
        )
    session = Session(stream, settings, recording, telling)
    with ExitStack() as shown:
        if browser:
            from ..live.web_view import WebView

            address = shown.enter_context(WebView(session, port)).address
            note(f"page: {address}")
        with terminable() as terminated:
            interrupted = _watch(session)
    if telling is not None and telling.problem:
        sys.stdout = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115 - or the end stalls too
    if any(outlet.problem for outlet in session.outlets):
        run.code = _NOT_WRITTEN
    result = _summary(session)
    if recorder is not None and recorder.rows:
        run.written.append(recorder.path)
        note(f"wrote {recorder.path}")
    if diagnose_after:
        if recorder is None or not recorder.rows:
            raise InputError("--diagnose-after: nothing was recorded to diagnose")
        from .diagnosing import diagnose

        result["diagnosis"] = diagnose([recorder.path], reading=LogOptions(vehicle=flown), out=out)
    if interrupted:
        run.code = TERMINATED if terminated() else INTERRUPTED
    return result


def _watch(session: "Session") -> bool:
    """Show a stream until its end; return whether the user ended the stream.

    Raises:
        InputError: as ``Session.run``.
    """
    from ..live.terminal_page import page

    draws, interrupted = console.is_terminal and not console.quiet, False
    with ThreadPoolExecutor(1, "stream") as threads:
        running = threads.submit(session.run)
        try:
            moving = Live(console=console, auto_refresh=False, transient=True)
            try:
                with moving if draws else nullcontext() as shown:
                    while not running.done():
                        _say(session)
                        if shown is not None:
                            shown.update(page(session), refresh=True)
                        wait([running], 1.0 / _PAGES)
            except Exception as error:
                session.tallies.fail("not drawn", "the terminal", error)
            wait([running])
        except KeyboardInterrupt:
            taken()
            interrupted = True
        finally:
            session.stop()
        running.result()
    if draws and session.output is not None:
        console.print(page(session))
    return interrupted


def _say(session: "Session") -> None:
    """Print new lines on links and failures."""
    for line in session.tallies.news():
        style = "yellow" if line.startswith("warning") else "dim"
        errors.print(line, style=style, markup=False, soft_wrap=True)


def _summary(session: "Session") -> dict[str, Any]:
    """Print and return the counts, rates and means of the stream."""
    import numpy as np

    from ..live.terminal_page import counts_words, tuning_words

    _say(session)
    tallies, restarts, scales = session.tallies, session.filter.restarts, session.watch.noise_scales
    median, most = tallies.latency.median_and_most
    noise = {} if scales is None else dict(zip(("attitude", "position"), scales, strict=True))
    mean, square = tallies.wrench / max(session.estimates, 1)
    deviation = np.sqrt(np.maximum(square - mean**2, 0.0))
    result: dict[str, Any] = {
        "source": session.source.name,
        "vehicle": session.source.vehicle.name,
        "seconds": session.seconds,
        "estimates": session.estimates,
        "messages": {kind: rate.count for kind, rate in tallies.rates.items()},
        "counts": tallies.found,
        "restarts": restarts,
        "consistency": tallies.consistency.as_dict() if tallies.consistency.seconds else None,
        "period_s": session.filter.period,
        "clock_drift_ppm": session.clocks.drift,
        "noise_scale": noise or None,
        "poses": session.watch.poses,
        "poses_too_late": session.watch.too_late,
        "latency_ms": {"median": median, "p99": most},
        "processor_ms": dict(
            zip(("median", "p99"), tallies.processor.median_and_most, strict=True)
        ),
        "recorded_rows": session.recorded,
        "force_mean_N": mean[:3],
        "force_std_N": deviation[:3],
        "torque_mean_Nm": mean[3:],
        "torque_std_Nm": deviation[3:],
        "ended": session.ended,
    }
    messages = counts_words(result["messages"])
    lines = [f"{session.estimates} estimates over {session.seconds:.1f} s; messages: {messages}"]
    if tallies.found:
        lines.append(f"counted: {counts_words(tallies.found)}")
    if restarts:
        lines.append(f"restarts of the filter after gaps or jumps: {restarts}")
    if tallies.consistency.seconds:
        lines.append(f"tuning: {tuning_words(tallies.consistency)}")
    lines += session.watch.words
    if not np.isnan(median):
        lines.append(f"latency: median {median:.2f} ms, 99 % within {most:.2f} ms")
    force, torque = (" ".join(f"{x:+.4g}" for x in part) for part in (mean[:3], mean[3:]))
    lines.append(f"mean force {force} N, mean torque {torque} Nm")
    for text in lines:
        errors.print(text, soft_wrap=True)
    return result
