"""A copy of an environment goes on as the original does, and leaves it alone."""

import copy
import pickle
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest

from tests.support.vector_flights import TASKS, fly_alone
from windwrench.dynamics import EffectSetting

LAG = [EffectSetting("motor_lag", {"tau": 0.03}), EffectSetting("rotor_drag", {"kdx": 1e-4})]
COPIES = {"deepcopy": copy.deepcopy, "pickle": lambda env: pickle.loads(pickle.dumps(env))}


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
    fly_alone(env)
    other = COPIES[how](env)
    fly_alone(COPIES[how](env), 2)  # what is done to one leaves the others alone
    np.testing.assert_array_equal(fly_alone(env), fly_alone(other))
    # the episodes that follow, without a seed of their own, are the same too
    np.testing.assert_array_equal(env.reset()[0], other.reset()[0])
    np.testing.assert_array_equal(fly_alone(env), fly_alone(other))


def test_a_copy_goes_on_in_another_process(tmp_path):
    env = gym.make("windwrench/WindHover-v0", effects=LAG)
    env.reset(seed=5)
    (tmp_path / "env").write_bytes(pickle.dumps(env))
    code = (
        "import pickle, sys; from tests.support.vector_flights import fly_alone; "
        "env = pickle.load(open(sys.argv[1], 'rb')); "
        "sys.stdout.buffer.write(fly_alone(env).tobytes())"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "env")]
    there = subprocess.run(command, capture_output=True, check=True).stdout
    assert there == fly_alone(env).tobytes()
