"""The paper's figures, each in a short form: what the paper says of it is seen, all of its result
can be written, and a page shows it.
"""

import gzip
import json
from importlib import import_module

import numpy as np
import pytest
from matplotlib.figure import Figure
from numpy.testing import assert_allclose

from tests.support.outcomes import refused
from windwrench.controllers import Hover
from windwrench.dynamics import load_vehicle
from windwrench.evaluation.episodes import fly_episode
from windwrench.reproduction import NAMES, fig3, fig4, fig5, fig7
from windwrench.reproduction.fig5_flights import NOISES
from windwrench.reproduction.reproduce import chosen, write_page, write_result
from windwrench.reproduction.result import Comparison, Result
from windwrench.runtime.provenance import commit, made_by

SHORT = {  # seeds, settings, and constants of the figure's module
    "fig3": (1, {"seconds": 8.0}, {}),
    "fig4": (1, {"sweep": (0.5, 1.0)}, {"_END": 14.0}),
    "fig5": (1, {"evaluations": 1}, {"_TUNING_SEEDS": (10_001,), "_RESAMPLES": 400}),
    "fig6": (1, {}, {"HOVER": 3.0}),
    "fig7": (
        2,
        {},
        {
            "GAINS": (12.0, 36.0),
            "SHOWN_GAINS": (18.0,),
            "RISE_TIMES": (0.45,),
            "FAN_SPEEDS": (0.2,),
            "NOISES": ("gusts",),
            "HALVINGS": 3,
            "REPEATS": 2,
        },
    ),
}


def limits_of_the_spread(figures):
    std = {row["source"]: row["std_Nm"] for row in figures["limits"]}
    quiet = max(std["sensor noise alone"], std["8-bit rotor speeds alone"])
    assert std["actuator noise alone"] > 3 * quiet
    assert std["without actuator noise"] < 0.2 * std["everything"]


def rise_times_and_noise(figures):
    assert figures["rise_within_bounds"]
    assert figures["lateral_within_bounds"]
    rows = figures["sweep"]
    assert max(row["lateral_N"] for row in rows) < 0.08
    assert max(row["made_up_lateral_N"] for row in rows) < 0.03
    for fast, slow in zip(rows[::2], rows[1::2], strict=True):
        assert slow["tuned_rise_s"] == 2 * fast["tuned_rise_s"]
        for name in ("force_rise_s", "torque_rise_s"):
            assert fast[name] == pytest.approx(0.5, abs=0.1)
            assert slow[name] == pytest.approx(1.0, abs=0.2)
        assert slow["force_std_N"] < fast["force_std_N"]
        assert slow["torque_std_Nm"] < fast["torque_std_Nm"]


def an_ekf_on_the_same_model_is_as_good(figures):
    ratios = [r for r in figures["rmse_ratio"] if r["pair"] == "EKF / UKF, both set to 1 s"]
    assert {(r["noise"], r["error"]) for r in ratios} == {
        (n, e) for n in NOISES for e in fig5.ERRORS
    }
    assert_allclose([row["ratio"] for row in ratios], 1.0, atol=0.05)
    assert all(r["ci95"][0] <= r["ratio"] <= r["ci95"][1] for r in figures["rmse_ratio"])
    nis = [row["nis"] for row in figures["rmse"] if row["estimator"] == "UKF 1 s"]
    assert_allclose(nis, 6.0, atol=0.5)


def the_map_of_the_jet(figures):
    assert figures["points_in_jet"] >= 20
    for name in ("force_x", "torque_z", "torque_z_with_jet_alone"):
        assert figures[f"correlation_{name}"] >= 0.95
    assert figures["torque_z_antisymmetry"] > 0.95
    assert figures["force_x_symmetry"] > 0.99
    peak = "torque_peak_Nm"
    on_axis = "force_x_on_axis_N"
    assert figures[f"profile_{peak}"] == pytest.approx(figures[f"true_jet_{peak}"], rel=0.2)
    assert figures[f"profile_{on_axis}"] == pytest.approx(figures[f"true_{on_axis}"], abs=0.03)
    offsets = figures["true_jet_torque_peak_offset_m_by_fan_radius"]
    assert offsets == pytest.approx({"0.35": 0.38, "0.45": 0.47, "0.55": 0.56}, abs=0.006)
    assert figures["hover_offset_rms_m"] < 0.1


def the_fan_is_caught_and_followed(figures):
    (capture,) = figures["capture"]
    (track,) = figures["tracking"]
    assert capture["captured"] == 1.0
    assert 0.5 < capture["median_time_s"] < 6.0
    assert capture["rmse_last_10_s_m"] < 0.3
    assert track["lost"] == 0.0
    assert track["rmse_m"] < 0.35
    assert track["share_within_fan_radius"] > 0.8
    env = fig7.make_env(0.45)
    env.fan_path = fig7.triangle(0.2)
    assert fly_episode(env, Hover(), 0).rmse > 0.5
    low, high = figures["fastest"]
    assert low["bound_m_s"] == pytest.approx(12.0 * figures["jet_largest_torque_Nm"])
    assert 0.6 * low["bound_m_s"] < low["held_m_s"] < 1.15 * low["bound_m_s"]
    assert low["held_m_s"] < high["held_m_s"]
    assert high["held_share_of_bound"] < 0.85
    for row in (low, high):
        ends = row["held_share_of_bound_ci95"]
        assert ends[0] <= row["held_share_of_bound"] <= ends[1]
        assert 0.85 * row["bound_m_s"] < row["calm_m_s"] < 1.15 * row["bound_m_s"]


CLAIMS = {
    "fig3": limits_of_the_spread,
    "fig4": rise_times_and_noise,
    "fig5": an_ekf_on_the_same_model_is_as_good,
    "fig6": the_map_of_the_jet,
    "fig7": the_fan_is_caught_and_followed,
}


@pytest.mark.parametrize("name", NAMES)
def test_a_figure_shows_what_the_paper_says(name, monkeypatch):
    if name == "fig3":
        pytest.importorskip("sklearn", reason="pip install 'windwrench[reproduction]'")
    module = import_module(f"windwrench.reproduction.{name}")
    shares = []
    seeds, settings, constants = SHORT[name]
    for constant, value in constants.items():
        monkeypatch.setattr(module, constant, value)
    result = module.run(seeds, shares.append, **settings)
    assert shares == sorted(shares)
    assert shares[-1] <= 1.0
    json.dumps(result.figures, allow_nan=name in ("fig6", "fig7"))
    assert len({len(column) for column in result.data.values()}) == 1
    assert all(row.paper and row.here for row in result.comparison)
    result.picture.canvas.draw()
    CLAIMS[name](result.figures)


def test_the_mixture_finds_the_three_wrenches():
    """One flight of 90 s a load: the actuator noise shifts its mean torque by 0.9 mNm in one
    standard deviation.
    """
    pytest.importorskip("sklearn", reason="pip install 'windwrench[reproduction]'")
    estimates, added = fig3.fly_loads(load_vehicle("ardrone2"), (True, True, True), 1, 90.0)
    found = fig3.fit_clusters(estimates)
    for target, real, cluster in zip(fig3.TARGETS, added, found, strict=True):
        off = abs(cluster.mean - target)
        assert (off < cluster.std).all()
        assert (off < [0.02, 0.003]).all()
        assert (cluster.std < [0.05, 0.02]).all()
        assert (abs(cluster.mean - target - real) < [0.005, 0.001]).all()
        assert cluster.own > 0.99


def test_without_scikit_learn(monkeypatch):
    def missing(name):
        raise ImportError(name)

    monkeypatch.setattr("importlib.import_module", missing)
    with refused("pip install"):
        fig3.fit_clusters(np.zeros((3, 1, 10, 2)))


def test_a_rise_time_a_ratio_and_an_interval_are_those_of_their_definitions():
    time = np.arange(0.01, 20.0, 0.01)
    response = -0.52 * np.where(time < 7.0, 0.0, 1.0 - np.exp(-(time - 7.0) / 0.4))
    assert fig4.rise_time(time, response) == pytest.approx(0.4 * np.log(9.0), abs=1e-3)
    hard = np.linspace(1.0, 5.0, 20)  # errors that go together have a tight interval
    assert fig5.ratio(2.0 * hard, hard) == pytest.approx((2.0, 2.0, 2.0))
    low, high = fig7.interval([0.4, 0.5, 0.6, 0.5, 0.5])
    # a standard deviation of 0.0707 over five, 2.776 of its errors of the mean
    assert (low, high) == pytest.approx((0.5 - 0.0878, 0.5 + 0.0878), abs=1e-4)
    assert fig7.interval([0.3]) == (0.3, 0.3)


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
    kept = json.loads((tmp_path / "fig0.json").read_bytes())
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
