"""What was said of known conventions is said again: right and certain stays so, wrong stays out."""

import pytest

from tests.support.golden_readings import available, load_golden, recorded
from tests.support.parameters import mostly_slow

GOLDEN = load_golden()
QUICK = ("table tests", "file tests", *(f"random {i}" for i in range(3)))


def cases(way):
    def is_quick(case):
        return case in QUICK or case.startswith(QUICK[:2])

    return mostly_slow([c for c in GOLDEN if c.startswith(way)], is_quick)


def found(case, every=1):
    if not available(case):
        pytest.skip(f"the file of {case} is not there (WINDWRENCH_DATA names another folder)")
    return recorded(case, every)


@pytest.mark.parametrize("case", cases("random"))
def test_a_table_in_a_random_convention_is_right_or_marked_as_a_guess(case):
    said = found(case)
    assert "wrong" not in said
    assert not set(GOLDEN[case]["right"].split()) - set(said["right"].split())


@pytest.mark.measured
@pytest.mark.parametrize("case", cases("table"))
def test_the_map_of_a_measured_table_keeps_what_is_certain(case):
    said = found(case)
    for way, expected in GOLDEN[case].items():
        here = said.get(way, said.get("both"))
        for field, value in expected.items():
            assert here[field].removesuffix(" (a guess)") == value.removesuffix(" (a guess)")
            assert " (a guess)" in value or here[field] == value


@pytest.mark.measured
@pytest.mark.parametrize("case", cases("file"))
def test_a_measured_file_raises_the_doubts_that_it_raised(case):
    assert found(case) == GOLDEN[case]


@pytest.mark.parametrize(
    ("case", "every"),
    [
        ("hostile 0", 13),
        *(
            pytest.param(case, 1, marks=pytest.mark.slow)
            for case in GOLDEN
            if case.startswith("hostile")
        ),
    ],
)
def test_a_flight_in_another_convention_is_named(case, every):
    def by_kind(said, use):
        return {kind: told for told, kinds in said[use].items() for kind in kinds}

    said = found(case, every)
    for use, least in (("diagnosis", 36 // every), ("estimate", 4)):
        kept = by_kind(GOLDEN[case], use)
        here = by_kind(said, use)
        assert len(here) >= least
        for kind, told in here.items():
            allowed = {kept[kind], "named"} if kept[kind] == "passed" else {kept[kind]}
            assert told in allowed, f"{use}, {kind}"
