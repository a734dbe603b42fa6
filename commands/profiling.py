"""Force and torque over the place of a flight through a wind, and a law for it."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..runtime.errors import InputError
from .flight_logs import AS_THEY_ARE, LogOptions, log_notes, read_flights
from .terminal import command_line, console, results_folder, run, say, show_table, working

if TYPE_CHECKING:
    from ..identification.profile_law import ProfiledJet
    from ..identification.wind_profile import WindProfile

_PARTS = tuple(f"{kind}_{way}" for kind in ("f", "t") for way in ("wind", "line", "up"))


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
    """Draw force and torque over the place of a flight through a wind. Design the admittance law
    that follows its fan.

    Example: windwrench profile hovers.csv --vehicle ardrone2 --write law.yaml
    """
    from ..identification.profile_law import profile_log
    from ..identification.report.profile_picture import draw_profile
    from ..runtime.page_files import write_json
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
    result = {"log": flight.name, "vehicle": model.name, **_figures(found)}
    table = folder / "profile.csv"
    _write_table((found.profile, *found.others), table)
    picture = draw_profile(found, f"{flight.name}, {model.name}", folder / "profile.png")
    page = folder / "profile.json"
    write_json(plain(result), page)
    written = [table, picture, page]
    if found.design is None:
        console.print(f"No law: {found.why}.", soft_wrap=True)
    else:
        console.print(_sentence(found), soft_wrap=True)
        show_table(("quantity", "value", "95 % interval"), _rows(found))
    if write is not None and found.design is not None:
        _write_law(write, result, found)
        written.append(write)
    say(*written)
    if write is not None and found.design is None:
        raise InputError(f"{log}: no law was written: {found.why}")
    return result


def _sentence(found: "ProfiledJet") -> str:
    """Return the law in one sentence."""
    d, s, ends = found.design, found.shape, found.intervals
    assert d is not None
    assert s is not None
    lost = f"{s.peaks[0] - s.centre:.2f} and {s.peaks[1] - s.centre:+.2f} m"
    return (
        f"A gain of {d.gain:.3g} m/s per Nm follows fans of up to {d.fastest:.2g} m/s in 80 % of "
        f"flights of 20 s ({ends['fastest'][0]:.2g} to {ends['fastest'][1]:.2g} m/s; its bound "
        f"k tau_max is {d.bound:.2g} m/s), loses the jet beyond {lost} from the axis, and allows "
        f"the filter a rise time of up to {d.rise_time_margin:.2g} s."
    )


def _rows(found: "ProfiledJet") -> list[tuple[str, str, str]]:
    """Return the table on the terminal."""
    d, s, ends = found.design, found.shape, found.intervals
    assert d is not None
    assert s is not None

    def between(name: str) -> str:
        return f"{ends[name][0]:.3g} to {ends[name][1]:.3g}"

    return [
        ("axis, where the torque is zero (m)", f"{s.centre:.3g}", ""),
        (
            "least torque about z (mNm), and its place (m)",
            f"{1e3 * s.torques[0]:.3g}, {s.peaks[0]:.3g}",
            between("left"),
        ),
        (
            "largest torque about z (mNm), and its place (m)",
            f"{1e3 * s.torques[1]:.3g}, {s.peaks[1]:.3g}",
            between("right"),
        ),
        ("edges, a fifth of them (m)", f"{s.edges[0]:.3g}, {s.edges[1]:.3g}", ""),
        ("steepest slope (mNm/m)", f"{1e3 * s.slope:.3g}", ""),
        ("gain k (m/s per Nm)", f"{d.gain:.3g}", ""),
        ("bound k tau_max (m/s)", f"{d.bound:.3g}", between("bound")),
        ("fastest fan (m/s)", f"{d.fastest:.3g}", between("fastest")),
        (
            f"offset behind fans of up to {d.designed_for:.2g} m/s, RMS (m)",
            f"{d.offset:.2g}",
            "",
        ),
        (
            "phase (deg), gain and delay margin (s)",
            f"{math.degrees(d.phase_margin):.0f}, {d.gain_margin:.2g}, {d.delay_margin:.2g}",
            "",
        ),
        (
            "rise time of the filter, and the largest for 30 deg (s)",
            f"{d.rise_time:g}, {d.rise_time_margin:.2g}",
            "",
        ),
    ]


def _figures(found: "ProfiledJet") -> dict[str, Any]:
    """Return the result for ``--json`` and ``profile.json``, with units in the names."""
    p, d, s, ends = found.profile, found.design, found.shape, found.intervals
    result: dict[str, Any] = {
        "line": {
            "direction_deg": math.degrees(p.direction),
            "found_by": p.found_by,
            "along_wind_m": p.beside,
            "height_m": p.height,
            "from_m": p.place[0],
            "to_m": p.place[-1],
            "seconds": p.seconds,
            "hovers": len(p.hovers),
            "effective_samples": p.samples,
        },
        "lines_m": p.lines,
        "law": None,
        "why_no_law": found.why or None,
    }
    if s is not None:
        result["jet"] = {
            "axis_m": s.centre,
            "torque_Nm": s.torques,
            "torque_at_m": s.peaks,
            "torque_at_ci95_m": [ends[n] for n in ("left", "right") if n in ends],
            "edges_m": s.edges,
            "slope_Nm_m": s.slope,
        }
    if d is not None:
        result["law"] = {
            "gain": d.gain,
            "bound_m_s": d.bound,
            "bound_ci95_m_s": ends["bound"],
            "fastest_fan_m_s": d.fastest,
            "fastest_fan_ci95_m_s": ends["fastest"],
            "designed_for_m_s": d.designed_for,
            "offset_rms_m": d.offset,
            "rise_time_s": d.rise_time,
            "largest_rise_time_s": d.rise_time_margin,
            "phase_margin_deg": math.degrees(d.phase_margin),
            "gain_margin": d.gain_margin,
            "delay_margin_s": d.delay_margin,
        }
    return result


def _write_table(profiles: "tuple[WindProfile, ...]", path: Path) -> None:
    """Write the curves of all lines as a CSV file: place, line, and mean, low and high of each part
    of the wrench.
    """
    import numpy as np

    from ..identification.logs.tables import write_csv

    columns: dict[str, list[Any]] = {}
    for p in profiles:
        low, high = p.interval
        columns.setdefault("place", []).append(p.place)
        columns.setdefault("along_wind", []).append(np.full(len(p.place), p.beside))
        for i, name in enumerate(_PARTS):
            for part, values in ((name, p.wrench), (f"{name}_low", low), (f"{name}_high", high)):
                columns.setdefault(part, []).append(values[i])
    write_csv({name: np.concatenate(parts) for name, parts in columns.items()}, path)


def _write_law(path: Path, result: dict[str, Any], found: "ProfiledJet") -> None:
    """Write the law for ``fly`` and ``benchmark``."""
    import yaml

    from ..runtime.page_files import write_text
    from ..runtime.plain_values import plain

    assert found.design is not None
    designed = {"by": command_line(), **{key: result[key] for key in ("line", "jet", "law")}}
    law = {
        "law": "admittance",
        "task": "FanTracking",
        "gains": {"gain": found.design.gain},
        "designed": designed,
    }
    write_text(yaml.safe_dump(plain(law), sort_keys=False, width=100), path)
