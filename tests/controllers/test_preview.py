"""The oracles: their command is best, what they are told is true, and nothing beats them."""

import numpy as np
import pytest

from windwrench.controllers.observation import MAX_COMMAND
from windwrench.controllers.preview import Oracle, WindOracle, preview, regulator
from windwrench.dynamics import load_vehicle
from windwrench.dynamics.rotation import quaternion_to_matrix
from windwrench.evaluation.tasks import TASKS
from windwrench.studies.kept_results import kept


@pytest.mark.parametrize("law", [Oracle, WindOracle])
@pytest.mark.parametrize("axis", [0, 2])
def test_the_command_is_the_first_of_those_that_are_best(law, axis):
    """Least squares over 40 commands at once, with the cost of what is left after them, agree with
    the regulator for any start and any disturbance of 12 decisions.
    """
    count, horizon, effort, rng = 12, 40, 1e-4, np.random.default_rng(0)
    A, B, D = law.steps(load_vehicle("ardrone2"))[axis]
    n = len(A)
    x, d = rng.standard_normal(n), rng.standard_normal((count, D.shape[1]))
    weights = [np.diag(np.sqrt(np.r_[1.0, np.full(n - 1, 1e-9)]))] * horizon
    weights[-1] = np.linalg.cholesky(regulator(A, B, effort)[1]).T
    free, moved, rows, right = x, np.zeros((n, horizon)), [], []
    for k, weight in enumerate(weights):
        free = A @ free + (D @ d[k] if k < count else 0.0)
        moved = A @ moved
        moved[:, k] += B[:, 0]
        rows.append(weight @ moved)
        right.append(-weight @ free)
    rows.append(np.sqrt(effort) * np.eye(horizon))
    right.append(np.zeros(horizon))
    best = np.linalg.lstsq(np.concatenate(rows), np.concatenate(right), rcond=None)[0]
    gain, ahead = preview(A, B, D, effort, count)
    assert -(gain @ x + np.sum(ahead * d)) == pytest.approx(best[0], rel=1e-6)


@pytest.mark.parametrize("task", TASKS)
def test_who_foresees_nothing_is_told_what_everybody_is(task):
    plain, knowing = TASKS[task].environment("base"), TASKS[task].environment("base")
    knowing.foresight = 3
    action = np.full(plain.action_size, 0.2, dtype=np.float32)
    for seen, told in (
        (plain.reset(seed=5), knowing.reset(seed=5)),
        (plain.step(action)[::4], knowing.step(action)[::4]),
    ):
        np.testing.assert_array_equal(seen[0], told[0])
        assert seen[1].keys() < told[1].keys()
        assert {"velocity", "up", "integral"} <= told[1].keys() - seen[1].keys()


@pytest.mark.parametrize("task", TASKS)
def test_what_the_oracle_is_told_is_true(task):
    """The motion is the plant's now, and what is to come is what then comes."""
    env, R = TASKS[task].environment("base"), np.empty((3, 3))
    env.foresight = 4
    infos, jets = [env.reset(seed=900_200)[1]], []
    for k in range(12):
        *_, info = env.step(np.full(env.action_size, 0.3 * (-1) ** (k // 3), dtype=np.float32))
        infos.append(info)
        jets.append(env.loop.jet[:3].copy())
        quaternion_to_matrix(env.loop.quaternion, R)
        moving = env.loop.motion[1]
        np.testing.assert_array_equal(info["velocity"], moving[:3])
        np.testing.assert_array_equal(info["rate"], R @ moving[3:6])
        np.testing.assert_array_equal(info["up"], R[:, 2])
    if task.startswith("Wind"):
        ahead = np.array([info["wrench_ahead"][0, :3] for info in infos[:-1]])
        assert np.abs(ahead - jets).max() < 0.02 < 0.2 < np.abs(jets).max()  # N
        return
    np.testing.assert_array_equal(infos[-1]["place"], env.loop.position)
    np.testing.assert_array_equal(infos[-1]["setpoint"], env.loop.setpoint[:3])
    for k, info in enumerate(infos):
        fan = info["fan"] if "fan" in info else [info["fan_y"]]
        np.testing.assert_array_equal(info["fan_ahead"][0, : len(fan)], fan)
        for later, one in enumerate(infos[k : k + 5]):
            np.testing.assert_array_equal(info["fan_ahead"][later], one["fan_ahead"][0])


@pytest.mark.parametrize("task", TASKS)
def test_nothing_on_the_leaderboard_beats_the_oracle(task):
    rows = kept(
        "results/leaderboard.json" if task == "FanTracking" else f"results/tasks/{task}.json.gz"
    )
    for scenario in {row["scenario"] for row in rows}:
        means = {row["controller"]: row["rmse_m"] for row in rows if row["scenario"] == scenario}
        assert min(means, key=means.__getitem__) == "oracle"


def test_a_command_stays_within_its_bounds():
    env = TASKS["FanTracking"].environment("far")
    env.foresight = Oracle().foresight
    observation, info = env.reset(seed=900_200)
    command = Oracle()(observation, info)
    assert command.shape == (1,)
    assert abs(command[0]) == MAX_COMMAND
