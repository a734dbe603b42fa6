"""The report of a diagnosis: its numbers (JSON), the amended vehicle (YAML) and a page for people
(HTML).
"""

import json
import shlex
from dataclasses import asdict
from importlib import resources
from pathlib import Path
from typing import Any

from ... import __version__
from ...dynamics.vehicle_file import save_vehicle
from ...runtime.plain_values import as_text, plain
from ...runtime.whole_files import replaced
from ..findings import Diagnosis, Errors
from .page import report_page
from .words import headline

# MAJOR.MINOR of ``report.json``, which ``report.schema.json`` beside this file describes: a new key
# is a new minor version, a key that goes or changes its meaning a new major one
SCHEMA_VERSION = "1.2"


def write_report(
    diagnosis: Diagnosis, folder: str | Path, command: str | None = None
) -> list[Path]:
    """Write ``report.json``, ``report.html`` and ``vehicle.yaml`` into a folder, each whole or not
    at all.

    Args:
        diagnosis: what was found.
        folder: it is made if need be.
        command: the command line that made the diagnosis, for the page; default: put together from
            the names of the logs and the vehicle, which lack their folders and the reader.

    Returns:
        the three paths.

    Raises:
        InputError: a file cannot be written.
    """
    folder = Path(folder)
    command = command or _command(diagnosis, folder)
    data = json.dumps(report_data(diagnosis), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
    page = as_text(report_page(diagnosis, command))
    numbers, html, vehicle = folder / "report.json", folder / "report.html", folder / "vehicle.yaml"
    save_vehicle(diagnosis.amended, vehicle)
    for path, text in ((html, page), (numbers, data)):
        with replaced(path) as partial:
            partial.write_text(text, encoding="utf-8")
    return [numbers, html, vehicle]


def report_data(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return what ``report.json`` holds: plain Python values, six significant digits, None for what
    is not finite. ``report_schema`` describes it.
    """
    segments = [[start, end] for _, start, end in diagnosis.held_out_segments]
    error: dict[str, Any] = {
        "held_out_segments": segments,
        "before": _errors(diagnosis.before),
        "after": _errors(diagnosis.after),
        "floor": {
            "force_rms_N": diagnosis.floor_force_rms,
            "torque_rms_Nm": diagnosis.floor_torque_rms,
        },
    }
    if len(diagnosis.logs) + len(diagnosis.test_logs) > 1:
        by_log: dict[str, list[list[float]]] = {}
        for log, start, end in diagnosis.held_out_segments:
            by_log.setdefault(log, []).append([start, end])
        error["held_out_by_log"] = by_log
    stated = diagnosis.probabilities
    names = stated.names if stated else {}
    data: dict[str, Any] = {
        "verdict": diagnosis.verdict,
        "remainder": diagnosis.remainder,
        "effects": [
            asdict(effect) | {"probability": names.get(effect.name)} for effect in diagnosis.effects
        ],
        "alternatives": [asdict(x) for x in stated.alternatives] if stated else [],
        "unknown": stated.unknown if stated else None,
        "error": error,
        "advice": diagnosis.advice,
        "notes": diagnosis.notes,
        "headline": headline(diagnosis),
        "floor_is_lower_bound": diagnosis.floor_is_bound,
        "needs_pose": diagnosis.needs_pose,
        "candidates": [asdict(candidate) for candidate in diagnosis.candidates],
        "structure": [asdict(structure) for structure in diagnosis.structure],
        "gusts": [{"channel": g.channel, "rms": g.rms, "time_s": g.time} for g in diagnosis.gusts],
        "pushes": [
            {"channel": p.channel, "log": p.log, "t_s": p.t, "peak": p.peak}
            for p in diagnosis.pushes
        ],
        "rotor_faults": diagnosis.rotor_faults,
        "logs": diagnosis.logs,
        "test_logs": diagnosis.test_logs,
        "seconds": diagnosis.seconds,
        "cutoff_hz": diagnosis.cutoff_hz,
        "vehicle": diagnosis.declared.name,
        "version": __version__,
        "schema_version": SCHEMA_VERSION,
    }
    kept: dict[str, Any] = plain(data, 6)
    return kept


def report_schema() -> dict[str, Any]:
    """Return the JSON Schema (draft 2020-12) of ``report.json``."""
    text = resources.files(__package__).joinpath("report.schema.json").read_text(encoding="utf-8")
    schema: dict[str, Any] = json.loads(text)
    return schema


def _errors(errors: Errors) -> dict[str, float]:
    return {
        "force_rms_N": errors.force_rms,
        "torque_rms_Nm": errors.torque_rms,
        "nis_without_wrench_state": errors.nis_without_wrench_state,
        "rollout_1s_position_rms_m": errors.rollout_1s_position_rms,
    }


def _command(diagnosis: Diagnosis, folder: Path) -> str:
    tests = [word for log in diagnosis.test_logs for word in ("--test", log)]
    given = [*diagnosis.logs, *tests, "--vehicle", diagnosis.declared.name, "--out", str(folder)]
    return shlex.join(["windwrench", "diagnose", *given])
