"""Force and torque over the place of a flight through a wind, and a law for it."""

import math
from pathlib import Path
from typing import Any

from ..runtime.errors import InputError
from .flight_logs import AS_THEY_ARE, LogOptions, log_notes, read_flights
from .terminal import command_line, console, results_folder, run, say, show_table, working

_PARTS = tuple(f"{kind}_{way}" for kind in ("f", "t") for way in ("wind", "line", "up"))
_JET = ("axis_m", "slope_Nm_m", "torques_Nm", "torques_at_m", "edges_m")  # of ``JetShape``


def profile(
    log: Path,
    reading: LogOptions = AS_THEY_ARE,
    axis: float | None = None,
    line: float | None = None,
    rise_time: float = 0.45,
    fan_speed: float | None = None,
    write: Path | None = None,
    out: Path = Path("results/profile"),
) -> dict[str, Any]:
    """Map a wind's force and torque against position, from a flight. Design the admittance law that
    follows the fan.

    Example: windwrench profile hovers.csv --vehicle ardrone2 --write law.yaml
    """
    import numpy as np
    import yaml

    from ..identification.logs.tables import write_csv
    from ..identification.profile_law import profile_log
    from ..identification.report.profile_picture import draw_profile
    from ..runtime.page_files import write_json, write_text
    from ..runtime.plain_values import plain

    if write is not None and write.suffix not in (".yaml", ".yml"):
        raise InputError(f"--write {write}: expected a name that ends in .yaml")
    (flight,), model = read_flights([log], reading)
    folder = results_folder(out)
    run.record = folder / "run.json"
    angle = None if axis is None else math.radians(axis)
    with working("estimating") as progress:
        found = profile_log(flight, model, angle, line, rise_time, fan_speed, progress)
    log_notes(found.notes)
    p, law = found.profile, found.law
    seen = {"direction_deg": math.degrees(p.direction), "along_wind_m": p.beside}
    jet: dict[str, Any] | None = None
    if found.shape:
        jet = dict(zip(_JET, found.shape[2:], strict=True))
    result = {
        "log": flight.name,
        "vehicle": model.name,
        "line": seen | {"from_m": p.place[0], "to_m": p.place[-1], "samples": p.samples},
        "lines_m": p.lines,
        "jet": jet,
        "law": law and law | {"rise_time_s": rise_time},
        "why_no_law": found.why or None,
    }
    table, page = folder / "profile.csv", folder / "profile.json"
    rows = [
        np.vstack([q.place, np.full_like(q.place, q.beside), q.wrench, q.low, q.high])
        for q in (p, *found.others)
    ]
    ends = [f"{part}{end}" for end in ("", "_low", "_high") for part in _PARTS]
    names = ["place", "along_wind", *ends]
    write_csv(dict(zip(names, np.hstack(rows), strict=True)), table)
    picture = draw_profile(found, f"{flight.name}, {model.name}", folder / "profile.png")
    write_json(plain(result), page)
    written = [table, picture, page]
    if law is None or jet is None:
        say(*written)
        if write is not None:
            raise InputError(f"{log}: no law was written: {found.why}")
        console.print(f"No law: {found.why}.", soft_wrap=True)
        return result
    low, high = law["fastest_fan_ci95_m_s"]
    left, right = (place - jet["axis_m"] for place in jet["torques_at_m"])
    console.print(
        f"A gain of {law['gain']:.3g} m/s per Nm follows fans of up to "
        f"{law['fastest_fan_m_s']:.2g} m/s in 80 % of flights of 20 s ({low:.2g} to {high:.2g} "
        f"m/s; its bound k tau_max is {law['bound_m_s']:.2g} m/s), loses the jet beyond "
        f"{left:.2f} and {right:+.2f} m from the axis, and allows the filter a rise time of up to "
        f"{law['largest_rise_time_s']:.2g} s.",
        soft_wrap=True,
    )
    each = ((key, np.atleast_1d(value).tolist()) for key, value in (jet | law).items())
    show_table(("", "value"), [(key, ", ".join(f"{x:.3g}" for x in some)) for key, some in each])
    if write is not None:
        gains = {"gain": law["gain"]}
        stated = {"law": "admittance", "task": "FanTracking", "gains": gains}
        designed = {"designed": {"by": command_line(), **result}}
        write_text(yaml.safe_dump(plain(stated | designed), sort_keys=False, width=100), write)
        written.append(write)
    say(*written)
    return result
