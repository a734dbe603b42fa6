"""Text tables as people write them."""

import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from tests.support.programs import said
from windwrench.identification.logs.flight_log import POSE, ROTORS
from windwrench.identification.logs.text_table import open_table
from windwrench.runtime.file_limits import LIMITS


@pytest.fixture
def opened(tmp_path):
    """Return what writes a text to a file and opens it as a table."""

    def open_text(text, name="a.csv", encoding="utf-8"):
        (tmp_path / name).write_bytes(text.encode(encoding))
        return open_table(tmp_path / name)

    return open_text


@pytest.mark.parametrize(
    ("name", "text", "header", "first"),
    [
        ("a.csv", "t,x,y\n0,1,2\n1,2,3\n", "t x y", [0, 1, 2]),
        ("a.csv", "t;x;y\n0,5;1,25;2\n1,5;2;3\n", "t x y", [0.5, 1.25, 2]),
        ("a.tsv", "t\tx\n0,5\t1e-3\n1\t2\n", "t x", [0.5, 0.001]),
        ("a.txt", "# t x y\n0.1   1 2\n0.2 3    4\n", "t x y", [0.1, 1, 2]),
        ("a.csv", "#a\n#b=3\nt,x\n[s],[m]\n0,1\n1,2\n", "t x", [0, 1]),
        ("a.csv", "t, x ,\n0, 1,\n1, 2,\n", "t x", [0, 1]),
        ("a.csv", '"t";"x"\n"0,5";"1,5"\n"1,5";"2"\n', "t x", [0.5, 1.5]),
        ("a.csv", "t,x\r\n0,NaN\r\n1,2\r\n", "t x", [0, np.nan]),
        ("a.csv", "t,x\n0,null\n1,2\n", "t x", [0, np.nan]),
        ("a.csv", "\ufefft,x\r\n0,1\r\n1,2\r\n\r\n", "t x", [0, 1]),
        ("a.csv", "1,2,3\n2,3,4\n", "1 2 3", [1, 2, 3]),
    ],
)
def test_a_layout_is_found(opened, name, text, header, first):
    table = opened(text, name)
    assert " ".join(table.header) == header
    values = table.read(list(table.header))
    assert_array_equal([column[0] for column in values.values()], first)
    assert table.rows == 2


def test_units_behind_the_header_are_kept(opened):
    table = opened("t,x\n[s],[mm]\n0,1\n1,2\n")
    assert table.units == ("[s]", "[mm]")
    assert table.row(0) == "row 1 (line 3)"


def test_a_last_line_that_was_cut_off_is_left_out(opened):
    table = opened("t;x;y\n0;1;2\n1;2;3\n2;3")
    assert table.rows == 2
    assert table.notes[1:] == ("the last line was cut off, and left out",)
    assert table.read(["y"])["y"].tolist() == [2.0, 3.0]


def test_rows_with_few_numbers_at_the_start_are_rows(opened):
    """A pose that comes late: the header is before all rows, not before the first that is full."""
    late = "".join(f"{k},,,,{k}\n" for k in range(20))
    table = opened("t,x,y,z,m\n" + late + "".join(f"{k},1,2,3,{k}\n" for k in range(20, 60)))
    assert (table.header, table.rows, table.notes) == (("t", "x", "y", "z", "m"), 60, ())
    values = table.read(["m", "x"])
    assert_array_equal(values["m"], np.arange(60))
    assert_array_equal(np.isnan(values["x"]), np.arange(60) < 20)


def test_latin_letters_of_an_old_encoding_are_read(opened):
    assert opened("t;roll [°]\n0;1\n1;2\n", encoding="latin-1").header == ("t", "roll [°]")


def test_three_hours_at_200_hz_are_within_the_limits():
    rows = 3 * 3600 * 200
    columns = 20
    characters = 7.5e8
    assert rows < LIMITS.table_rows
    assert rows * columns < LIMITS.table_numbers
    assert characters < LIMITS.table_text


CHECK = """
import os
import sys
from pathlib import Path
from windwrench.identification.report.log_channels import plot_channels
from windwrench.identification.report.log_check import check_log

for path in map(Path, sys.argv[1:]):
    if not os.fork():  # each begins with what is imported, and no more
        found = check_log(path, None, None, None, None)
        plot_channels("flight", found.channels, path.with_suffix(".png"))
        status = Path("/proc/self/status").read_text()
        print(len(found.log.t), 1024 * int(status.split("VmHWM:")[1].split()[0]), flush=True)
        os._exit(0)
    os.wait()
"""


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="memory as Linux tells it")
def test_the_memory_of_a_check_is_in_proportion_to_the_numbers_that_are_read(tmp_path):
    header = ["t", *POSE, *ROTORS, "vbat", "fx", "fy", "fz", "tx", "ty", "tz"]
    columns = default_rng(0).normal(0.0, 0.001, (1000, len(header) - 1))
    columns[:, 3:7] = 1.0, 0.0, 0.0, 0.0
    columns[:, 7:11] += 300.0
    columns[:, 11] += 12.0
    rest = [",".join(f"{x:.6g}" for x in row) for row in columns.tolist()]
    paths = [tmp_path / "few.csv", tmp_path / "many.csv"]
    for path, rows in zip(paths, (12_000, 36_000), strict=True):
        lines = (f"{0.005 * i:.3f},{rest[i % 1000]}" for i in range(rows))
        path.write_text("\n".join([",".join(header), *lines]))
    few, before, many, after = map(int, said(sys.executable, "-c", CHECK, *paths).split())
    assert (few, many) == (12_000, 36_000)
    assert after - before < 7.5 * 8 * len(header) * (many - few)  # 4.8 over an hour


NUMBER = st.one_of(
    st.floats(allow_infinity=False).map(repr),
    st.floats(-1e9, 1e9).map("{:.6f}".format),
    st.floats(-1e9, 1e9).map("{:+.11e}".format),
    st.integers(-(10**21), 10**21).map(str),
    st.integers(2**53, 2**54).map("{}.5".format),  # a tie
    st.sampled_from(["", " 3.25 ", "+1.", "-.5", "-0", "NaN", "1e400", "00012.50"]),
)


@given(st.lists(NUMBER, min_size=3, max_size=30))
def test_plain_numbers_are_those_of_python(tmp_path_factory, numbers):
    path = tmp_path_factory.mktemp("numbers") / "table.csv"
    rows = [f"{i},{text}" for i, text in enumerate(numbers)]
    path.write_text("\n".join(["t,x", "0,0", "0,0", *rows]))
    got = open_table(path).read(["x"])["x"][2:]
    want = np.array([float(text or "nan") for text in numbers])
    assert_array_equal(got, want)
    assert_array_equal(np.signbit(got), np.signbit(want))
