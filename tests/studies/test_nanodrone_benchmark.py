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
    errors,
    fit,
    judged,
    mean_clock,
    predicted,
    quick_inertia,
    read_flight,
    score,
    section,
    stays,
    study,
    train,
)

HOVER = np.sqrt(MASS * GRAVITY / (4.0 * BEGIN.thrust))


def made_starts(count, seed=1, excited=True):
    """Random states, and rotors that swing about hover; what follows is not known yet."""
    rng = np.random.default_rng(seed)
    states = np.zeros((count, 13))
    states[:, 6] = 1.0
    speeds = np.full((count, STEPS + 1, 4), HOVER)
    if excited:
        states[:, 3:6] = rng.normal(0.0, 1.0, (count, 3))
        turn = Rotation.from_rotvec(rng.normal(0.0, 0.3, (count, 3)))
        states[:, 6:10] = turn.as_quat(scalar_first=True)
        states[:, 10:13] = rng.normal(0.0, 1.0, (count, 3))
        speeds *= 1.0 + rng.normal(0.0, 0.05, (count, 1, 4))
        speeds *= 1.0 + np.cumsum(rng.normal(0.0, 0.006, speeds.shape), axis=1)
    flights = np.arange(count) % 4
    return Starts(flights, states, speeds, np.zeros((count, STEPS, 13)), np.zeros((count, 6)))


def test_a_hover_stays_and_a_fall_falls():
    still = BEGIN._replace(velocity_scale=1.0)
    hover = made_starts(1, excited=False)
    np.testing.assert_allclose(predicted(still, hover)[0, -1], hover.states[0], atol=1e-9)
    fall = predicted(still, hover._replace(speeds=0.0 * hover.speeds))
    away = STEP * STEPS
    # inflow is a rotor's: one that stands still has none
    np.testing.assert_allclose(fall[0, -1, [2, 5]], [-0.5 * GRAVITY * away**2, -GRAVITY * away])


def test_a_score_sums_mean_norms_over_the_steps():
    starts = made_starts(3)
    path = stays(starts)
    off = path.copy()
    off[..., 0] += 0.03
    off[..., 1] += 0.04
    turn = Rotation.from_rotvec([0.0, 0.2, 0.0])
    turned = Rotation.from_quat(path[..., 6:10].reshape(-1, 4), scalar_first=True) * turn
    off[..., 6:10] = -turned.as_quat(scalar_first=True).reshape(*path.shape[:2], 4)
    assert score(off, path) == pytest.approx([50 * 0.05, 0.0, 50 * 0.2, 0.0], abs=1e-9)
    assert np.linalg.norm(errors(off, path)[..., 2, :], axis=-1) == pytest.approx(0.2, rel=0.01)


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


def test_the_reaction_is_one_part_that_can_be_switched_off():
    starts = made_starts(20)
    words = ("unmeasured_moment", "damping", "stiffness", "yaw_damping", "heading_stiffness")
    other = BEGIN._replace(**{name: 2.0 * getattr(BEGIN, name) for name in words})
    np.testing.assert_array_equal(
        predicted(BEGIN, starts, reacts=False), predicted(other, starts, reacts=False)
    )
    assert np.all(score(predicted(BEGIN, starts), predicted(other, starts)) > 0.01)


def test_what_is_left_over_goes_on_and_decays():
    starts = made_starts(1, excited=False)
    starts.left[0] = [1.0, 0.0, 0.0, 0.0, 0.0, 2.0]
    c = BEGIN._replace(force_share=0.5, force_memory=0.1, moment_share=0.5, moment_memory=0.1)
    end = predicted(c._replace(flapping=0.0, rotor_drag=0.0), starts, reacts=False)[0, -1]
    gone = 0.1 * (1.0 - np.exp(-5.0))
    assert end[12] == pytest.approx(0.5 * 2.0 * gone, rel=0.01)
    assert end[3] == pytest.approx(0.5 * gone, rel=0.01)


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
