"""The report of a diagnosis: its numbers (JSON), the amended vehicle (YAML) and a page for people
(HTML).
"""

import json
import shlex
from dataclasses import asdict, astuple
from pathlib import Path

from ... import __version__
from ...dynamics.vehicle_file import save_vehicle
from ...runtime.page_files import write_text
from ...runtime.plain_values import as_text, plain
from ..findings import Diagnosis
from ..logs.table import Data
from .headline import headline
from .page import page_file, report_page

# MAJOR.MINOR of ``report.json`` (see ``report.schema.json`` beside this file): a new key is a new
# minor version, a removed key or a new meaning a new major one
SCHEMA_VERSION = "1.3"
# attributes of a diagnosis under their own names in ``report.json``
_AS_FOUND = (
    "advice",
    "notes",
    "needs_pose",
    "candidates",
    "structure",
    "rotor_faults",
    "logs",
    "test_logs",
    "seconds",
    "cutoff_hz",
)
# names of the fields of ``Errors`` there, in order
_ERRORS = (
    "force_rms_N",
    "torque_rms_Nm",
    "nis_without_wrench_state",
    "rollout_1s_position_rms_m",
)
_STATED = ("name", "coefficients", "std", "units", "evidence")  # of an effect not needed


def write_report(
    diagnosis: Diagnosis, folder: str | Path, command: str | None = None
) -> list[Path]:
    """Write ``report.json``, ``report.html`` and ``vehicle.yaml`` into a folder, each whole or not
    at all.

    Args:
        diagnosis: the result.
        folder: made if need be.
        command: the diagnosis' command line, for the page; default: the names of the logs and the
            vehicle, without folders and reader.

    Returns:
        the three paths.

    Raises:
        InputError: a file cannot be written.
    """
    folder = Path(folder)
    tests = [word for log in diagnosis.test_logs for word in ("--test", log)]
    given = [*diagnosis.logs, *tests, "--vehicle", diagnosis.declared.name, "--out", str(folder)]
    command = command or shlex.join(["windwrench", "diagnose", *given])
    data = json.dumps(report_data(diagnosis), indent=1, allow_nan=False, ensure_ascii=False) + "\n"
    page = as_text(report_page(diagnosis, command))
    numbers, html, vehicle = folder / "report.json", folder / "report.html", folder / "vehicle.yaml"
    save_vehicle(diagnosis.amended, vehicle, {e.name: e.std for e in diagnosis.effects})
    write_text(page, html)
    write_text(data, numbers)
    return [numbers, html, vehicle]


def report_data(diagnosis: Diagnosis) -> Data:
    """Return the content of ``report.json``, as in ``report_schema``: plain Python values, six
    significant digits, None for numbers that are not finite.
    """
    error: Data = {
        "held_out_segments": [[start, end] for _, start, end in diagnosis.held_out_segments],
        "before": dict(zip(_ERRORS, astuple(diagnosis.before), strict=True)),
        "after": dict(zip(_ERRORS, astuple(diagnosis.after), strict=True)),
        "floor": {
            "force_rms_N": diagnosis.floor_force_rms,
            "torque_rms_Nm": diagnosis.floor_torque_rms,
        },
    }
    if len(diagnosis.logs) + len(diagnosis.test_logs) > 1:
        error["held_out_by_log"] = diagnosis.held_out_by_log
    stated = diagnosis.probabilities
    data = {
        "verdict": diagnosis.verdict,
        "remainder": diagnosis.remainder,
        "effects": [
            asdict(x) | {"probability": stated.names.get(x.name)} for x in diagnosis.effects
        ],
        "alternatives": stated.alternatives,
        "unknown": stated.unknown,
        "error": error,
        **{name: getattr(diagnosis, name) for name in _AS_FOUND},
        "not_needed": [{key: getattr(x, key) for key in _STATED} for x in diagnosis.not_needed],
        "headline": headline(diagnosis),
        "floor_is_lower_bound": diagnosis.floor_is_bound,
        "gusts": [{"channel": g.channel, "rms": g.rms, "time_s": g.time} for g in diagnosis.gusts],
        "pushes": [
            {"channel": p.channel, "log": p.log, "t_s": p.t, "peak": p.peak}
            for p in diagnosis.pushes
        ],
        "vehicle": diagnosis.declared.name,
        "version": __version__,
        "schema_version": SCHEMA_VERSION,
    }
    kept: Data = plain(data, 6)
    return kept


def report_schema() -> Data:
    """Return the JSON Schema (draft 2020-12) of ``report.json``."""
    schema: Data = json.loads(page_file("report.schema.json"))
    return schema
