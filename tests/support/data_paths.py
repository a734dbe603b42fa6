"""Where measured flights lie: excerpts in the checkout, whole originals beside it.

``tests/data`` holds short excerpts of logs whose licences allow it; every clone has them. The whole
originals are larger, and some may be measured with but not copied: they lie in the folder that the
environment variable WINDWRENCH_DATA names, by default ``shared/data`` beside the checkout. Tests
that need one which is not there are skipped, and say where it comes from.
"""

import os
from pathlib import Path

import pytest
import yaml

from tests.support.paths import ROOT

EXCERPTS = ROOT / "tests" / "data"
EXAMPLE = ROOT / "identification" / "logs" / "example"
DATA = Path(os.environ.get("WINDWRENCH_DATA") or ROOT.parent / "shared" / "data")
SOURCES = yaml.safe_load((EXCERPTS / "sources.yaml").read_text(encoding="utf-8"))


def data_file(relative):
    """Return the path of a whole original; skip the test where it is not there."""
    path = DATA / relative
    name = Path(relative).parts[0]
    if not path.exists():
        pytest.skip(
            f"measured data {relative} is not in {DATA}: put there, in a folder {name}, "
            f"{SOURCES[name]}, or set WINDWRENCH_DATA to where it is"
        )
    return path


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
