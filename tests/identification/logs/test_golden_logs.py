"""Every measured file, and a small file of each form, gives the flight log that it gave before."""

import pytest
from numpy.testing import assert_allclose

from tests.support.data_paths import DATA
from tests.support.golden_logs import load_golden, recorded
from tests.support.parameters import mostly_slow

GOLDEN = load_golden()
# cases that are said to be as the file alone
REPEATED = {case for case, found in load_golden(whole=False).items() if isinstance(found, str)}
RELATIVE = 1e-9  # of an array's root mean square
# a file each of the folders whose files are of one kind; where a vehicle or a map changes nothing,
# the file alone is quick
QUICK = ("log10", "normal_flight__E8_log00", "labelled_00", "multisine", "B2_", "flight_c")
MANY = ("crazyflie_imu", "crazypad", "flights", "idsia", "nanobench", "racer")


def is_quick(case):
    kind = case.removeprefix("shared/").partition("/")[0]
    if case in REPEATED:
        return False
    if not case.startswith("shared"):
        return True
    if case.startswith("shared/idsia") and case.endswith("alone"):
        return False  # a large table, and guesses are in ``test_golden_readings.py``
    return kind not in MANY or any(f"{kind}/{name}" in case for name in QUICK)


@pytest.mark.parametrize("case", mostly_slow(GOLDEN, is_quick))
def test_a_file_gives_the_flight_log_that_was_recorded(case):
    room, _, rest = case.rpartition(" ")[0].partition("/")
    if room == "shared" and not (DATA / rest).exists():
        pytest.skip(f"the measured file {rest} is not in {DATA} (WINDWRENCH_DATA names another)")
    found = recorded(case)
    expected = GOLDEN[case]
    assert found.get("error") == expected.get("error")
    if "error" in expected:
        return
    assert set(found["notes"]) == set(expected["notes"])
    assert (found["vehicle"], found["commanded"]) == (expected["vehicle"], expected["commanded"])
    assert set(found["arrays"]) == set(expected["arrays"])
    for name, summary in expected["arrays"].items():
        here = found["arrays"][name]
        for key in ("shape", "finite", "where"):
            assert here[key] == summary[key], f"{name}: {key}"
        if "numbers" in summary:
            scale = abs(summary["numbers"][1])
            assert_allclose(
                here["numbers"], summary["numbers"], RELATIVE, RELATIVE * scale, err_msg=name
            )
