"""The benchmark of half a second of flight: its model, its fit, and the page that shows them."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from tests.support.data_paths import data_file
from windwrench.studies.kept_results import DOCS, kept
from windwrench.studies.nanodrone_benchmark import (
    ARM,
    BEGIN,
    FITTED,
    GRAVITY,
    MASS,
    NAMED,
    STAYS,
    STEP,
    STEPS,
    Flight,
    Starts,
    _best_delay,
    _torques,
    fit,
    judged,
    mean_clock,
    predicted,
    quick_inertia,
    read_flight,
    section,
    study,
    train,
)

HOVER = np.sqrt(MASS * GRAVITY / (4.0 * BEGIN.thrust))


def made_starts(count):
    """Random states, and rotors that swing about hover; what follows is not known yet."""
    rng = np.random.default_rng(1)
    states = np.zeros((count, 13))
    states[:, 6] = 1.0
    speeds = np.full((count, STEPS + 1, 4), HOVER)
    states[:, 3:6] = rng.normal(0.0, 1.0, (count, 3))
    turn = Rotation.from_rotvec(rng.normal(0.0, 0.3, (count, 3)))
    states[:, 6:10] = turn.as_quat(scalar_first=True)
    states[:, 10:13] = rng.normal(0.0, 1.0, (count, 3))
    speeds *= 1.0 + rng.normal(0.0, 0.05, (count, 1, 4))
    speeds *= 1.0 + np.cumsum(rng.normal(0.0, 0.006, speeds.shape), axis=1)
    flights = np.arange(count) % 4
    return Starts(flights, states, speeds, np.zeros((count, STEPS, 13)), np.zeros((count, 6)))


def test_known_coefficients_come_back():
    rng = np.random.default_rng(2)
    factors = rng.uniform(0.85, 1.15, len(FITTED))
    true = BEGIN._replace(
        **{n: f * getattr(BEGIN, n) for n, f in zip(FITTED, factors, strict=True)}
    )
    starts = made_starts(240)
    truth = predicted(true, starts)
    starts = starts._replace(truth=truth + rng.normal(0.0, 1e-3, truth.shape))
    found, deviations = fit(starts, FITTED, BEGIN, each=1)
    for name in FITTED:
        assert getattr(found, name) == pytest.approx(getattr(true, name), rel=0.01), name
        assert deviations[name] < 0.01 * abs(getattr(true, name))


def test_inertia_and_clock_show_from_3_to_15_hz():
    rng, n = np.random.default_rng(3), 3000
    inertia, late = 3.1e-5, 2
    band = butter(2, [0.1, 0.25], btype="bandpass", output="sos")
    turning = sosfiltfilt(band, rng.normal(0.0, 20.0, (n, 2)), axis=0)
    torque = inertia * np.roll(turning, -late, axis=0)
    places = ARM * np.array([[1, 1, -1, -1.0], [-1, 1, 1, -1.0]])
    square = HOVER**2 + torque @ np.linalg.pinv(places).T / BEGIN.thrust
    states = np.zeros((n, 13))
    states[1:, 10:12] = STEP * np.cumsum(0.5 * (turning[1:] + turning[:-1]), axis=0)
    speeds = np.sqrt(square)
    clock = _best_delay(_torques(speeds), np.gradient(states[:, 10:12], STEP, axis=0))
    assert clock == pytest.approx(late * STEP, abs=1e-3)
    # a gradient of samples loses some of what is quick
    value, _ = quick_inertia([Flight("made", "made", states, speeds, clock)])
    assert value == pytest.approx(inertia, rel=0.15)


def test_the_page_shows_the_kept_results():
    text = section(kept("identify/nanodrone.json"))
    assert text in (DOCS / "identify.md").read_text(encoding="utf-8")


def test_without_the_flights_the_study_says_so(tmp_path, capsys):
    study(tmp_path, None, tmp_path / "out.json")
    assert "skipped" in capsys.readouterr().out
    assert not (tmp_path / "out.json").exists()


@pytest.mark.measured
def test_a_measured_flight_is_predicted_from_others():
    paths = ("multisine_20251017_run2", "square_20251017_run3", "random1_20251017_run1")
    seen, other, held = (read_flight(data_file(f"idsia/{name}.parquet")) for name in paths)
    c, _ = train([seen, other])
    assert 0.88 < c.velocity_scale < 0.93
    (row,) = judged([held], c, mean_clock([seen, other]))
    ratio = np.divide(row["scores"][NAMED], row["scores"][STAYS])
    assert np.all(ratio < [0.15, 0.25, 0.8, 0.8]), ratio
