"""The exported filter and its policies against the Python ones, and what must not happen."""

import re
import shutil
from ctypes import create_string_buffer
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose

from tests.support.exported_c import firmware
from tests.support.exported_c.compiled import (
    PARTS,
    STRICT,
    STRICT_C,
    CompiledFilter,
    begin,
    compare,
    missing,
    needs,
    needs_gcc,
    run,
    take,
    write,
)
from tests.support.exported_c.hostile import PERIOD, hostile
from tests.support.outcomes import refused
from tests.support.own_effects import HOSE, joined
from tests.support.paths import ROOT
from tests.support.vehicles import VEHICLE
from windwrench.controllers import Tracker
from windwrench.controllers.lqg import LQG
from windwrench.controllers.observation import FORCE_X, TORQUE_Z, VELOCITY_Y
from windwrench.controllers.trained_policy import TaskPolicy, load_policy
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.effects import names, parse_setting
from windwrench.envs import FanTrackingEnv
from windwrench.envs.closed_loop import Stage
from windwrench.envs.recording import record_flight
from windwrench.envs.vector import SETTLE_TICKS
from windwrench.envs.wind_tasks import WindTrajectoryEnv
from windwrench.estimator import UKFTuning
from windwrench.evaluation.episodes import fly_episode
from windwrench.live.export_c import ESTIMATORS, export_c, exportable_policy
from windwrench.live.export_c.policies import PARTICLES, briefing_of
from windwrench.runtime.errors import InputError
from windwrench.training.run import flight_of

LARGEST = 0.01  # of a standard deviation
POLICY = ROOT / "training" / "policies" / "sac-0.npz"

pytestmark = needs_gcc


def declaring(model, *effects):
    """Return a vehicle with effects, each by its name or with its coefficients."""
    return model.with_effects(*(parse_setting(effect, model) for effect in effects))


QUICK = [
    ("constant-gain", 0.9999, False, "single"),
    ("ukf", 0.9999, False, "single"),
    ("ukf", None, True, "double"),
]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Exports with their compiled filters, each compiled once."""

    @cache
    def build(estimator, gate, precision):
        exported = export_c(VEHICLE, estimator, rate=1.0 / PERIOD, gate=gate, precision=precision)
        return exported, CompiledFilter(exported, tmp_path_factory.mktemp("filter"))

    return build


ROUNDING = {"single": 0.05, "double": 0.0}  # of a standard deviation
EVERY = [
    (name, gate, imu, precision)
    for name, imu in (("constant-gain", False), ("ukf", False), ("ukf", True))
    for gate in (None, 0.9999)
    for precision in ROUNDING
]


@pytest.mark.parametrize(
    ("estimator", "gate", "imu", "precision", "seeds"),
    [
        *((*given, (1, 104)) for given in QUICK),  # 104: on 17 m away
        *(pytest.param(*g, range(2, 86), marks=pytest.mark.slow) for g in EVERY),
    ],
)
def test_c_and_python_agree_along_hostile_sequences(estimator, gate, imu, precision, seeds, built):
    """Statuses and counts of restarts at every step, estimates and deviations within rounding: in
    double to the bit.
    """
    exported, c = built(estimator, gate, precision)
    if precision == "double":
        code = exported.files["windwrench_numbers.hpp"]
        assert not re.search(r"\bfloat\b|[0-9.][fF]\b", code)
    restarts = 0.0
    parted = []
    for seed in seeds:
        flown = hostile(VEHICLE, seed)
        if not imu:
            del flown["gyro"], flown["accelerometer"]
        worst = compare(c, exported.filter, flown)
        restarts += worst["restarts"]
        apart = max(*(worst[part] for part in PARTS), worst["std"] - 1e-15)
        if worst["status"] != 0.0 or apart > ROUNDING[precision]:
            parted.append((seed, worst))
    # without a gate a single filter that follows poses upside down may restart steps later
    assert len(parted) <= (precision == "single" and gate is None and len(seeds) > 50), parted
    assert restarts > 0


@pytest.mark.parametrize("estimator", ESTIMATORS)
def test_compilers_find_nothing_to_say(estimator, tmp_path):
    """With everything in it: effects, an offset centre of mass, a policy, names that could end the
    comment that holds them. What gcc sees only as it optimises is an error wherever
    ``CompiledFilter`` compiles.
    """
    compiler = "g++" if missing("clang++") else "clang++"
    effects = ("rotor_drag", "motor_lag", "ground_effect", "com_offset", "attitude_gain")
    model = declaring(replace(VEHICLE, name="a*/ #error \n\\ b"), *effects)
    few = model.with_effects(model.effects[0])
    single, double = {"ukf": ("tracker", "sac-0"), "constant-gain": ("lead", "tracker")}[estimator]
    policy = exportable_policy(single)
    many, again = (
        export_c(model, estimator, policy=policy, command="windwrench */\n#error") for _ in range(2)
    )
    assert many.files == again.files  # the same bytes
    policy = exportable_policy(double)
    for exported in (many, export_c(few, estimator, gate=None, policy=policy, precision="double")):
        folder = write(exported, tmp_path / exported.precision)
        run(compiler, *STRICT, "-fsyntax-only", "windwrench.cpp", cwd=folder)
        run("gcc", *STRICT_C, "-fsyntax-only", "main.c", cwd=folder)


def test_only_the_allowed_functions_of_libm_are_called(tmp_path):
    needs("nm")
    model = declaring(replace(VEHICLE, ceiling_z=3.0), *names()[::2])
    functions = ("sqrt", "sin", "cos", "exp", "expm1", "log", "pow", "atan2", "tanh")
    allowed = {*(f"{name}f" for name in functions), "memcpy", "memset"}
    folder = write(export_c(model, policy=exportable_policy("sac-0")), tmp_path)
    # a compiler that optimises may make one call of two (sincosf), or none
    run("g++", *STRICT, "-O0", "-fno-stack-protector", "-c", "windwrench.cpp", cwd=folder)
    called = run("nm", "-u", "windwrench.o", cwd=folder).split()[1::2]
    assert set(called) - {"_GLOBAL_OFFSET_TABLE_"} <= allowed


@pytest.mark.parametrize(
    ("estimator", "steps"),
    [
        ("ukf", 1_000),
        *(pytest.param(e, 1_000_000, marks=pytest.mark.slow) for e in ESTIMATORS),
    ],
)
def test_no_fault_makes_it_read_elsewhere_or_lose_its_numbers(estimator, steps, tmp_path):
    exported = export_c(declaring(VEHICLE, "rotor_drag", "motor_lag"), estimator)
    write(exported, tmp_path)
    shutil.copy(ROOT / "tests/support/exported_c/faults.c", tmp_path)
    speed = float(exported.filter.record[0]["last_speeds"][0])
    sanitised = ("-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all")
    options = ("-O1" if steps > 20_000 else "-O0", *sanitised)
    run("g++", *STRICT, *options, "-c", "windwrench.cpp", cwd=tmp_path)
    run(
        *("gcc", "-std=c99", *options, f"-DSTEPS={steps}L", f"-DSPEED={speed}f"),
        *("faults.c", "windwrench.o", "-o", "faults", "-lm"),
        cwd=tmp_path,
    )
    status, height, along = run("./faults", cwd=tmp_path).split()
    assert status == "0"
    assert float(height) == pytest.approx(1.0, abs=1e-3)
    assert abs(float(along)) == pytest.approx(1.0, abs=1e-4)


# a model has room for 16 of a kind; the constant gain does not converge under a slung payload
@pytest.mark.parametrize(("estimator", "half"), [("ukf", 0), ("constant-gain", 1)])
def test_every_effect_works_as_in_python_to_the_bit(estimator, half, tmp_path):
    model = declaring(replace(VEHICLE, ceiling_z=3.0), *names()[half::2])
    exported = export_c(model, estimator, precision="double")
    c = CompiledFilter(exported, tmp_path)
    flown = {name: values[:400] for name, values in hostile(VEHICLE, 1).items()}
    del flown["gyro"], flown["accelerometer"]
    flown["voltage"] = 12.4 - 0.003 * np.arange(400.0)  # a battery that runs down
    flown["voltage"][150:180] = np.nan
    worst = compare(c, exported.filter, flown, 5)
    assert worst["status"] == 0.0
    assert all(worst[part] == 0.0 for part in PARTS), worst


def test_an_effect_of_ones_own_is_refused(tmp_path):
    start = "starting_points=lambda *_: [{'a': 0.1, 'w': 1.0}],"
    (tmp_path / "hose.py").write_text(HOSE.replace("# more", start))
    with joined(tmp_path), pytest.raises(InputError, match="hose is your own"):
        export_c(declaring(VEHICLE, "hose"))


def commands(c, seen):
    """The commands (n,) of the C along observations (n, 8)."""
    c.c.ww_policy_init(c._policy)
    e = c.estimate
    out = []
    for row in seen:
        e.force[:], e.torque[:], e.velocity[1] = row[:3], row[3:6], row[VELOCITY_Y]
        out.append(c.policy(e))
    return np.array(out)


def test_the_policy_in_c_commands_what_it_does_in_python(tmp_path):
    policy = exportable_policy("sac-0")
    c = CompiledFilter(export_c(VEHICLE, "constant-gain", policy=policy), tmp_path)
    python = load_policy(POLICY)
    rng = default_rng(0)
    force = rng.normal(0.3, 0.3, (50, 3))
    torque = rng.normal(0.0, 0.03, (50, 3))
    seen = np.column_stack([force, torque, np.full(50, 0.2), np.zeros(50)])
    wanted = np.zeros(51)
    for k in range(50):
        wanted[k + 1] = python(np.append(seen[k, :7], wanted[k]))[0]
    assert_allclose(commands(c, seen), wanted[1:], rtol=0, atol=2e-5)


def test_the_law_with_lead(tmp_path):
    policy = exportable_policy("lead")
    c = CompiledFilter(export_c(VEHICLE, "constant-gain", policy=policy), tmp_path)
    seen = np.zeros((5, 8))
    seen[:, TORQUE_Z] = torque = np.array([0.001, 0.004, -0.003, 0.01, 0.1])
    seen[:, FORCE_X] = force = np.array([0.5, 0.4, 0.1, -0.2, 0.3])
    x = torque / np.maximum(force, 0.183)
    wanted = np.clip(-(11.35 * x + 2.79 * np.diff(x, prepend=x[0]) / 0.08), -1.0, 1.0)
    assert_allclose(commands(c, seen), wanted, rtol=0, atol=1e-5)


def test_a_controller_decides_in_whole_steps_at_a_measured_pose_rate():
    """101.276 poses a second, as ``identify`` writes them: 25 decisions need 100 steps."""
    vehicle = load_vehicle("crazyflie")
    measured = replace(vehicle, mocap=replace(vehicle.mocap, rate_hz=101.276))
    assert export_c(measured).filter.period == 1.0 / 101.276
    assert export_c(measured, controller="lqg").filter.period == 0.01


class Rates(WindTrajectoryEnv):
    action, observation, normalize = "rates", "all", True


def test_laws_in_c_command_the_rotors_as_in_the_simulator(tmp_path):
    """Beside the simulator's own flight loop, by whose commands the vehicle flies."""
    vehicle = declaring(load_vehicle("crazyflie"), "motor_lag", "rotor_drag")
    rates = Rates(vehicle=vehicle)
    ones = np.ones(len(rates.kept))
    card = {"task": "", "activation": "tanh", "squash": False, "scale": ones, "largest": 1.0}
    weights = {"weight0": 0.1 * np.sin(np.arange(4)[:, None] + ones.cumsum()), "bias0": np.zeros(4)}
    policy = TaskPolicy(card | {"flight": flight_of(rates)}, weights)
    given = {"kind": "flight", "policy": policy}
    exported = export_c(
        rates.declared, "ukf", 200.0, 0.45, None, given, precision="double", controller="lqg"
    )
    c, apart, noise = CompiledFilter(exported, tmp_path), [], np.zeros(3)
    pilot_memory = create_string_buffer(1 << 14)

    def begin_flight(loop):
        if loop.ticks == -SETTLE_TICKS:
            c.reset(loop.sample[4:7], loop.sample[7:])
            c.c.ww_flight_init(pilot_memory)

    def compared(loop):
        c.predict(loop.sample[:4], 0.005)
        c.correct(loop.sample[4:7], loop.sample[7:])
        record = loop.record[0]
        felt = record["plant"]["rotation"].T @ loop.world.xfrc[:3] / vehicle.mass
        felt += record["accelerometer_bias"] + record["accelerometer_sigma"] * noise
        noise[:] = loop.noise[loop.row, -3:]  # of this tick: the next step tells of it
        reference = env.many.episodes.references[0, max(loop.ticks, 0)]
        now, out = (loop.ticks >= 0) * (1 + (env.action == "rates")), c._array(np.zeros(4))
        given = c._array(reference), c._array(felt), out
        assert c.c.ww_fly(pilot_memory, c.memory, now, *given) == 0
        apart.append(abs(np.array(out) - loop.command).max())

    stages = [Stage("begin", begin_flight, "sense"), Stage("compared", compared, "actuate")]
    for kind, pilot in ((WindTrajectoryEnv, LQG(vehicle=vehicle)), (Rates, policy)):
        env = kind(vehicle=vehicle, stages=stages)
        fly_episode(env, pilot, 3, decisions=20)
        assert max(apart) < 0.01  # rad/s: actions are of single precision there
        assert len(apart) == SETTLE_TICKS + 20 * 8
        apart.clear()


def test_policies_that_no_flight_loop_knows_are_refused():
    with refused("expected one of FanTracking, or one of dense"):
        export_c(
            VEHICLE, policy=exportable_policy(str(POLICY.parent / "tasks/WindHover-gru-0.npz"))
        )


def test_the_example_finds_the_force_that_it_is_given(tmp_path):
    needs("cmake")
    folder = write(export_c(load_vehicle("crazyflie"), "ukf"), tmp_path / "source")
    run("cmake", "-S", folder, "-B", tmp_path / "build", cwd=tmp_path)
    run("cmake", "--build", tmp_path / "build", cwd=tmp_path)
    said = run("./windwrench_example", cwd=tmp_path / "build")
    assert said.startswith("force 0.")
    assert float(said.split()[1]) == pytest.approx(0.2, abs=0.02)


def test_on_a_cortex_m4_it_says_the_same_within_its_limits(built, tmp_path):
    """Code, memory and instructions of every filter on the board that qemu imitates."""
    needs(*firmware.TOOLS)
    log, dt = record_flight(VEHICLE, (), "yaw", 0.75), default_rng(0).uniform(0.0049, 0.0051, 150)
    columns = "rotor_speeds", "position", "quaternion"
    flown = {name: np.float32(log[name][:150]).astype(float) for name in columns}
    flown |= {"dt": np.float32(dt).astype(float)}
    for estimator, ram, instructions in (
        ("constant-gain", 3_200, 8_400),
        ("ukf", 6_144, 96_000),
    ):
        exported, c = built(estimator, 0.9999, "single")
        board = firmware.fly(exported, flown, tmp_path / estimator)
        assert abs(board.loop - 2_000) < 20
        assert board.code <= 40_960
        assert board.ram <= ram
        assert board.ram + board.stack <= 16_384
        assert np.median(board.predict + board.correct) <= instructions
        python = exported.filter
        begin(python, flown)
        for k in range(begin(c, flown) + 1, len(flown["dt"])):
            take(c, flown, k)
            take(python, flown, k)
            e = c.estimate
            _, rate, *others = python.estimate.std.reshape(6, 3)  # of noise
            std = np.concatenate([others[0], np.full(4, 0.01), others[1], rate, *others[2:]])
            parts = ("position", "quaternion", "velocity", "angular_velocity", "torque", "force")
            mine = np.concatenate([getattr(e, name) for name in parts])
            assert board.status[k - 1] == e.status
            assert (abs(board.estimates[k - 1] - mine) < LARGEST * std).all()


BRIEFING = briefing_of(VEHICLE, UKFTuning.for_vehicle(VEHICLE, 0.005, 0.45), 0.005)
SEEDS = (2463534242, 1013904223, 362436069, 521288629, 88675123)


class Streams:
    """The random numbers of the C, a stream for each use, in the order in which Python asks."""

    def __init__(self):
        self.state = list(SEEDS)
        self.asked = 0  # uniform numbers since normal ones

    def _uniform(self, stream, count):
        out = np.empty(count)
        x = self.state[stream]
        for i in range(count):
            x ^= (x << 13) & 0xFFFFFFFF
            x ^= x >> 17
            x ^= (x << 5) & 0xFFFFFFFF
            out[i] = np.float32((x >> 9) + 0.5) / 2**23
        self.state[stream] = x
        return out

    def _normal(self, stream, count):
        u = self._uniform(stream, 2 * count).reshape(-1, 2)
        return np.sqrt(-2.0 * np.log(u[:, 0])) * np.cos(2.0 * np.pi * u[:, 1])

    def uniform(self, low, high, count):
        return low + (high - low) * self._uniform(0, count)

    def random(self, count=None):
        if count is None:
            return self._uniform(4, 1)[0]
        self.asked += 1
        return self._uniform(self.asked, count)

    def standard_normal(self, count):
        # of the drift, or once two kinds of uniform numbers are drawn, of fresh velocities
        stream, self.asked = (3, 0) if self.asked == 2 else (0, self.asked)
        return self._normal(stream, count)


class OwnTracker(Tracker):
    """The tracker with those numbers."""

    def _begin(self):
        self._rng = Streams()
        self._rng.asked = 1  # at first nothing jumps
        super()._begin()


@pytest.fixture(scope="module")
def c(tmp_path_factory):
    needs("gcc")
    policy = exportable_policy("tracker")
    exported = export_c(VEHICLE, "constant-gain", 200.0, 0.45, policy=policy)
    return CompiledFilter(exported, tmp_path_factory.mktemp("tracker"))


def test_given_the_same_random_numbers_it_commands_the_same(c):
    envs = FanTrackingEnv.vector(6, scenario="base")
    envs.reset(seed=1)
    still = np.zeros((6, 1), dtype=np.float32)
    seen = np.array([envs.step(still)[0] for _ in range(60)])
    apart = []
    for one in seen.swapaxes(0, 1):
        law = OwnTracker(particles=PARTICLES)
        law.brief(BRIEFING)
        law.reset()
        python = np.array([float(law(row)[0]) for row in one])
        assert np.ptp(python) > 0.2
        apart.append(abs(commands(c, one) - python))
    apart = np.array(apart)
    assert np.sum(np.max(apart[:, :6], axis=1) < 1e-5) >= 5
    # where rounding once draws another particle than Python does, commands go on a little apart
    assert np.sum(np.max(apart, axis=1) < 1e-3) >= 4
    assert np.max(apart) < 0.1
    # and it says how much memory it takes
    assert 90 * PARTICLES < c.policy_bytes < 110 * PARTICLES + 100
