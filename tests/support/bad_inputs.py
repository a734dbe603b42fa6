"""Files that a command refuses, each with one mistake; the golden error lines name them.

``tests/data/bad_inputs.json`` holds a good vehicle and a good map, the fields by which each bad one
differs, the cells of a row in which a log differs from a hover, and whole files.
"""

import gzip
import io
import json

from tests.support.paths import ROOT

KEPT = json.loads((ROOT / "tests" / "data" / "bad_inputs.json").read_bytes())
COLUMNS = ("t", "px", "py", "pz", "qw", "qx", "qy", "qz", "omega1", "omega2", "omega3", "omega4")


def table(changes=(), rows=60, left_out="", **more):
    """Return a hover at 100 Hz as CSV: some cells changed, one column left out, ``more`` added."""
    names = [name for name in (*COLUMNS, *more) if name != left_out]
    hover = dict.fromkeys(COLUMNS, "0") | {"pz": "1", "qw": "1"} | more
    hover |= {f"omega{i}": "390.5" for i in range(1, 5)}
    lines = [",".join(names)]
    for row in range(rows):
        cells = hover | {"t": f"{0.01 * row:.2f}"}
        cells |= {name: text for (where, name), text in dict(changes).items() if where == row}
        lines.append(",".join(cells[name] for name in names))
    return "\n".join(lines) + "\n"


def forms(kind, letter):
    """Return files of a kind as YAML: the good one with some fields changed, or one left out."""
    good = KEPT[kind]
    changed = {name: good | fields for name, fields in KEPT[f"{kind}s"].items()}
    for name in good:
        changed[f"no_{name}"] = {k: v for k, v in good.items() if k != name}
    return {
        f"{letter}_{name}.yaml": "".join(f"{k}: {v}\n" for k, v in fields.items())
        for name, fields in changed.items()
    }


def logs():
    """Return tables, each with one mistake, and logs that end too early."""
    good = table()
    packed = io.BytesIO()
    with gzip.GzipFile(fileobj=packed, mode="wb", mtime=0) as file:
        file.write(good.encode())
    in_ms = {(i, "t"): f"{10 * i}" for i in range(60)}
    in_rpm = {(i, f"omega{j}"): "3729" for i in range(60) for j in range(1, 5)}
    changed = {
        name: table({(5, column): text for column, text in cells.items()})
        for name, cells in KEPT["cells"].items()
    }
    changed |= {f"no_{name}": table(left_out=name) for name in ("t", "px", "qw", "omega1")}
    changed |= {
        "log": good,
        "header": good.splitlines()[0] + "\n",
        "one_row": table(rows=1),
        "ragged": good.replace("0.05,0", "0.05", 1),
        "twice": good.replace("px,py", "px,px", 1),
        "ms": table(in_ms),
        "rpm": table(in_rpm),
    }
    return {f"{name}.csv": text for name, text in changed.items()} | {
        "nul.csv": b"t,px\x00\n1,2\n",
        "latin.csv": b"t,p\xe4\n1,2\n",
        "zeros.csv": bytes(400),
        "cut.csv.gz": packed.getvalue()[:-30],
        "text.csv.gz": good,
        "text.parquet": good,
        "noise.bin": bytes(range(256)),
        "cut.ulg": (ROOT / "tests" / "data" / "px4" / "sample.ulg").read_bytes()[:3000],
        "header.ulg": b"ULog\x01\x12\x35\x01" + bytes(8),
        "dataflash.bin": b"\xa3\x95\x80" + bytes(200),
    }


def policies():
    """Return policies whose weights or cards do not fit."""
    folder = ROOT / "training" / "policies"
    weights = (folder / "sac-0.npz").read_bytes()
    card = json.loads((folder / "sac-0.json").read_bytes())
    bare = {k: v for k, v in card.items() if k != "features"}
    cards = {
        "other": card,
        "format": card | {"format": 9},
        "activation": card | {"activation": "step"},
        "features": bare,
    }
    good = ("no_card", "format", "text", "activation", "features", "empty")
    return (
        {f"p_{name}.json": json.dumps(entries) for name, entries in cards.items()}
        | {f"p_{name}.npz": weights for name in good}
        | {"p_other.npz": weights[:-1]}
    )


def write_file(path, content):
    """Write a text, or bytes; return the path."""
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def write_bad_inputs(folder):
    """Write every file into a folder, beside the empty folder ``nothing``."""
    found = forms("vehicle", "v") | forms("map", "m") | KEPT["files"] | logs() | policies()
    mine = "".join(f"{k}: {v}\n" for k, v in KEPT["vehicle"].items())
    found |= {"mine.yaml": mine, "v_deep.yaml": "[" * 200 + "]" * 200}
    for name, content in found.items():
        write_file(folder / name, content)
    (folder / "nothing").mkdir()
