"""Where the measured flights lie: beside a checkout, not in it. Without them the tests that need
them are skipped.
"""

import pytest

from tests.support.paths import ROOT

DATA = ROOT.parent / "shared" / "data"
NANOBENCH = (
    "B2_circle_fast_rep3",
    "B3_figure8_medium_rep3",
    "B5_helix_fast_rep2",
    "B7_oval_medium_rep3",
)


def data_file(relative):
    path = DATA / relative
    if not path.exists():
        pytest.skip(f"measured data not here: {path}")
    return path
