"""Trials of the diagnosis: what is flown, and what an outcome is worth. Rules and misses of the
kept outcomes stand on their page, which ``test_numbers.py`` holds to them.
"""

from dataclasses import replace

import pytest

from windwrench.dynamics import InputError
from windwrench.dynamics.effects import names
from windwrench.envs.recording import TRAJECTORIES
from windwrench.studies.scoring import EQUIVALENTS
from windwrench.studies.trials.held_back_outsiders import HELD_BACK
from windwrench.studies.trials.judgements import (
    FAILED,
    RIGHT,
    RIGHT_TENTATIVE,
    SILENT,
    TENTATIVE,
    UNEXPLAINED,
    WRONG,
    judge,
    rules,
)
from windwrench.studies.trials.outsiders import OUTSIDERS
from windwrench.studies.trials.trials import Trial, fly_and_diagnose, plan, run_trials

SHORT = Trial("typical", ("mass",), trajectory="vertical", turbulence=0.0, seconds=20.0)


def name(effect, tentative=False, like=(), **coefficients):
    return {
        "name": effect,
        "coefficients": coefficients,
        "std": {k: 0.01 * abs(v) for k, v in coefficients.items()},
        "tentative": tentative,
        "indistinguishable_from": list(like),
    }


def found(*effects, remainder="none", without=()):
    return {
        "without": list(without),
        "remainder": remainder,
        "effects": list(effects),
        "seconds": 1.0,
    }


def outcome(truth, *diagnoses):
    flown = {"trajectory": "excite", "turbulence": 1.0, "sensor": 1.0}
    return {
        "key": "+".join(truth),
        "trial": {"group": "typical", "size": "typical", "vehicle": "ardrone2"},
        "flown": {**flown, "truth": truth, "outsider": None},
        "diagnoses": list(diagnoses),
    }


def rule(judged, start):
    (one,) = (r for r in rules(judged) if r.subject.startswith(start))
    return one


MASS = {"mass": {"dm": 0.04}}


def test_a_run_flies_everything_and_the_quick_one_a_part_of_it():
    trials = plan()
    by_key = {t.key: t for t in trials}
    assert len(by_key) == len(trials)
    for group in ("typical", "third"):
        mine = {t.added[0]: t for t in trials if t.group == group}
        assert set(mine) == set(names())
        for effect, trial in mine.items():
            assert trial.libraries[0] == ()
            assert trial.libraries[-1] == (effect, *EQUIVALENTS.get(effect, ()))
    assert {t.added[0] for t in trials if t.group == "outsider"} == set(OUTSIDERS)
    assert {t.added[0] for t in trials if t.group == "held back"} == set(HELD_BACK)
    assert len(
        {t.trajectory for t in trials if t.group == "strong turbulence" and t.turbulence == 4.0}
    ) == len(TRAJECTORIES)
    assert {t.key for t in plan(quick=True)} < set(by_key)
    twice = plan(2)
    assert [t.key for t in plan(first=1)] == [t.key for t in twice[len(trials) :]]
    assert len({t.key for t in twice}) == len(twice) == 2 * len(trials)
    assert len({t.flight_seed for t in twice}) == len(twice)
    assert plan(groups=("pair", "hover")) == [t for t in trials if t.group in ("pair", "hover")]
    with pytest.raises(InputError, match="pairs"):
        plan(groups=("pairs",))
    with pytest.raises(InputError, match="seeds"):
        plan(0)
    with pytest.raises(InputError, match="seed"):
        plan(first=-1)


@pytest.mark.parametrize(
    ("diagnosis", "expected"),
    [
        (found(name("mass", dm=0.041)), RIGHT),
        (found(name("mass", tentative=True, dm=0.041)), RIGHT_TENTATIVE),
        (found(name("thrust_scale", like=["mass"], s=-0.08)), RIGHT),
        (found(name("thrust_scale", s=-0.08)), WRONG),
        (found(name("thrust_scale", tentative=True, s=-0.08)), TENTATIVE),
        (found(name("mass", dm=0.04), name("wind", wx=1.0)), WRONG),
        (found(name("mass", dm=0.04), name("wind", tentative=True, wx=1.0)), TENTATIVE),
        (found(), SILENT),
        (found(remainder="random"), UNEXPLAINED),
        ({"without": [], "error": "ValueError: no", "seconds": 1.0}, FAILED),
    ],
)
def test_names_are_right_one_by_one_or_up_to_what_flights_cannot_tell(diagnosis, expected):
    assert [j.outcome for j in judge(outcome(MASS, diagnosis))] == [expected]


def test_coefficients_are_compared_where_the_truth_is_not_zero():
    truth = {"wind": {"wx": 2.0, "wy": -1.0, "wz": 0.0}}
    (j,) = judge(outcome(truth, found(name("wind", wx=2.1, wy=-0.99, wz=0.4))))
    assert {k: round(e, 6) for k, (e, _) in j.errors.items()} == {"wind.wx": 0.05, "wind.wy": 0.01}
    assert j.errors["wind.wx"][1] == pytest.approx(0.1 / 0.021)
    # a latency and a clock offset are the same number; a mass and a thrust scale are not
    (j,) = judge(
        outcome(
            {"latency": {"d": 0.03}},
            found(name("clock_offset", like=["latency"], dt=0.033)),
        )
    )
    assert j.errors["latency.d"][0] == pytest.approx(0.1)
    assert not j.exact
    (j,) = judge(outcome(MASS, found(name("thrust_scale", like=["mass"], s=0.04))))
    assert j.errors == {}


def test_what_a_flight_cannot_tell_is_told_apart_from_what_the_diagnosis_overlooks():
    cannot = outcome(
        MASS,
        found(name("mass", like=["thrust_scale"], dm=0.04)),
        found(name("thrust_scale", like=["battery_sag"]), without=("mass",)),
    )
    could = outcome(
        {"latency": {"d": 0.03}},
        found(name("latency", d=0.03)),
        found(name("motor_lag"), without=("latency", "clock_offset")),
    )
    judged = [j for o in (cannot, could) for j in judge(o)]
    assert rule(judged, "5. of those confidently wrong").measured == "50.0% (1 of 2, 9–91 %)"


def test_a_flight_is_diagnosed_and_judged(tmp_path):
    (whole,) = run_trials([SHORT], tmp_path, 1)
    (judged,) = judge(whole)
    assert judged.right
    assert judged.cause == "mass"
    assert 0.0 < judged.rollout_of_truth < 0.3


def test_a_flight_loops_answer_to_noise_is_given_no_name():
    trial = Trial("hover", ("rotor_efficiency",), seed=1)  # and a mass, once
    (judged,) = judge(fly_and_diagnose(trial))
    assert judged.outcome in (RIGHT, RIGHT_TENTATIVE, SILENT)
    assert set(judged.truth) == {name.split(" ")[0].rstrip("?") for name in judged.named}


def test_a_diagnosis_that_falls_over_is_an_outcome():
    (judged,) = judge(fly_and_diagnose(replace(SHORT, libraries=(("gremlins",),), seconds=5.0)))
    assert judged.outcome == FAILED
    assert "gremlins" in judged.problem
    assert rule([replace(judged, without=())], "1. one effect of typical").met is False
