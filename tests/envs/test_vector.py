"""Many environments in one process are as many single ones; those in lanes fly what MuJoCo's do."""

import copy
from dataclasses import replace
from math import nan

import mujoco
import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

from tests.support.outcomes import refused
from tests.support.own_effects import HOSE, joined
from tests.support.vector_flights import TASKS, fly, make
from windwrench import _core
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import get, names
from windwrench.dynamics.vehicle import EffectSetting, Uncertainty
from windwrench.envs.closed_loop import ClosedLoop
from windwrench.envs.plant import SUBSTEPS, TICK, PlantSettings, load_world
from windwrench.envs.scenarios import SCENARIOS, draw_vehicle

WIDTH = _core.LoopBlocks.lanes


@pytest.mark.parametrize(
    ("given", "threads"),
    [
        ({"estimator": "ukf"}, 5),
        ({"estimator": "constant-gain"}, 2),
        ({"plant": "lanes"}, 3),
        ({"plant": "lanes", "precision": "single"}, 2),
    ],
)
def test_the_bits_depend_on_neither_number_nor_threads(given, threads):
    given = {"scenario": "varied", "max_episode_steps": 7, **given}
    many = 2 * WIDTH + 1 if "plant" in given else 5
    decisions = 9
    alone = fly(make(many, **given), decisions)
    for other in (make(2, **given), make(many, threads=threads, **given)):
        count = other.num_envs
        assert_array_equal(fly(other, decisions), alone[:, :count])


@pytest.mark.parametrize("plant", ["mujoco", "lanes"])
def test_one_state_that_is_no_number_is_lost_and_the_others_fly_on(plant, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes a log where it runs
    envs = make(3, plant, threads=2)
    healthy = make(3, plant)
    actions = np.zeros((3, 1), np.float32)
    for one in (envs, healthy):
        one.reset(seed=0)
    if plant == "mujoco":
        envs.loops[1].data.qvel[0] = nan
    else:
        envs._flying.view("qvel")[0, 0, 1] = nan
    frames, rewards, lost, _, infos = envs.step(actions)
    assert lost.tolist() == infos["lost"].tolist() == [False, True, False]
    assert frames in envs.observation_space
    assert np.isfinite([rewards, infos["offset"]]).all()
    assert_array_equal(frames[[0, 2]], healthy.step(actions)[0][[0, 2]])
    _, rewards, lost, _, infos = envs.step(actions)
    assert not lost.any()
    assert (rewards[1], infos["time"][1]) == (0.0, 0.0)
    envs.close()


def test_many_environments_want_a_reset_of_all_first():
    envs = make(2)
    envs.reset(seed=0, options={"reset_mask": np.array([True, False])})
    with refused("reset before step"):
        envs.step(np.zeros((2, 1), np.float32))


def test_seeds_may_be_listed_and_a_part_reset():
    envs = make(3)
    frames, _ = envs.reset(seed=[7, 5, 7])
    assert_array_equal(frames[0], frames[2])
    assert not np.array_equal(frames[0], frames[1])
    for _ in range(2):
        envs.step(np.zeros((3, 1), np.float32))
    again, infos = envs.reset(
        seed=[7, None, None], options={"reset_mask": np.array([True, False, False])}
    )
    assert_array_equal(again[0], frames[0])
    assert infos["time"].tolist() == [0.0, pytest.approx(0.16), pytest.approx(0.16)]


@pytest.mark.parametrize("actions", [np.zeros(3), np.zeros((2, 1)), np.full((3, 1), nan)])
def test_bad_actions_are_named_and_nothing_flies(actions):
    envs = make(3)
    envs.reset(seed=0)
    with refused(r"shape \(3, 1\)"):
        envs.step(actions)
    assert (envs.step(np.zeros((3, 1)))[4]["time"] == 0.08).all()


@pytest.mark.parametrize("bits", [np.random.PCG64, np.random.SFC64, np.random.MT19937])
def test_the_core_draws_the_normals_of_numpy(bits):
    """2,000,000, of which 500 are in the tail; NumPy's own draws go on behind them."""
    ours, theirs = (np.random.Generator(bits(5)) for _ in range(2))
    streams, drawn = _core.Streams(1), np.empty((2000, 1000))
    streams.put(0, ours)
    streams.draw(0, drawn)
    assert_array_equal(drawn, theirs.standard_normal(drawn.shape))
    assert abs(drawn).max() > 3.66
    assert ours.integers(1 << 60) == theirs.integers(1 << 60)


def test_mujoco_s_clock_is_a_user_s_again_after_a_flight():
    envs = make(1)
    calls = []

    def clock():
        calls.append(0)
        return 0.0

    envs.reset(seed=0)
    mujoco.set_mjcb_time(clock)
    try:
        envs.step(np.zeros((1, 1)))
        assert not calls  # no step of the flight is timed
        assert mujoco.get_mjcb_time() is clock
    finally:
        mujoco.set_mjcb_time(None)


@pytest.mark.parametrize(("task", "plant"), [("WindHover", "mujoco"), ("WindTrajectory", "lanes")])
def test_a_copy_of_many_goes_on_as_they_do(task, plant):
    envs = make(3, plant, task, max_episode_steps=3)  # and begins the same episodes
    envs.reset(seed=2)
    other = copy.deepcopy(envs)
    still = np.zeros(envs.action_space.shape, dtype=np.float32)
    for _ in range(5):
        assert_array_equal(envs.step(still)[0], other.step(still)[0])


SET = (
    {"settings": PlantSettings(dropout=0.2)},
    {"vehicle": "crazyflie"},
    {"effects": [EffectSetting("com_offset", {"cx": 0.01, "cy": -0.02, "cz": 0.005})]},
    {"observe": "pose"},
    {"observe": "history", "normalize": True},
    {"fan_path": lambda t: 0.3 * np.sin(t)},
)
ENDING = {"scenario": "fast", "max_episode_steps": 7}


@pytest.mark.parametrize(
    ("count", "decisions", "given", "apart"),
    [
        *((3, 13, {"scenario": name}, 1e-9) for name in SCENARIOS),
        *((2, 6, given, 1e-6) for given in SET),  # numbers that are seen are rounded to 32 bits
        *((WIDTH + 1, 20, ENDING | {"autoreset_mode": m}, 1e-9) for m in ("NextStep", "SameStep")),
    ],
)
def test_lanes_fly_what_mujoco_does(count, decisions, given, apart):
    """A second of each scenario, all that can be set, and episodes that end and begin."""
    ours, theirs = (fly(make(count, plant, **given), decisions) for plant in ("lanes", "mujoco"))
    assert abs(ours - theirs).max() < apart


def test_a_body_that_tumbles_moves_as_in_mujoco():
    """Centre of mass off the centre, inertia with products, another turn in each lane."""
    inertia = np.array([[2.2, 0.3, -0.2], [0.3, 3.0, 0.1], [-0.2, 0.1, 4.0]]) * 1e-3
    vehicle = replace(load_vehicle("ardrone2"), inertia=inertia, com=np.array([0.02, -0.03, 0.01]))
    loop = ClosedLoop(vehicle)
    blocks = _core.LoopBlocks(loop.address, 1, False, False, np.zeros(0, np.int64))
    rng = default_rng(0)
    start = rng.normal(0, 5, (6, WIDTH))
    wrench = rng.normal(0, 0.02, (6, WIDTH))
    pose, velocity = blocks.view("qpos")[0], blocks.view("qvel")[0]
    pose[:], pose[3], velocity[:], blocks.view("xfrc")[0] = 0.0, 1.0, start, wrench
    blocks.fly_freely(TICK / SUBSTEPS, round(SUBSTEPS / TICK))
    model, data = load_world(vehicle, drawn=False)
    for lane in range(WIDTH):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = [0, 0, 0, 1, 0, 0, 0]
        data.qvel[:] = start[:, lane]
        data.xfrc_applied[model.body("vehicle").id] = wrench[:, lane]
        for _ in range(round(SUBSTEPS / TICK)):
            mujoco.mj_step(model, data)
        assert_allclose(pose[:, lane], data.qpos, atol=1e-9)
        assert_allclose(velocity[:, lane], data.qvel, atol=1e-8)


# m, m/s, rad/s; N, Nm: a log's rounded rotor speeds may fall on the other side
CLOSE = {"position": 5e-4, "velocity": 3e-3, "angular_velocity": 3e-2, "force": 5e-3}


def small(name):
    """An effect of a third of its typical size."""
    known = {c.name: (0.3 * c.typical[0], c.minimum, c.maximum) for c in get(name).coefficients}
    return EffectSetting(name, {n: float(np.clip(*range_)) for n, range_ in known.items()})


UNDECLARED = [small(name) for name in ("rotor_drag", "motor_lag", "slung_payload", "clock_offset")]


@pytest.mark.parametrize(
    "given",
    [
        {"task": "FanTracking"},
        {"task": "WindTrajectory", "scenario": "varied"},
        {"effects": UNDECLARED},
    ],
)
def test_lanes_of_32_bits_fly_close_to_those_of_64(given):
    """Two seconds: the noise of the estimate is ten times as large."""
    states = []
    for precision in ("double", "single"):
        envs = make(WIDTH + 1, "lanes", precision=precision, **given)
        fly(envs, 12 if "effects" in given else 25)
        states.append(envs.state)
    for name, apart in CLOSE.items():
        assert_allclose(*(getattr(state, name) for state in states), atol=apart)


@pytest.mark.parametrize("name", names())
def test_every_effect_flies_in_lanes_as_in_mujoco(name):
    """Declared, so that filter and flight loop have it, too; with poses late and lost."""
    vehicle = replace(load_vehicle("ardrone2"), effects=(small(name),))
    settings = PlantSettings(dropout=0.2, dropout_burst=0.02, pose_delay=0.01)
    given = {"task": "WindHover", "vehicle": vehicle, "settings": settings}
    states = [make(2, plant, **given) for plant in ("lanes", "mujoco")]
    for envs in states:
        fly(envs, 4)
    ours, theirs = (envs.state.rows for envs in states)
    assert_allclose(ours, theirs, rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("task", TASKS)
def test_the_true_vehicle_is_drawn_anew_by_its_uncertainty(task):
    known = replace(
        load_vehicle("ardrone2"), uncertainty=Uncertainty(0.1, 0.1, 0.02, 0.1, 0.1, 0.1)
    )
    given = {"task": task, "vehicle": known, "randomise": "vehicle", "max_episode_steps": 2}
    lanes, mujoco = (make(2, plant, **given) for plant in ("lanes", "mujoco"))
    assert_allclose(fly(lanes, 5), fly(mujoco, 5), rtol=1e-7, atol=1e-7)
    assert len({known.mass, *(loop.true.mass for loop in mujoco.loops)}) == 3
    drawn = [np.log(draw_vehicle(known, default_rng(seed)).k) for seed in range(300)]
    assert_allclose(np.std(drawn, axis=0), np.hypot(0.1, 0.02), rtol=0.1)
    with refused("an uncertainty in the vehicle's file"):
        make(1, task=task, vehicle=replace(known, uncertainty=Uncertainty()), randomise="vehicle")


def test_lanes_refuse_effects_in_python_and_other_precisions(tmp_path):
    pull = HOSE.replace("c[0] * math.sin(c[1] * state.time)", "c[0] + c[1]")
    (tmp_path / "hose.py").write_text(pull, encoding="utf-8")
    with joined(tmp_path), refused("plant='lanes' flies no effects in Python"):
        make(2, "lanes", effects=[EffectSetting("hose", {"a": 0.1, "w": 3.0})])
    with refused("unknown precision 'half'"):
        make(2, "lanes", precision="half")
    with refused("precision is of plant='lanes'"):
        make(2, precision="single")


def test_a_callback_of_mujoco_is_called_in_a_flight_and_its_error_raised():
    envs = make(2, threads=2)
    calls = []
    envs.reset(seed=0)
    mujoco.set_mjcb_control(lambda model, data: calls.append(data.time))
    try:
        envs.step(np.zeros((2, 1)))
        assert len(calls) == 2 * 16 * SUBSTEPS
        mujoco.set_mjcb_control(lambda model, data: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            envs.step(np.zeros((2, 1)))
    finally:
        mujoco.set_mjcb_control(None)
