"""The runner of the paper's figures: the files of a result, and the page that shows them."""

import gzip
import json

import numpy as np
from matplotlib.figure import Figure

from windwrench.paper import NAMES
from windwrench.paper.reproduce import chosen, write_page, write_result
from windwrench.paper.result import Comparison, Result
from windwrench.runtime.provenance import commit, made_by


def small_result(value=1.0):
    figure = Figure()
    figure.subplots().plot([0, value])
    return Result(
        {"value": np.float64(value), "gone": float("nan")},
        {
            "x": np.array([1, 2, 3]),
            "y": np.array([0.1234567, np.nan, 2.0]),
            "name": np.array(list("abc")),
        },
        figure,
        [Comparison("a value (m)", "about 1", f"{value:.2f}")],
        ["A remark."],
    )


def test_a_result_is_a_table_its_figures_and_a_picture(tmp_path):
    write_result("fig0", "A title", 3, small_result(), tmp_path)
    names = sorted(p.name for p in tmp_path.iterdir())
    assert names == ["fig0.csv.gz", "fig0.json", "fig0.png", "fig0.svg"]
    kept = json.loads((tmp_path / "fig0.json").read_text())
    assert kept["figures"] == {"value": 1.0, "gone": None}
    assert kept["commit"] == commit()
    table = gzip.decompress((tmp_path / "fig0.csv.gz").read_bytes())
    assert table == b"x,y,name\n1,0.123457,a\n2,,b\n3,2.0,c\n"


def test_the_page_shows_the_table_and_the_picture(tmp_path):
    write_result("fig3", "A title", 3, small_result(), tmp_path / "out")
    write_page(["fig3", "fig4"], tmp_path / "out", tmp_path / "page.md")
    page = (tmp_path / "page.md").read_text()
    assert "| a value (m) | about 1 | 1.00 |" in page
    assert "![A title](out/fig3.png)" in page
    assert "[CSV](out/fig3.csv.gz)" in page
    assert made_by("windwrench reproduce fig3 --seeds 3", [commit()]) in page.splitlines()
    assert "A remark." in page
    assert "fig4" not in page
    assert chosen("all") == list(NAMES)
