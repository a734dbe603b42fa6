"""How long a command takes is told by what it took on this machine."""

import pytest

from windwrench.commands.durations import duration_words, expected_duration, keep_duration


@pytest.fixture(autouse=True)
def _own_cache(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def test_nothing_is_known_before_a_run():
    assert expected_duration("trials", {"flights": 10}).startswith("not known")


def test_a_run_tells_of_the_same_and_of_larger_ones():
    keep_duration("trials", {"flights": 10, "jobs": None}, 40.0)
    assert expected_duration("trials", {"flights": 10, "jobs": None}).startswith(
        "40 s, as the same"
    )
    more = expected_duration("trials", {"flights": 100, "jobs": None})
    assert more.startswith("about 7 minutes")
    assert "10 flights in 40 s" in more
    assert expected_duration("reproduce", {"flights": 10}).startswith("not known")


def test_another_plan_that_cannot_be_compared_is_not_scaled():
    keep_duration("train", {"algorithm": "sac", "decisions": 1000}, 30.0)
    longer = {"algorithm": "sac", "decisions": 50_000}
    assert expected_duration("train", longer) == (
        "about 25 minutes, by the last run here: 1000 decisions in 30 s"
    )
    assert expected_duration("train", longer | {"algorithm": "ppo"}).startswith("not known")
    keep_duration("train", {"config": {"steps": 5}}, 600.0)
    assert expected_duration("train", {"config": {"steps": 9}}) == (
        "not known; the last run here, of another plan, took 10 minutes"
    )


def test_where_nothing_can_be_kept_nothing_breaks(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    keep_duration("trials", {"flights": 1}, 5.0)
    assert expected_duration("trials", {"flights": 1}).startswith("not known")


def test_durations_are_said_as_people_do():
    assert [duration_words(s) for s in (4.2, 89, 300, 7200)] == [
        "4 s",
        "89 s",
        "5 minutes",
        "2.0 hours",
    ]
