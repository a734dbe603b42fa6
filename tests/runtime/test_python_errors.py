"""What Python says of every bad argument: one line, kept as golden lines.

``tests/golden/python_errors.json`` holds expressions, each behind the module whose names it uses,
with the line of the error. A new case is a new key; ``python -m tests.runtime.test_python_errors``
writes all lines anew.
"""

import json
from dataclasses import replace
from importlib import import_module

import numpy as np
import pytest

from tests.support.paths import ROOT
from windwrench.dynamics import EffectSetting, InputError, load_vehicle
from windwrench.envs import Stage
from windwrench.envs.wind import Uniform
from windwrench.estimator import WrenchUKF, WrenchUKFBatch

GOLDEN = ROOT / "tests" / "golden" / "python_errors.json"
CASES = json.loads(GOLDEN.read_text(encoding="utf-8"))
VEHICLE, POSE = load_vehicle("ardrone2"), ([0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 0.0])
SPEEDS = np.full(4, VEHICLE.hover_rate)
GIVEN = dict(np=np, replace=replace, VEHICLE=VEHICLE, POSE=POSE, SPEEDS=SPEEDS)
GIVEN |= dict(EffectSetting=EffectSetting, Stage=Stage, Uniform=Uniform)


def refusal(case):
    """Return what is said of a bad argument; ``begun`` is a filter that was started, and ``both`` a
    batch of two, which the argument must leave as they were.
    """
    where, _, call = case.partition(": ")
    module = import_module(f"windwrench.{where}")
    started = {"begun": WrenchUKF(VEHICLE), "both": WrenchUKFBatch(VEHICLE, 2)}
    for one in started.values():
        one.reset(*POSE)
    before = [(one.estimate.state, one.covariance) for one in started.values()]
    names = {name: getattr(module, name) for name in dir(module)} | GIVEN | started
    with pytest.raises(InputError) as refused:
        eval(call, names)
    for one, (state, covariance) in zip(started.values(), before, strict=True):
        np.testing.assert_array_equal(one.estimate.state, state)
        np.testing.assert_array_equal(one.covariance, covariance)
    return str(refused.value)


@pytest.mark.parametrize("case", CASES)
def test_a_bad_argument_ends_in_its_golden_line(case):
    assert refusal(case) == CASES[case]
    assert "\n" not in CASES[case]


if __name__ == "__main__":
    lines = {case: refusal(case) for case in CASES}
    GOLDEN.write_text(json.dumps(lines, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
