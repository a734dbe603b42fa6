"""Text tables as people write them."""

import numpy as np
import pytest

from windwrench.identification.logs.tables import open_table


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
    np.testing.assert_array_equal([column[0] for column in values.values()], first)
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
    np.testing.assert_array_equal(values["m"], np.arange(60))
    np.testing.assert_array_equal(np.isnan(values["x"]), np.arange(60) < 20)


def test_latin_letters_of_an_old_encoding_are_read(opened):
    assert opened("t;roll [°]\n0;1\n1;2\n", encoding="latin-1").header == ("t", "roll [°]")
