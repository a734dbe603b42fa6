"""Numbers that no flight has are refused where a log is read, with the place where they stand."""

import numpy as np
import pytest

from windwrench.identification import read_log
from windwrench.identification.logs.flight_log import REQUIRED
from windwrench.runtime.errors import InputError


def write(path, change):
    rows = np.zeros((100, len(REQUIRED)))
    rows[:, 0], rows[:, 4], rows[:, 8:] = 0.005 * np.arange(100), 1.0, 361.0
    change(rows)
    lines = [",".join(map(repr, row)) for row in rows.tolist()]
    path.write_text("\n".join([",".join(REQUIRED), *lines]))
    return path


def times(values):
    def change(rows):
        rows[:, 0] = values

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (times(1e-310 * np.arange(100)), "column t: the median time step is 1e-310 s"),
        (times(1e-25 * np.arange(100)), "column t: the median time step is 1e-25 s"),
        (times(1e300 * np.arange(100)), r"column t, row \d+: 1e\+300 s after the row before"),
    ],
)
def test_numbers_of_no_flight_are_refused(change, message, tmp_path):
    with pytest.raises(InputError, match=rf"log\.csv: {message}"):
        read_log(write(tmp_path / "log.csv", change))


@pytest.mark.parametrize("step", [1e-310, 1e-25, 1e-9])
def test_one_short_step_is_a_flight_s(step, tmp_path):
    rest = 0.005 * np.arange(1, 99)
    log = read_log(write(tmp_path / "log.csv", times(np.concatenate([[0.0, step], rest]))))
    assert log.t[1] == step
