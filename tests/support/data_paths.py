"""Where measured flights lie: excerpts in the checkout, whole originals beside it.

``tests/data`` holds short excerpts of logs whose licences allow it; every clone has them. The whole
originals are larger, and some may be measured with but not copied: they lie in the folder that the
environment variable WINDWRENCH_DATA names, by default ``shared/data`` beside the checkout. Tests
that need one which is not there are skipped, and say where it comes from.
"""

import os
from pathlib import Path

import pytest

from tests.support.paths import ROOT

EXCERPTS = ROOT / "tests" / "data"
EXAMPLE = ROOT / "identification" / "logs" / "example"
DATA = Path(os.environ.get("WINDWRENCH_DATA") or ROOT.parent / "shared" / "data")
NANOBENCH = (
    "B2_circle_fast_rep3",
    "B3_figure8_medium_rep3",
    "B5_helix_fast_rep2",
    "B7_oval_medium_rep3",
)
# where the originals of each folder of DATA come from
SOURCES = {
    "nanobench": (
        "the CSV files of datasets/dataset in github.com/syediu/nanobench-iros2026 "
        "(NanoBench, arXiv 2603.09908)"
    ),
    "crazyswarm2_payload": (
        "the logs of github.com/IMRCLab/crazyswarm2-tools, converted to CSV with the columns that "
        "tests/data/README.md lists"
    ),
    "crazypad": (
        "the flights of github.com/AerialRoboticsUUST/CrazyPAD (Data 2024, 9, 79), converted to CSV"
    ),
    "crazyflie_imu": (
        "the SD-card logs log10, log15 and log16 of "
        "github.com/arplaboratory/data-driven-system-identification"
    ),
    "ardupilot": "backend_log_80k.BIN of the tests of github.com/ArduPilot/MethodicConfigurator",
    "motor_faults": "the ULogs of github.com/lerlis/RLS-fault-diagnosis-for-RflyMAD",
    "racer": "test flights of NeuroBEM as republished by github.com/RCL-NUS/NeuroMHE, as CSV",
    "px4": "the logs of the test folder in github.com/PX4/pyulog",
    "flights": (
        "simulated flights of another simulator, which are not published; those of RotorPy "
        "(pip install rotorpy) practise the same"
    ),
}


def data_file(relative):
    """Return the path of a whole original; skip the test where it is not there."""
    path = DATA / relative
    if not path.exists():
        pytest.skip(missing(relative))
    return path


def missing(relative):
    """Return the words for an original that is not there: what it is and how to get it."""
    name = Path(relative).parts[0]
    return (
        f"measured data {relative} is not in {DATA}: put there, in a folder {name}, "
        f"{SOURCES[name]}, or set WINDWRENCH_DATA to where it is"
    )


def excerpt(relative):
    """Return the path of an excerpt that comes with the checkout, one of them with the package."""
    shipped = EXAMPLE / Path(relative).name
    return shipped if shipped.exists() else EXCERPTS / relative


def crazyswarm2_file(number):
    """Return the path of a crazyswarm2 log: an excerpt, which has all of its rows, where there is
    one.
    """
    path = excerpt(f"crazyswarm2/log{number}.csv.gz")
    return path if path.exists() else data_file(f"crazyswarm2_payload/csv/log{number}.csv")
