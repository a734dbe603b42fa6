"""Files that a command refuses, each with one mistake; the golden error lines name them."""

import gzip
import io
import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from tests.support.paths import ROOT

COLUMNS = ("t", "px", "py", "pz", "qw", "qx", "qy", "qz", "omega1", "omega2", "omega3", "omega4")
VEHICLE = {
    "name": "mine",
    "mass": "0.5",
    "inertia": "[3e-3, 3e-3, 5e-3]",
    "arm_l": "0.12",
    "k": "[8e-6, 8e-6, 8e-6, 8e-6]",
    "p": "[2e-7, 2e-7, 2e-7, 2e-7]",
}
MAP = {
    "time": "{column: t}",
    "position": "{columns: [px, py, pz]}",
    "attitude": "{columns: [qw, qx, qy, qz]}",
    "rotors": "{columns: [omega1, omega2, omega3, omega4], unit: rad/s}",
}


def table(changes: Mapping[tuple[int, str], str] = {}, rows: int = 60, left_out: str = "") -> str:
    """Return a hover at 100 Hz as CSV, with some cells changed and one column left out."""
    names = [name for name in COLUMNS if name != left_out]
    hover = dict.fromkeys(COLUMNS, "0") | {"pz": "1", "qw": "1"}
    hover |= {f"omega{i}": "390.5" for i in range(1, 5)}
    lines = [",".join(names)]
    for row in range(rows):
        cells = hover | {"t": f"{0.01 * row:.2f}"}
        cells |= {name: text for (where, name), text in changes.items() if where == row}
        lines.append(",".join(cells[name] for name in names))
    return "\n".join(lines) + "\n"


def settings(base: Mapping[str, str], without: str = "", **changes: str) -> str:
    """Return a YAML text of the fields of ``base`` with some changed and one left out."""
    fields = {name: text for name, text in (dict(base) | changes).items() if name != without}
    return "".join(f"{name}: {text}\n" for name, text in fields.items())


def vehicles() -> dict[str, str]:
    """Return vehicle files, each with one mistake."""
    bad: dict[str, dict[str, str]] = {
        "mass_text": {"mass": "heavy"},
        "mass_negative": {"mass": "-1"},
        "mass_infinite": {"mass": ".inf"},
        "arm_zero": {"arm_l": "0"},
        "k_three": {"k": "[8e-6, 8e-6, 8e-6]"},
        "k_negative": {"k": "[8e-6, 8e-6, 8e-6, -8e-6]"},
        "p_text": {"p": "[a, b, c, d]"},
        "inertia_two": {"inertia": "[3e-3, 3e-3]"},
        "inertia_skew": {"inertia": "[[3e-3, 1e-3, 0], [0, 3e-3, 0], [0, 0, 5e-3]]"},
        "inertia_negative": {"inertia": "[3e-3, -3e-3, 5e-3]"},
        "radius_zero": {"rotor_radius": "0"},
        "gravity_text": {"gravity": "down"},
        "lsb_negative": {"omega_lsb": "-1"},
        "voltage_negative": {"voltage_ref": "-11.1"},
        "floor_above": {"floor_z": "3", "ceiling_z": "2"},
        "spin_two": {"spin": "[1, -1, 2, -1]"},
        "rotors_flat": {"rotor_positions": "[1, 2, 3]"},
        "rotors_in_line": {"rotor_positions": "[[.1, 0, 0], [.2, 0, 0], [-.1, 0, 0], [-.2, 0, 0]]"},
        "com_two": {"com": "[0, 0]"},
        "omega_guessed": {"omega_source": "guessed"},
        "mocap_number": {"mocap": "200"},
        "mocap_key": {"mocap": "{rate: 200}"},
        "mocap_rate": {"mocap": "{rate_hz: 0}"},
        "curve_number": {"motor_curve": "3"},
        "curve_key": {"motor_curve": "{thrust: [0, 2], force: 3}"},
        "curve_short": {"motor_curve": "{thrust: [2]}"},
        "curve_negative": {"motor_curve": "{thrust: [0, -2]}"},
        "curve_command": {"motor_curve": "{thrust: [0, 2], command: [2000, 1000]}"},
        "effects_word": {"effects": "drag"},
        "effect_text": {"effects": "[rotor_drag]"},
        "effect_unknown": {"effects": "[{name: rotor_dragg}]"},
        "effect_list": {"effects": "[{name: rotor_drag, coefficients: [1]}]"},
        "effect_coefficient": {"effects": "[{name: rotor_drag, coefficients: {kd: 1}}]"},
        "effect_range": {"effects": "[{name: rotor_drag, coefficients: {kdx: -1}}]"},
        "effect_value": {"effects": "[{name: rotor_drag, coefficients: {kdx: much}}]"},
        "key_unknown": {"weight": "5"},
    }
    texts = {f"v_{name}.yaml": settings(VEHICLE, **fields) for name, fields in bad.items()}
    texts |= {f"v_no_{name}.yaml": settings(VEHICLE, without=name) for name in VEHICLE}
    return texts | {
        "v_list.yaml": "[1, 2]\n",
        "v_broken.yaml": "name: [\n",
        "v_object.yaml": "!!python/object:os.system {}\n",
        "v_deep.yaml": "[" * 200 + "]" * 200,
        "mine.yaml": settings(VEHICLE),
    }


def logs() -> dict[str, str | bytes]:
    """Return tables, each with one mistake."""
    good = table()
    kits: dict[str, str | bytes] = {
        f"no_{name}.csv": table(left_out=name) for name in ("t", "px", "qw", "omega1")
    }
    changed = {
        "nan_t": {(5, "t"): "nan"},
        "nan_px": {(5, "px"): "nan"},
        "inf_qw": {(5, "qw"): "inf"},
        "text_px": {(5, "px"): "here"},
        "t_back": {(5, "t"): "0.01"},
        "t_twice": {(5, "t"): "0.04"},
        "long_quaternion": {(5, "qw"): "2"},
        "negative_omega": {(5, "omega3"): "-3"},
        "huge_px": {(5, "px"): "1e300"},
    }
    kits |= {f"{name}.csv": table(cells) for name, cells in changed.items()}
    t = np.arange(60)
    in_ms = {(int(i), "t"): f"{10 * i}" for i in t}
    in_rpm = {(int(i), f"omega{j}"): "3729" for i in t for j in range(1, 5)}
    zipped = io.BytesIO()
    with gzip.GzipFile(fileobj=zipped, mode="wb", mtime=0) as file:
        file.write(good.encode())
    return kits | {
        "log.csv": good,
        "empty.csv": "",
        "header.csv": good.splitlines()[0] + "\n",
        "one_row.csv": table(rows=1),
        "ragged.csv": good.replace("0.05,0", "0.05", 1),
        "twice.csv": good.replace("px,py", "px,px", 1),
        "ms.csv": table(in_ms),
        "rpm.csv": table(in_rpm),
        "other.csv": "time,x,y,z\n0,1,2,3\n1,2,3,4\n",
        "nul.csv": b"t,px\x00\n1,2\n",
        "latin.csv": b"t,p\xe4\n1,2\n",
        "zeros.csv": bytes(400),
        "cut.csv.gz": zipped.getvalue()[:-30],
        "text.csv.gz": good,
        "text.parquet": good,
        "note.txt": "no log at all\n",
        "noise.bin": bytes(range(256)),
        "cut.ulg": (ROOT / "tests" / "data" / "px4" / "sample.ulg").read_bytes()[:3000],
        "header.ulg": b"ULog\x01\x12\x35\x01" + bytes(8),
        "text.bag": "no bag\n",
        "text.db3": "no bag\n",
        "text.bbl": "H Product:Blackbox flight data recorder by Nicholas Sherlock\n",
        "dataflash.bin": b"\xa3\x95\x80" + bytes(200),
    }


def maps() -> dict[str, str]:
    """Return maps, each with one mistake."""
    changed: dict[str, dict[str, str]] = {
        "key": {"speed": "{column: v}"},
        "time_unit": {"time": "{column: t, unit: hours}"},
        "time_rate": {"time": "{column: t, rate_hz: 100}"},
        "time_text": {"time": "t"},
        "world": {"world": "xyz"},
        "body": {"body": "up"},
        "two_columns": {"position": "{columns: [px, py]}"},
        "unit": {"position": "{columns: [px, py, pz], unit: miles}"},
        "scale": {"position": "{columns: [px, py, pz], scale: 0}"},
        "signs": {"position": "{columns: [px, py, pz], signs: [1, 2, 1]}"},
        "optional": {"position": "{columns: [px, py, pz], optional: perhaps}"},
        "section_text": {"position": "here"},
        "absent": {"position": "{columns: [x, y, z]}"},
        "field": {"position": "{columns: [px, py, pz], units: m}"},
        "sense": {"attitude": "{columns: [qw, qx, qy, qz], sense: both}"},
        "order": {"attitude": "{columns: [qw, qx, qy, qz], order: zyxw}"},
        "euler": {"attitude": "{columns: [qx, qy, qz], euler: zzz}"},
        "rotor_order": {
            "rotors": "{columns: [omega1, omega2, omega3, omega4], order: px5, unit: rad/s}"
        },
        "rotor_unit": {"rotors": "{columns: [omega1, omega2, omega3, omega4], unit: deg}"},
        "commands": {"commands": "{columns: [omega1, omega2, omega3, omega4], unit: counts}"},
        "cells": {"battery": "{column: qx, cells: 0}"},
        "force": {"force": "{columns: [px, py, pz]}"},
        "recognise": {"recognise": "t"},
    }
    texts = {f"m_{name}.yaml": settings(MAP, **fields) for name, fields in changed.items()}
    texts |= {f"m_no_{name}.yaml": settings(MAP, without=name) for name in MAP}
    return texts | {"m_list.yaml": "[]\n", "m_broken.yaml": "time: {\n"}


def others() -> dict[str, str | bytes]:
    """Return manifests, policies, configurations, topics and control laws, each with a mistake."""
    policies = ROOT / "training" / "policies"
    weights = (policies / "sac-0.npz").read_bytes()
    card = json.loads((policies / "sac-0.json").read_text(encoding="utf-8"))
    return {
        "f_text.yaml": "logs\n",
        "f_key.yaml": "logs: []\nfleet: x\n",
        "f_order.yaml": "logs: []\norder: size\n",
        "f_entry.yaml": "logs: [log.csv]\n",
        "f_entry_key.yaml": "logs: [{log: '*.csv', drone: a}]\n",
        "f_reader.yaml": "logs: [{log: '*.csv', reader: px5}]\n",
        "f_map.yaml": "logs: [{log: '*.csv', map: rmp}]\n",
        "f_time.yaml": "logs: [{log: '*.csv', time: noon}]\n",
        "f_time_inf.yaml": "logs: [{log: '*.csv', time: .inf}]\n",
        "f_vehicle.yaml": "logs: [{log: '*.csv', vehicle: ardrone}]\n",
        "f_column.csv": "path,vehicle\na.csv,ardrone2\n",
        "f_ragged.csv": "log,vehicle\na.csv\n",
        "p_no_card.npz": weights,
        "p_other.npz": weights[:-1],
        "p_other.json": json.dumps(card),
        "p_format.npz": weights,
        "p_format.json": json.dumps(card | {"format": 9}),
        "p_text.npz": weights,
        "p_text.json": "no card",
        "p_activation.npz": weights,
        "p_activation.json": json.dumps(card | {"activation": "step"}),
        "p_features.npz": weights,
        "p_features.json": json.dumps({k: v for k, v in card.items() if k != "features"}),
        "p_empty.npz": weights,
        "p_empty.json": "",
        "c_list.yaml": "[]\n",
        "c_key.yaml": "stepps: 3\n",
        "c_kind.yaml": "steps: many\n",
        "c_nested.yaml": "learner: 3\n",
        "c_broken.yaml": "steps: [\n",
        "topics_list.yaml": "[]\n",
        "topics_key.yaml": "pose: /a\nspeed: /b\n",
        "own_absent.py": "class Law:\n    pass\n",
        "own_broken.py": "def law(:\n",
        "own_raising.py": "x = 1 / 0\n",
        "taken": "a file\n",
    }


def write_bad_inputs(folder: Path) -> None:
    """Write every file into a folder, beside the folders ``fleet`` and ``nothing``."""
    for name, content in {**vehicles(), **logs(), **maps(), **others()}.items():
        data = content.encode() if isinstance(content, str) else content
        (folder / name).write_bytes(data)
    for name in ("fleet", "nothing"):
        (folder / name).mkdir()
    (folder / "fleet" / "flight.csv").write_text(table(), encoding="utf-8")
