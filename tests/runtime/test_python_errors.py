"""What Python says of every bad argument: one line, kept as golden lines.

``tests/golden/python_errors.json`` holds expressions, each behind the module whose names it uses,
with the line of the error. A new case is a new key; ``python -m tests.runtime.test_python_errors``
writes all lines anew.
"""

import gzip
import json
import tempfile
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from tests.support.bad_inputs import table, write_file
from tests.support.map_tables import hover_table
from tests.support.paths import ROOT
from tests.support.vehicles import HOVER, POSE, VEHICLE
from windwrench.dynamics import EffectSetting, InputError
from windwrench.envs import Stage
from windwrench.envs.wind import Uniform
from windwrench.estimator import WrenchUKF, WrenchUKFBatch

GOLDEN = ROOT / "tests" / "golden" / "python_errors.json"
CASES = json.loads(GOLDEN.read_bytes())
GIVEN = dict(np=np, replace=replace, VEHICLE=VEHICLE, POSE=POSE, SPEEDS=HOVER)
GIVEN |= dict(EffectSetting=EffectSetting, Stage=Stage, Uniform=Uniform)
GIVEN |= dict(gzip=gzip, table=table, hover_table=hover_table)


def refusal(case, folder):
    """Return what is said of a bad argument; ``begun`` is a filter that was started, and ``both`` a
    batch of two, which the argument must leave as they were; ``file`` writes one into the folder.
    """

    where, _, call = case.partition(": ")
    module = import_module(f"windwrench.{where}")
    started = {"begun": WrenchUKF(VEHICLE), "both": WrenchUKFBatch(VEHICLE, 2)}
    for one in started.values():
        one.reset(*POSE)
    before = [(one.estimate.state, one.covariance) for one in started.values()]
    names = {name: getattr(module, name) for name in dir(module)} | GIVEN | started
    names["file"] = lambda name, content: write_file(folder / name, content)
    with pytest.raises(InputError) as refused:
        eval(call, names)
    for one, (state, covariance) in zip(started.values(), before, strict=True):
        assert_array_equal(one.estimate.state, state)
        assert_array_equal(one.covariance, covariance)
    return str(refused.value).replace(f"{folder}/", "")


@pytest.mark.parametrize("case", CASES)
def test_a_bad_argument_ends_in_its_golden_line(case, tmp_path):
    assert refusal(case, tmp_path) == CASES[case]
    assert "\n" not in CASES[case]


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        lines = {case: refusal(case, Path(made)) for case in CASES}
    GOLDEN.write_text(json.dumps(lines, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
