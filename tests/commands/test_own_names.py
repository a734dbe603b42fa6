"""Commands take a task, a law and a reward of a user's own by name."""

import json

import pytest

from tests.evaluation.test_names import LANDING, POINT, REGISTERED, fresh, written  # noqa: F401


def test_commands_take_a_task_of_one_s_own(call, tmp_path):
    path = written(tmp_path, "own_commands.py", POINT + REGISTERED.replace("points", "commands"))
    given = "--import", path, "--task", "me/Point-v0", "--json"
    code, text, _ = call("fly", *given, "--controller", f"{path}:Damped")
    assert code == 0
    assert json.loads(text)["result"]["rmse_m"] is None


@pytest.mark.slow
def test_a_task_of_one_s_own_is_trained_with_a_reward_and_its_policy_flies(call, tmp_path):
    pytest.importorskip("stable_baselines3", reason="pip install 'windwrench[rl]'")
    path = written(tmp_path, "own_trained.py", LANDING)
    named = "--task", f"{path}:Landing"
    few = "validation.every=80", "validation.episodes=1", "checkpoint=80", "environments=2"
    few += "learner.learning_starts=20", "learner.batch_size=16", "net=[8]"
    settings = [word for one in few for word in ("--set", one)]
    own = "--reward", f"{path}:near", "--steps", 160, "--out", "run"
    code, text, _ = call("train", "sac", *named, *own, *settings, "--json")
    assert code == 0
    policy = json.loads(text)["result"]["policy"]
    card = json.loads((tmp_path / "run" / "best.json").read_bytes())
    assert (card["reward"], card["largest"], len(card["scale"])) == (f"{path}:near", 4.0, 27)
    assert "features" not in card
    code, text, _ = call("fly", *named, "--controller", policy, "--json")
    assert code == 0
    assert json.loads(text)["result"]["rmse_settled_m"] > 0.0
    assert "expected the task FanTracking" in call("train", "imitation", *named, "--out", "x")[2]
