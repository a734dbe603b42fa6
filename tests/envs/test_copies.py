"""A copy of an environment goes on as the original does, and leaves it alone."""

import copy
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

from tests.support.vector_flights import TASKS
from windwrench.dynamics import EffectSetting, InputError
from windwrench.envs import Copyable

LAG = [EffectSetting("motor_lag", {"tau": 0.03}), EffectSetting("rotor_drag", {"kdx": 1e-4})]
COPIES = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}


def fly(env, decisions=4):
    """Return, as bytes, what some decisions return."""
    rng, seen = np.random.default_rng(1), []
    for _ in range(decisions):
        action = rng.uniform(-0.5, 0.5, env.action_space.shape).astype(np.float32)
        frame, reward, lost, over, info = env.step(action)
        rows = frame, reward, lost, over, info["force"], info["torque"]
        seen.append(b"".join(np.asarray(row).tobytes() for row in rows))
    return seen


@pytest.mark.parametrize("how", COPIES)
@pytest.mark.parametrize("name", TASKS)
@pytest.mark.parametrize(
    "given",
    [{"scenario": "varied"}, {"scenario": "noisy", "effects": LAG, "estimator": "constant-gain"}],
    ids=["varied", "effects"],
)
def test_a_copy_in_flight_goes_on_like_the_original_bit_for_bit(name, how, given):
    env = gym.make(f"windwrench/{name}-v0", **given)
    env.reset(seed=5)
    fly(env)
    other = COPIES[how](env)
    fly(COPIES[how](env), 2)  # what is done to one leaves the others alone
    assert fly(env) == fly(other)
    # the episodes that follow, without a seed of their own, are the same too
    np.testing.assert_array_equal(env.reset()[0], other.reset()[0])
    assert fly(env) == fly(other)


def test_a_copy_goes_on_in_another_process(tmp_path):
    env = gym.make("windwrench/WindHover-v0", effects=LAG)
    env.reset(seed=5)
    (tmp_path / "env").write_bytes(pickle.dumps(env))
    code = (
        "import pickle, sys; from tests.envs.test_copies import fly; "
        "env = pickle.load(open(sys.argv[1], 'rb')); "
        "sys.stdout.buffer.write(b''.join(fly(env)))"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "env")]
    there = subprocess.run(command, capture_output=True, check=True).stdout
    assert there == b"".join(fly(env))


def test_the_wrapper_of_version_1_copies_and_says_what_to_call():
    with pytest.warns(DeprecationWarning, match=r"copy\.deepcopy"):
        env = Copyable(lambda: gym.make("windwrench/FanTracking-v0", scenario="gusty"))
    env.reset(seed=5)
    other = env.copy()
    assert fly(env) == fly(other)


@pytest.mark.parametrize("wrong", [gym.spaces.Discrete(2), lambda: 3, "FanTracking"])
def test_what_makes_no_environment_is_refused(wrong):
    with pytest.raises(InputError, match="expected a function that makes an environment"):
        Copyable(wrong)
