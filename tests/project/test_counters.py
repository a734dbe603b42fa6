"""The counts that lint holds under their ceilings."""

import importlib.util

import pytest

from tests.support.paths import ROOT

SOURCE = '''"""Where the wind blows. The force is 3 N."""

# By the way it goes:
# a comment in two lines.
SPEED = 3.0  # m/s, of the wind
FORCE = 3.0  # of the wind, N


def drag(speed):
    """Return what the drag of one rotor is; it was measured on a stand in still air, at twelve
    rotor speeds from hover on, by a load cell with a stated error of two per cent.
    """
'''


@pytest.fixture(scope="module")
def counters():
    spec = importlib.util.spec_from_file_location("counters", ROOT / ".ci/counters.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_language_is_counted_by_sentence(counters):
    counts = list(counters.language({"drag.py": SOURCE}).values())
    # seven sentences: 3 such words in all, three begin with Where, By or Of, one has over 25 words
    assert counts == pytest.approx([0.429, 42.9, 14.3])


def test_a_ceiling_holds_and_does_not_rise(counters, monkeypatch):
    monkeypatch.setattr(counters, "earlier_ceilings", lambda: {"nodes": 90.0, "gone": 1.0})
    said = list(counters.problems({"nodes": 101.0, "pages": 3.0}, {"nodes": 100.0}))
    assert said == [
        "nodes: 101, expected at most 100",
        "pages: 3 has no ceiling",
        "nodes: the ceiling rose from 90 to 100",
    ]
    assert not list(counters.problems({"nodes": 80.0}, {"nodes": 90.0}))


@pytest.mark.parametrize(
    ("subject", "body", "is_good"),
    [
        ("wind: gusts are drawn by station", "A uniform gust makes no torque.", True),
        ("Gusts are drawn by station", "A uniform gust makes no torque.", False),
        ("wind: gusts are drawn by station", "", False),
        (f"wind: {'gusts ' * 12}", "A uniform gust makes no torque.", False),
    ],
)
def test_a_commit_has_a_scope_and_a_reason(counters, subject, body, is_good):
    assert counters.is_good_message(subject, body) == is_good
