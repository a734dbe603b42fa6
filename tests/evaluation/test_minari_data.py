"""Datasets of Minari hold the episodes that a law flies."""

import numpy as np
import pytest

from windwrench.evaluation import minari_data
from windwrench.runtime import extras
from windwrench.runtime.errors import InputError


def test_without_minari_it_says_what_to_install(monkeypatch):
    monkeypatch.setattr(extras, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install 'windwrench\[minari\]'"):
        minari_data.check_dataset_request("FanTracking", ["hover"], ["base"], 1, 0)


@pytest.mark.parametrize(
    ("request_", "said"),
    [
        (("FanTraking", ["hover"], ["base"], 1, 0), "FanTracking"),
        (("WindHover", ["hovre"], ["base"], 1, 0), "hover"),
        (("FanTracking", ["hover"], ["bsae"], 1, 0), "base"),
        (("FanTracking", ["hover"], ["base"], 0, 0), "--episodes"),
        (("FanTracking", ["hover"], ["base"], 1, 90), "--seed"),
    ],
)
def test_what_cannot_be_flown_is_refused(monkeypatch, request_, said):
    monkeypatch.setattr(minari_data, "need", lambda module, extra: None)
    with pytest.raises(InputError, match=said):
        minari_data.check_dataset_request(*request_)


def test_no_episode_is_one_of_a_benchmark():
    last = minari_data.FIRST_HELD_OUT_SEED // 10_000 - 1
    assert 10_000 * last + 9_999 < minari_data.FIRST_HELD_OUT_SEED


@pytest.mark.parametrize(("task", "law"), [("FanTracking", "lead"), ("WindHover", "oracle")])
def test_a_dataset_holds_what_was_flown(tmp_path, monkeypatch, task, law):
    minari = pytest.importorskip(
        "minari", reason="Minari is not installed: pip install 'windwrench[minari]'"
    )
    written = minari_data.write_dataset(task, "base", law, 2, 3, tmp_path)
    monkeypatch.setenv("MINARI_DATASETS_PATH", str(tmp_path))
    found = minari.load_dataset(written.id)
    episodes = list(found.iterate_episodes())
    assert found.total_episodes == 2
    assert found.total_steps == written.decisions
    returns = [float(np.sum(episode.rewards)) for episode in episodes]
    assert np.mean(returns) == pytest.approx(written.mean_return)
    assert episodes[0].truncations[-1] or episodes[0].terminations[-1]
    # the first episode flown again from its seed and the data's actions
    env = found.recover_environment()
    seen, _ = env.reset(seed=30_000)
    for k, action in enumerate(episodes[0].actions[:20]):
        assert np.array_equal(seen, episodes[0].observations[k])
        seen, reward, *_ = env.step(action)
        assert reward == pytest.approx(float(episodes[0].rewards[k]))
    with pytest.raises(InputError, match="is there already"):
        minari_data.write_dataset(task, "base", law, 2, 3, tmp_path)
