"""A vehicle from its logs."""

import math
import re
from pathlib import Path
from typing import Any

from ..runtime.errors import InputError
from .flight_logs import LogOptions, log_notes, read_logs
from .terminal import console, result_file, run, say, show_table, working

_WINDOW = re.compile(r"(.+):(\d+(?:\.\d+)?)-(\d+(?:\.\d+)?)")


def parse_window(text: str) -> tuple[Path, tuple[float, float]]:
    """Return the path and the times (s after the log's start) of ``LOG`` or ``LOG:FROM-TO``.

    Raises:
        InputError: the second time does not come after the first.
    """
    match = _WINDOW.fullmatch(text)
    if match is None:
        return Path(text), (0.0, math.inf)
    begin, end = float(match[2]), float(match[3])
    if not begin < end:
        raise InputError(f"{text}: expected LOG:FROM-TO with FROM before TO, in s")
    return Path(match[1]), (begin, end)


def identify(
    logs: list[str],
    mass: float,
    geometry: str | None = None,
    reader: str | None = None,
    map: str | None = None,
    piece: int | None = None,
    begin: float = 0.0,
    end: float | None = None,
    test: list[str] | None = None,
    export: str | None = None,
    out: Path = Path("results/vehicle.yaml"),
) -> dict[str, Any]:
    """Identify a vehicle from its flight logs. Thrust and torque coefficients or the thrust curve,
    inertia, motor lag, centre of mass and drag, each with a 95 % interval; quantities that the
    flights do not determine are listed. Write the vehicle file, the intervals beside it and a
    picture.

    With --test, measure how well the vehicle predicts flights kept out of the fit.

    Example: windwrench identify flight.csv --mass 0.465 --geometry 0.126 --out my_drone.yaml
    """
    from ..identification.motion.signals import known_pieces
    from ..identification.prediction import errors_of_models
    from ..identification.vehicle_fit.exports import EXPORTS
    from ..identification.vehicle_fit.geometry import parse_geometry
    from ..identification.vehicle_fit.held_out import SIMPLEST, models_of
    from ..identification.vehicle_fit.identify import identify as fit
    from ..identification.vehicle_fit.report import (
        headline,
        identified_data,
        reasons_of,
        table_of,
        use_of,
        write_identified,
    )

    out = result_file(out, "vehicle.yaml")
    if out.suffix not in (".yaml", ".yml"):
        raise InputError(f"--out {out}: expected a name that ends in .yaml")
    where = parse_geometry(geometry)
    common = begin, math.inf if end is None else end
    if end is not None and end <= begin:
        raise InputError(f"--to {end:g}: expected a time after --from {begin:g}")
    parts = [parse_window(text) for text in (*logs, *(test or ()))]
    if len({*parts}) < len(parts):  # no fit may predict its own flight
        raise InputError(
            f"{max(parts, key=parts.count)[0]}: is given twice; expected each flight once, in the "
            "fit or in --test"
        )
    flights = read_logs([path for path, _ in parts], LogOptions(reader, map, piece))
    flights, unseen = flights[: len(logs)], flights[len(logs) :]
    log_notes(text for flight in flights for text in flight.notes)  # a refusal may follow from one
    for flight in unseen:
        known_pieces(flight)  # refuses one without a pose before the fit
    windows = [w if math.isfinite(w[1]) else common for _, w in parts]
    with working("identifying") as progress:
        identified = fit(flights, mass, where, windows[: len(logs)], out.stem, report=progress)
    if unseen:
        with working("predicting"):
            models = identified.vehicle, models_of(identified.vehicle)[SIMPLEST]
            further = errors_of_models(unseen, models, 0.5, [[w] for w in windows[len(logs) :]])
        identified = identified._replace(predicted={**identified.predicted, "prediction": further})
    run.record = out.with_name(f"{out.stem}.run.json")
    written = write_identified(identified, out)
    log_notes(identified.notes)
    sentence = headline(identified)
    console.print(
        f"{identified.fit.balance.seconds:.0f} s of flight, mass {mass:g} kg: {sentence}."
    )
    show_table(
        ("quantity", "value", "± (95 %)", "unit", ""),
        [
            (
                e.name,
                f"{e.value:.4g}" if math.isfinite(e.value) else "–",
                f"{0.5 * (e.high - e.low):.2g}" if math.isfinite(e.low) else "",
                e.unit,
                e.status,
            )
            for e in identified.estimates.values()
        ],
    )
    for line in (*reasons_of(identified), *identified.advice):
        console.print(line)
    for of, (vehicle, simplest) in identified.predicted.items():
        after = f"{vehicle.horizon[-1]:.2g} s after {vehicle.starts} starts"
        console.print(f"{of.replace('_', ' ')}: {after}, by a fit without them:")
        show_table(
            ("mean error", "of the vehicle", "thrust and drag", "if nothing changes", "unit"),
            table_of(vehicle, simplest),
        )
    console.print(use_of(identified))
    result = {"headline": sentence, **identified_data(identified)}
    if export is not None:
        text = EXPORTS[export](identified)
        console.print(text, soft_wrap=True)
        result["export"] = {export: text}
    say(*written)
    return result
