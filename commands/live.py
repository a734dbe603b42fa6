"""The wrench while the vehicle flies."""

import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.live import Live

from ..runtime.errors import InputError
from .terminal import checked_gate, console, errors, note, run, working

if TYPE_CHECKING:
    from ..live.session import Means, Session

_PAGES = 5.0  # a second
_SIMULATED = "ardrone2"  # that flies in a simulation where nothing else is said


def live(
    source: str,
    vehicle: str | None = None,
    map: str | None = None,
    record: Path | None = None,
    view: bool = False,
    port: int = 8765,
    diagnose_after: bool = False,
    out: Path = Path("results/diagnose"),
    seconds: float | None = None,
    gate: float | None = None,
    horizon: float = 0.3,
    rate: float | None = None,
    wait: float = 10.0,
) -> dict[str, Any]:
    """Estimate the wrench while the vehicle flies. Show it, send it back, record the flight. Prints
    a page on a terminal, else a line for each estimate, the columns of wrench.csv.

    Example: windwrench live sim:base
    """
    from ..dynamics.vehicle_file import load_vehicle, preset_names
    from ..identification.logs.log_map import load_map
    from ..live.filtering import LiveSettings, warm_up
    from ..live.recorder import Recorder
    from ..live.session import Means, Session
    from ..live.sources.open import kind_of, make_source
    from ..live.tallies import Tallies

    kind = kind_of(source)
    if vehicle is None and kind != "sim":
        raise InputError(
            f"--vehicle: {source} does not say which vehicle flies; expected "
            f"{', '.join(preset_names())} or the path of a YAML file"
        )
    model = load_vehicle(vehicle or _SIMULATED)
    if diagnose_after and record is None:
        raise InputError("--diagnose-after: expected --record LOG with it, the log to diagnose")
    settings = LiveSettings(horizon=horizon, rate_hz=rate, wait=wait, seconds=seconds)
    if gate is not None:
        settings = replace(settings, gate=checked_gate(gate) or None)
    tallies, means = Tallies(), Means()
    stream = make_source(source, model, None if map is None else load_map(map), tallies)
    recorder = None
    if record is not None:
        preset = (vehicle or _SIMULATED) in preset_names()
        recorder = Recorder(record, model, tallies, horizon, preset)
    with working("preparing the filter"):
        warm_up(model)
    lines = not console.is_terminal and not console.quiet
    out_text = sys.stdout
    if lines:
        from ..live.outputs import COLUMNS, as_line

        out_text.write(",".join(COLUMNS) + "\n")

    def tell(output: Any) -> None:
        means.add(output)
        if lines:
            out_text.write(as_line(output))

    session = Session(
        stream,
        settings,
        recorder,
        tell,
        out_text.flush if lines else lambda: None,
    )
    with ExitStack() as shown:
        if view:
            from ..live.web_view import WebView

            address = shown.enter_context(WebView(session, port)).address
            note(f"page: {address}")
        interrupted = _watch(session)
    result = _summary(session, means)
    if recorder is not None and recorder.rows:
        run.written.append(recorder.path)
        note(f"wrote {recorder.path}")
    if diagnose_after:
        if recorder is None or not recorder.rows:
            raise InputError("--diagnose-after: nothing was recorded to diagnose")
        from .diagnosing import diagnose

        result["diagnosis"] = diagnose([recorder.path], vehicle=vehicle or _SIMULATED, out=out)
    if interrupted:
        run.code = 130
    return result


def _watch(session: "Session") -> bool:
    """Show a stream until it ends; return whether the user ended it.

    Raises:
        InputError: as ``Session.run``.
    """
    failed: list[BaseException] = []
    # what is waited for: an interrupt within Thread.join has Python take the thread for ended
    done = threading.Event()

    def work() -> None:
        try:
            session.run()
        except BaseException as error:
            failed.append(error)
        finally:
            done.set()

    from ..live.terminal_page import page

    def render() -> Any:
        return page(session.snapshot(), session.source)

    thread = threading.Thread(target=work, name="stream", daemon=True)
    interrupted = False
    draws = console.is_terminal and not console.quiet
    thread.start()
    try:
        if draws:
            with Live(render(), console=console, auto_refresh=False, transient=True) as shown:
                _each_page(done, lambda: shown.update(render(), refresh=True))
        else:
            _each_page(done, lambda: None)
    except KeyboardInterrupt:
        interrupted = True
    session.stop()
    done.wait()
    if failed:
        raise failed[0]
    if draws and session.output is not None:
        console.print(render())
    return interrupted


def _each_page(done: threading.Event, show: Callable[[], None]) -> None:
    while not done.is_set():
        show()
        done.wait(1.0 / _PAGES)


def _summary(session: "Session", means: "Means") -> dict[str, Any]:
    """Say what came and what became of it; return it."""
    from ..live.terminal_page import counts_words

    now = session.snapshot()
    median, most = now.latency_ms
    result: dict[str, Any] = {
        "source": session.source.name,
        "vehicle": session.source.vehicle.name,
        "seconds": now.seconds,
        "estimates": now.estimates,
        "messages": {kind: rate.count for kind, rate in session.tallies.rates.items()},
        "counts": now.counts,
        "restarts": now.restarts,
        "period_s": session.filter.period,
        "clock_drift_ppm": now.drift_ppm,
        "latency_ms": {"median": median, "p99": most},
        "processor_ms": dict(zip(("median", "p99"), now.processor_ms, strict=True)),
        "recorded_rows": now.recorded,
        "force_mean_N": means.mean[:3],
        "force_std_N": means.deviation[:3],
        "torque_mean_Nm": means.mean[3:],
        "torque_std_Nm": means.deviation[3:],
        "ended": session.ended,
    }
    messages = ", ".join(f"{n} {kind}" for kind, n in sorted(result["messages"].items()))
    lines = [f"{now.estimates} estimates over {now.seconds:.1f} s, of {messages}"]
    if now.counts:
        lines.append(f"counted: {counts_words(now.counts)}")
    if now.restarts:
        lines.append(f"the filter restarted {now.restarts} time(s): after gaps or jumps")
    if median == median:
        lines.append(f"latency: median {median:.2f} ms, 99 % within {most:.2f} ms")
    force = " ".join(f"{x:+.4g}" for x in means.mean[:3])
    torque = " ".join(f"{x:+.4g}" for x in means.mean[3:])
    lines.append(f"mean force {force} N, mean torque {torque} Nm")
    for text in lines:
        errors.print(text, soft_wrap=True)
    return result
