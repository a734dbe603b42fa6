"""Arrays, structs and lists as columns of one table: MATLAB, NumPy, Parquet and text."""

import shutil
import sys
from contextlib import suppress

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.outcomes import refused
from windwrench.identification.logs.log_map import parse_map
from windwrench.identification.logs.mapped_log import map_table
from windwrench.identification.logs.text_table import open_table
from windwrench.runtime.errors import InputError

COUNT = 50
T = 0.01 * np.arange(COUNT)
PLACE = np.column_stack([0.1 * T, 0.2 * T, 1.0 + T])
TURN = np.tile([1.0, 0.0, 0.0, 0.0], (COUNT, 1))
RPM = 3600.0 + np.arange(4.0 * COUNT).reshape(COUNT, 4)
MAP = {
    "time": {"column": "t"},
    "position": {"columns": [f"pose.p[{i}]" for i in range(3)]},
    "attitude": {"columns": [f"pose.q[{i}]" for i in range(4)]},
    "rotors": {"columns": [f"rpm[{i}]" for i in range(4)], "unit": "rpm"},
}


def saved(path):
    """Write the flight in the form that the file's name says."""
    if path.suffix == ".npz":
        np.savez_compressed(path, **{"t": T, "pose.p": PLACE, "pose.q": TURN, "rpm": RPM})
    elif path.suffix == ".mat":
        from scipy.io import savemat

        pose = {"p": PLACE.T, "q": TURN}  # MATLAB users have either orientation
        told = {"about": "a flight", "gains": [1.0, 2.0, 3.0]}
        savemat(path, {"t": T[:, None], "pose": pose, "rpm": RPM} | told, do_compression=True)
    elif path.suffix == ".parquet":
        pyarrow = pytest.importorskip("pyarrow", reason="pip install 'windwrench[parquet]'")
        from pyarrow import parquet

        pose = [{"p": list(p), "q": list(q)} for p, q in zip(PLACE, TURN, strict=True)]
        told = {"mode": ["hover"] * COUNT, "rpm": [None, *map(list, RPM[1:])]}
        parquet.write_table(pyarrow.table({"t": T, "pose": pose, **told}), path)
    else:
        lines = ["t,pose.p,pose.q,rpm,mode"]
        for row in zip(T.tolist(), PLACE.tolist(), TURN.tolist(), RPM.tolist(), strict=True):
            t, p, q, rpm = row
            lines.append(f'{t},"{p}","({q[0]} {q[1]} {q[2]} {q[3]})","{rpm if t else []}",hover')
        path.write_text("\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize("name", ["a.mat", "a.npz", "a.parquet", "a.csv"])
def test_columns_of_arrays_and_lists_are_read_by_a_map(tmp_path, name):
    log = map_table(open_table(saved(tmp_path / name)), parse_map(MAP, "map"))
    rows = slice(COUNT - len(log.t), None)  # an empty list is a sample that is not there
    assert len(log.t) >= COUNT - 1
    assert_allclose(log.position, PLACE[rows])
    assert_allclose(log.rotor_speeds * 30.0 / np.pi, RPM[rows])


def test_arrays_of_other_lengths_are_left_out_with_a_note(tmp_path):
    table = open_table(saved(tmp_path / "a.mat"))
    assert table.rows == COUNT
    assert table.notes == ("arrays of other lengths than 50 were left out: gains",)


@pytest.mark.parametrize(
    ("data", "expected"),
    [
        (b"MATLAB 7.3 MAT-file, " + bytes(200), "is MATLAB's version 7.3; expected version 7"),
        (b"no arrays at all", "cannot be read as a flight log"),
    ],
)
def test_a_matlab_file_that_cannot_be_read_says_what_to_do(tmp_path, monkeypatch, data, expected):
    monkeypatch.setattr("windwrench.identification.logs.tables.find_spec", lambda _: None)
    (tmp_path / "a.mat").write_bytes(data)
    with refused(expected):
        open_table(tmp_path / "a.mat")


def test_a_spoiled_matlab_file_is_refused_or_read(tmp_path):
    """scipy's reader ends its process at some of these."""
    from scipy.io import savemat

    savemat(tmp_path / "whole.mat", {"t": T, "log": {"p": PLACE, "about": ["x", "yy"]}})
    good = (tmp_path / "whole.mat").read_bytes()
    rng = default_rng(0)
    data = np.frombuffer(good, np.uint8).copy()
    data[rng.integers(0, 700, 3)] = rng.integers(0, 256, 3)
    (tmp_path / "a.mat").write_bytes(data[: rng.integers(1, 2 * len(data))].tobytes())
    with suppress(InputError):
        assert open_table(tmp_path / "a.mat").rows > 1


def test_a_reader_that_ends_its_process_ends_in_one_line(tmp_path, monkeypatch):
    path = saved(tmp_path / "a.mat")
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    with refused(r"a\.mat: cannot be read as .*: a spoiled MATLAB file"):
        open_table(path)
