import importlib
import json

import numpy as np
import pytest

from windwrench.dynamics import load_vehicle
from windwrench.paper import fig3
from windwrench.runtime.errors import InputError

pytest.importorskip("sklearn", reason="sklearn is not installed: pip install 'windwrench[paper]'")


@pytest.fixture(scope="module")
def result():
    shares = []
    outcome = fig3.run(1, shares.append, seconds=15.0)
    assert shares[-1] == 1.0
    return outcome


def test_the_mixture_finds_the_three_wrenches():
    # one flight of 90 s a load: the actuator noise shifts its mean torque by 0.9 mNm in one
    # standard deviation
    estimates, added = fig3.fly_loads(load_vehicle("ardrone2"), (True, True, True), 1, 90.0)
    for target, real, cluster in zip(
        fig3.TARGETS, added, fig3.fit_clusters(estimates), strict=True
    ):
        off = np.abs(cluster.mean - target)
        assert np.all(off < cluster.std)
        assert np.all(off < [0.02, 0.003])
        assert np.all(cluster.std < [0.05, 0.02])
        assert np.all(np.abs(cluster.mean - target - real) < [0.005, 0.001])
        assert cluster.own > 0.99


def test_the_actuator_limits_the_spread(result):
    std = {row["source"]: row["std_Nm"] for row in result.figures["limits"]}
    assert std["actuator noise alone"] > 3 * max(
        std["sensor noise alone"], std["8-bit rotor speeds alone"]
    )
    assert std["without actuator noise"] < 0.2 * std["everything"]


def test_contract(result):
    json.dumps(result.figures, allow_nan=False)
    assert {len(column) for column in result.data.values()} == {3 * 300}
    assert len(result.comparison) == 4
    result.picture.canvas.draw()


def test_without_scikit_learn(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr(importlib, "import_module", missing)
    with pytest.raises(InputError, match="pip install"):
        fig3.fit_clusters(np.zeros((3, 1, 10, 2)))
