"""The loop closed in flight: in short, and what resumes, pairs and refuses."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from windwrench.controllers import Admittance
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import parse_setting
from windwrench.dynamics.vehicle import EffectSetting
from windwrench.envs.fan_tracking import FanTrackingEnv
from windwrench.evaluation.episodes import fly_episode
from windwrench.runtime.errors import InputError
from windwrench.runtime.provenance import commit, made_by
from windwrench.studies.closed_loop import closed_loop as close_loop
from windwrench.studies.closed_loop.closed_loop import (
    Request,
    check_requests,
    close_loops,
    fly_episodes,
    interval_of_mean,
    ratio_of_means,
    verdict,
)
from windwrench.studies.closed_loop.page import conclusions, write_page
from windwrench.studies.closed_loop.picture import write_picture

VEHICLE = load_vehicle("ardrone2")
HEAVY = EffectSetting("mass", {"dm": 0.06})


def request(text, episodes=2, **kwargs):
    return Request(parse_setting(text, VEHICLE), VEHICLE, episodes, 0, **kwargs)


@pytest.fixture(scope="module")
def short(tmp_path_factory):
    folder = tmp_path_factory.mktemp("close-loop")
    requests = [request("mass:dm=0.06", seconds=20.0), request("com_offset", seconds=20.0)]
    return requests, folder, close_loops(requests, folder, jobs=1)


def test_a_named_effect_lowers_the_wrench_error(short):
    _, _, (mass, com) = short
    assert [e["name"] for e in mass["diagnosis"]["effects"]] == ["mass"]
    assert mass["diagnosis"]["effects"][0]["coefficients"]["dm"] == pytest.approx(0.06, rel=0.05)
    assert [e["name"] for e in com["diagnosis"]["effects"]] == ["com_offset"]
    assert mass["summary"]["force_error_N"]["ratio_ci95"][1] < 0.5
    assert com["summary"]["torque_error_Nm"]["ratio_ci95"][1] < 0.7


def test_the_amended_model_comes_near_the_exact_one(short):
    _, _, results = short
    for result in results:
        for key in ("force_error_N", "torque_error_Nm"):
            summary = result["summary"][key]
            assert summary["amended"]["mean"] == pytest.approx(
                summary["exact"]["mean"], rel=0.03
            ), (result["name"], key)


def test_what_is_finished_is_kept_and_what_was_asked_otherwise_is_not(short, monkeypatch):
    requests, folder, results = short
    monkeypatch.setattr(close_loop, "close_loop", lambda *_: pytest.fail("flown again"))
    shares = []
    assert close_loops(requests, folder, jobs=1, report=lambda s: shares.append(dict(s))) == results
    assert shares[0] == {r.name: 1.0 for r in requests}
    with pytest.raises(pytest.fail.Exception, match="flown again"):
        close_loops([Request(requests[0].effect, VEHICLE, 2, 1, 20.0)], folder, jobs=1)
    other = {**results[1], "request": {**results[1]["request"], "code": "0123456789abcdef"}}
    (folder / f"{requests[1].name}.json").write_text(json.dumps(other), encoding="utf-8")
    with pytest.raises(pytest.fail.Exception, match="flown again"):
        close_loops(requests, folder, jobs=1)
    (folder / f"{requests[1].name}.json").write_text("{", encoding="utf-8")
    with pytest.raises(pytest.fail.Exception, match="flown again"):
        close_loops(requests, folder, jobs=1)
    (folder / f"{requests[1].name}.json").write_text(json.dumps(results[1]), encoding="utf-8")


def test_page_and_picture_hold_the_results(short, tmp_path):
    _, _, results = short
    assert write_picture(results, tmp_path / "pictures").stat().st_size > 10_000
    write_page(results, tmp_path / "pictures", tmp_path / "page.md")
    page = (tmp_path / "page.md").read_text(encoding="utf-8")
    command = (
        "windwrench close-loop --effect mass:dm=0.06 --effect com_offset --episodes 2 --seed 0"
    )
    out, markdown = (
        Path(os.path.relpath(tmp_path / name)).as_posix() for name in ("pictures", "page.md")
    )
    made = made_by(f"{command} --out {out} --markdown {markdown}", [commit()])
    assert made in page.splitlines()
    assert all(result["commit"] == commit() for result in results)
    assert sorted(p.name for p in (tmp_path / "pictures").iterdir()) == [
        "close_loop.png",
        "close_loop.svg",
    ]
    assert "](pictures/close_loop.png)" in page
    for result in results:
        assert f"x{result['summary']['force_error_N']['ratio']:.3f}" in page
        assert f"[{result['name']}.json](pictures/{result['name']}.json)" in page


def test_conclusions_say_what_helps_and_what_does_not(short):
    _, _, results = short
    force = next(s for s in conclusions(results) if s.startswith("**Force error"))
    falls, _, rest = force.partition("does not change")
    assert "mass" in falls
    for result in results:
        summary = result["summary"]["force_error_N"]
        assert (result["name"] in falls and "falls with" in falls) == (
            summary["verdict"] == "falls"
        )
        assert (result["name"] in rest) == (summary["verdict"] != "falls")


def test_the_same_seeds_give_the_same_episodes():
    first = fly_episodes(VEHICLE, VEHICLE, HEAVY, [3])
    assert first == fly_episodes(VEHICLE, VEHICLE, HEAVY, [3])
    assert first != fly_episodes(VEHICLE, VEHICLE, HEAVY, [4])


def test_a_declared_effect_does_not_come_into_the_world_twice():
    seen = []
    for model in (VEHICLE, VEHICLE.with_effects(HEAVY)):
        env = FanTrackingEnv("base", vehicle=model, truth=VEHICLE, effects=(HEAVY,))
        env.reset(seed=0)
        seen.append(float(env.loop.model.body_mass[env.loop.model.body("vehicle").id]))
        env.close()
    assert seen == [pytest.approx(0.525)] * 2


def test_without_a_truth_the_true_vehicle_is_as_declared():
    vehicle = VEHICLE.with_effects(EffectSetting("rotor_drag", {"kdx": 1e-4, "kdy": 1e-4}))
    flown = [
        fly_episode(FanTrackingEnv("varied", vehicle=vehicle, truth=truth), Admittance(), 5)
        for truth in (None, vehicle)
    ]
    assert np.array_equal(flown[0].observation, flown[1].observation)
    other = fly_episode(FanTrackingEnv("varied", vehicle=vehicle, truth=VEHICLE), Admittance(), 5)
    assert not np.array_equal(flown[0].observation, other.observation)


def test_the_flight_loop_knows_a_declared_mass():
    """At hover in still air it commands the thrust that the true weight needs, and the height does
    not sag.
    """
    heights = []
    for model in (VEHICLE, VEHICLE.with_effects(HEAVY)):
        env = FanTrackingEnv("static", vehicle=model, truth=VEHICLE, effects=(HEAVY,))
        env.reset(seed=0)  # it settles for 1.5 s
        heights.append(float(env.loop.position[2] - env.fan.height))
        env.close()
    assert heights[0] < -0.05
    assert abs(heights[1]) < 0.3 * abs(heights[0])


def test_a_ratio_is_of_paired_episodes():
    before = np.random.default_rng(1).uniform(0.1, 0.9, 20)
    ratio, (low, high) = ratio_of_means(before, 0.7 * before)
    assert ratio == pytest.approx(0.7)
    assert high - low < 1e-9  # as pairs they do not scatter
    low, high = interval_of_mean(before)
    assert low < before.mean() < high


@pytest.mark.parametrize(
    ("interval", "word"),
    [
        ((0.5, 0.98), "falls"),
        ((0.5, 0.995), "unchanged"),
        ((0.9, 1.1), "unchanged"),
        ((1.005, 1.2), "unchanged"),
        ((1.02, 1.2), "rises"),
    ],
)
def test_a_change_counts_beyond_a_margin(interval, word):
    assert verdict(interval) == word


@pytest.mark.parametrize(
    ("requests", "message"),
    [
        ([request("mass"), request("mass:dm=0.04")], "given twice"),
        ([request("mass", episodes=0)], "--episodes must be at least 1"),
        ([Request(HEAVY, VEHICLE, 1, -1)], "--seed must lie"),
        ([Request(HEAVY, VEHICLE.with_effects(HEAVY), 1, 0)], "declares it already"),
        ([request("ceiling_effect")], "expected ceiling_z"),
    ],
)
def test_bad_requests_are_named(requests, message):
    with pytest.raises(InputError, match=message):
        check_requests(requests)


def test_an_effect_that_cannot_be_flown_is_named(tmp_path):
    with pytest.raises(InputError, match=r"--effect mass_dm=0.95.*(crashed|too large)"):
        close_loops([request("mass:dm=0.95", episodes=1, seconds=5.0)], tmp_path, jobs=1)


def test_the_command_refuses_an_unknown_effect():
    from windwrench.cli import app

    result = CliRunner().invoke(app, ["close-loop", "--effect", "drag"])
    assert isinstance(result.exception, InputError)
    assert "rotor_drag" in str(result.exception)
