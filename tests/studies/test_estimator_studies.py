"""The studies of the estimators in a short version, and their committed pages, which are made of
nothing but their committed results.
"""

import json

import numpy as np
import pytest

from tests.support.paths import ROOT
from windwrench.dynamics import load_vehicle
from windwrench.runtime.errors import InputError
from windwrench.studies.faults import page as faults_page
from windwrench.studies.faults import study as faults_study
from windwrench.studies.filtered_logs import filtered_logs as filtered_logs_study
from windwrench.studies.filtered_logs import filters
from windwrench.studies.filtered_logs import page as filtered_logs_page
from windwrench.studies.identified_vehicles import page as identified_page
from windwrench.studies.imu_logs import page as imu_logs_page
from windwrench.studies.inertial import page as inertial_page
from windwrench.studies.inertial import study as inertial_study
from windwrench.studies.log_estimates import flights as log_flights
from windwrench.studies.log_estimates import page as log_page
from windwrench.studies.log_estimates import study as log_study
from windwrench.studies.numbers.rendering import kept
from windwrench.studies.page_tables import put_between
from windwrench.studies.resumed_tasks import run_tasks
from windwrench.studies.scored_flights import kind as kind_of

DOCS = ROOT / "docs"


def silent(*_):
    """A progress report that nobody reads."""


def results(name):
    path = DOCS / name / "results.json"
    return json.loads(path.read_text(encoding="utf-8")), path


def beside(tmp_path, name):
    """Return where a page and its data lie in a folder of their own."""
    (tmp_path / name).mkdir()
    return tmp_path / name / "results.json", tmp_path / f"{name}.md"


@pytest.mark.parametrize("name", ["faults", "imu", "log-estimates"])
def test_a_page_says_what_its_results_say(name, tmp_path):
    result, _ = results(name)
    data, page = beside(tmp_path, name)
    if name == "faults":
        faults_page.write_page(result, data, page)
    elif name == "imu":
        inertial_page.write_page(result, data, tmp_path / name / "rise_time.png", page)
    else:
        log_page.write_page(result, data, tmp_path / name / "errors.png", page)
    assert page.read_text(encoding="utf-8") == (DOCS / f"{name}.md").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("draw", "name", "panels"),
    [(inertial_page.draw, "imu", 4), (log_page.draw, "log-estimates", 2)],
)
def test_a_picture_shows_every_row(draw, name, panels):
    result, _ = results(name)
    figure = draw(result)
    assert len(figure.axes) == panels
    assert all(axes.lines or axes.patches for axes in figure.axes)


@pytest.mark.parametrize(
    ("study", "name", "data"),
    [
        (filtered_logs_page, "filtered-logs", "filtered_logs.json.gz"),
        (imu_logs_page, "imu-logs", "imu_logs.json.gz"),
        (identified_page, "identify", "identified_vehicles.json.gz"),
    ],
)
def test_a_pages_tables_are_made_from_its_data(study, name, data, tmp_path):
    outcomes = kept(f"{name}/{data}")
    page = tmp_path / "page.md"
    committed = (DOCS / f"{name}.md").read_text(encoding="utf-8")
    page.write_text(committed, encoding="utf-8")
    put_between(study.tables(outcomes), page)
    assert page.read_text(encoding="utf-8") == committed


def test_a_study_of_filtered_logs_goes_on_from_what_was_saved(tmp_path):
    saved = DOCS / "filtered-logs" / "filtered_logs.json.gz"
    filtered_logs_study.resume(tmp_path, saved)
    done = (tmp_path / "flights.jsonl").read_text(encoding="utf-8").splitlines()
    per_flight = len(filters.FILTERS)
    assert len(done) == len(kept("filtered-logs/filtered_logs.json.gz")) // per_flight
    (tmp_path / "cut.json.gz").write_bytes(saved.read_bytes()[:1000])
    with pytest.raises(InputError, match=r"cut\.json\.gz: cannot be read"):
        filtered_logs_study.read_saved(tmp_path / "cut.json.gz")


def test_a_page_without_marks_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"page\.md: expected a page with one line"):
        put_between("text", tmp_path / "page.md")


def test_tasks_that_are_done_are_not_done_again(tmp_path):
    path = tmp_path / "tasks.jsonl"
    assert run_tasks(pow, [(2, 3), (3, 2)], path) == {(2, 3): 8, (3, 2): 9}
    assert run_tasks(divmod, [(3, 2), (7, 4)], path) == {(3, 2): 9, (7, 4): [1, 3]}


@pytest.mark.parametrize(
    ("effects", "truth", "word"),
    [
        ([], "", "right, sure"),
        ([], "mass", "silent"),
        ([("mass", False, ())], "mass", "right, sure"),
        ([("mass", True, ())], "mass", "right, tentative"),
        ([("thrust_scale", True, ("mass",))], "mass", "right, tentative"),
        ([("thrust_scale", False, ())], "mass", "wrong, sure"),
        ([("thrust_scale", True, ())], "mass", "wrong, tentative"),
        ([("mass", False, ())], "", "wrong, sure"),
    ],
)
def test_an_outcome_behind_a_filter_has_its_word(effects, truth, word):
    named = [
        {"name": name, "tentative": tentative, "indistinguishable_from": list(others)}
        for name, tentative, others in effects
    ]
    assert kind_of({"effects": named, "effect": truth}) == word


def test_filters_take_the_noise_at_high_frequencies_alone():
    vehicle = load_vehicle("ardrone2")
    log = log_flights.plant_flight("ardrone2", 4.0, 1).log
    inner = slice(200, -200)

    def rough(x):
        return np.std(np.diff(x.position[inner], 3, axis=0))

    for name, filtered in filters.FILTERS.items():
        behind = filtered(log, vehicle)
        assert np.abs(behind.position - log.position)[inner].max() < 0.3, name
        np.testing.assert_allclose(np.linalg.norm(behind.quaternion, axis=1), 1.0, atol=1e-6)
        if name != "as measured":
            assert rough(behind) < 0.7 * rough(log), name


def test_an_imu_shortens_the_rise_at_equal_spread(monkeypatch):
    for name, value in (
        ("NOISES", {"1 mm": inertial_study.NOISES["1 mm"]}),
        ("RATES", (0, 200)),
        ("TRUSTS", (0.1,)),
        ("RISES", (0.005, 0.02, 0.08, 0.32)),
        ("_DRAWS", 20),
    ):
        monkeypatch.setattr(inertial_study, name, value)
    pose, imu = inertial_study.sweep(load_vehicle("ardrone2"), 3, 0, silent)
    for kind in ("force", "torque"):
        assert imu[kind]["at_s"] < 0.7 * pose[kind]["at_s"]
        low, high = imu[kind]["at_s_ci95"]
        assert low <= imu[kind]["at_s"] <= high


def test_the_filter_with_an_imu_is_consistent_and_its_gate_pays(monkeypatch):
    vehicle = load_vehicle("ardrone2")
    monkeypatch.setattr(inertial_study, "RATES", (0, 200))
    checked = inertial_study.consistency(vehicle, 10, 0, 1.0, silent)
    for row in checked:
        for name in inertial_study.DOF:
            low, high = row[name]["band"]
            assert low <= row[name]["mean"] <= high, name
    shaken = "vibration of 30 m/s2 and 5 rad/s, 0.3 s"
    monkeypatch.setattr(inertial_study, "FAULTS", {shaken: inertial_study.FAULTS[shaken]})
    (row,) = inertial_study.faults(vehicle, 2, 0, silent)
    assert row["gate"]["rms_N"] < 0.1 * row["no gate"]["rms_N"]
    seen = {r["measured"]: r for r in inertial_study.observability(vehicle, 0)}
    alone, both = seen["attitude alone"], seen["position and attitude"]
    assert both["accelerometer_bias_std"] < 0.1 * alone["accelerometer_bias_std"]


@pytest.mark.slow
def test_a_fitted_tuning_is_near_the_best_and_bad_poses_are_refused(monkeypatch):
    flown = [log_flights.plant_flight("ardrone2", 8.0, 1)]
    monkeypatch.setattr(log_study, "rotorpy_flights", lambda *_: iter(flown))
    monkeypatch.setattr(log_study, "PLANT_VEHICLES", ("ardrone2",))
    (row,) = log_study.accuracy(8.0, 0, silent)
    assert row["best"]["force"] <= row["fitted"]["force"] < 1.15 * row["best"]["force"]
    assert row["fitted, smoothed"]["force"] < row["fitted"]["force"]
    spoiled, where = log_flights.bursts(
        log_flights.plant_flight("ardrone2", 10.0, 0).log,
        0.3,
        5.0,
        0.1,
        together=True,
        rng=np.random.default_rng(0),
    )
    assert 0.02 < where.mean() < 0.1
    assert spoiled.valid.all()
    jumped = log_study.jumps(10.0, 0, 1)
    assert [r["restarted"] for r in jumped] == [1, 1]
    assert jumped[0]["after_s"] == pytest.approx(0.6, abs=0.05)


def test_faults_are_counted(monkeypatch, tmp_path):
    monkeypatch.setattr(faults_study, "FILTERS", {"ekf": faults_study.FILTERS["ekf"]})
    monkeypatch.setattr(faults_study, "LONGEST", 2.0)
    result = faults_study.run(4, 2000, 0, tmp_path)
    (row,) = result["sequences"]
    assert row["not_finite"] == 0
    assert row["count"] == 4
    assert row["wrong"] <= 2
    (long,) = result["soak"]
    assert long["steps"] >= 2000
    assert long["right"] >= long["faults"] - 1
