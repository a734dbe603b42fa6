"""The exported filter as WebAssembly, under Node.js: the numbers that C says on this machine."""

import numpy as np
import pytest

from windwrench.live.export_c import ESTIMATORS, export_c
from windwrench.studies.export_c import webassembly
from windwrench.studies.export_c.compiled import missing
from windwrench.studies.export_c.flights import flight, vehicle_of

STEPS = 600


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_in_a_browser_it_says_the_same(estimator, tmp_path):
    if lacking := [*webassembly.tools_missing(), *missing("gcc")]:
        pytest.skip(f"not installed: {', '.join(lacking)}")
    name = "ardrone2, turning"
    exported, flown = export_c(vehicle_of(name), estimator), flight(name, STEPS)
    size, said = webassembly.fly(exported, flown, tmp_path / "browser")
    assert size < 40_960
    assert not np.isfinite(flown["position"]).all()  # there are faults
    apart, statuses = webassembly.apart(said, exported, flown, tmp_path)
    assert statuses == 0
    assert apart < 0.01
    said[-1, -1] += 1.0
    assert webassembly.apart(said, exported, flown, tmp_path)[0] > 1.0
