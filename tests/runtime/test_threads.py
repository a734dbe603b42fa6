"""Linear algebra has one thread while the kit works, and the caller's number of them afterwards."""

import os
from pathlib import Path

import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from tests.support.flown import VEHICLE
from tests.support.imu_flights import imu_flight
from windwrench.commands.running import as_command
from windwrench.identification.diagnosis import diagnose
from windwrench.identification.vehicle_fit.geometry import parse_geometry
from windwrench.identification.vehicle_fit.identify import identify
from windwrench.identification.wrench_series import estimate_log
from windwrench.runtime.threads import SINGLE_THREADED, one_thread


class SeenError(Exception):
    """Ends work as soon as its threads were counted."""


def threads():
    """Of each library of linear algebra, and what a process that is started now is told."""
    told = {os.environ.get(name) for name in SINGLE_THREADED}
    return {one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"}, told


ALONE = {1}, {"1"}


@pytest.fixture(autouse=True)
def three(monkeypatch):
    """Three threads, as of a caller who set them."""
    for name in SINGLE_THREADED:
        monkeypatch.setenv(name, "3")
    with threadpool_limits(3, "blas"):
        yield
        assert threads() == ({3}, {"3"})


def test_one_thread_inside_and_those_of_before_afterwards():
    assert threads() == ({3}, {"3"})
    with one_thread():
        assert threads() == ALONE
        with one_thread():
            pass
        assert threads() == ALONE


def test_one_that_leaves_before_another_leaves_it_alone():
    """As calls of two threads of a program do."""
    first = one_thread()
    second = one_thread()
    first.__enter__()
    second.__enter__()
    first.__exit__(None, None, None)
    assert threads() == ALONE
    second.__exit__(None, None, None)


def test_what_was_not_set_is_not_set_afterwards(monkeypatch):
    name = next(iter(SINGLE_THREADED))
    monkeypatch.delenv(name)
    with one_thread():
        assert os.environ[name] == "1"
    assert name not in os.environ
    monkeypatch.setenv(name, "3")


def counts(seen):
    def report(*_):
        seen.append(threads())
        raise SeenError

    return report


def test_an_estimate_a_diagnosis_and_a_vehicle_from_logs():
    log = imu_flight(VEHICLE, seconds=12.0, trajectory="hover")
    seen = []
    geometry = parse_geometry(str(VEHICLE.arm_l))
    for work in (
        lambda: estimate_log(log, VEHICLE, report=counts(seen)),
        lambda: diagnose([log], VEHICLE, report=counts(seen)),
        lambda: identify([log], VEHICLE.mass, geometry, report=counts(seen)),
    ):
        with pytest.raises(SeenError):
            work()
    assert seen == [ALONE] * 3


def test_every_command(tmp_path):
    seen = []

    def check(log: Path) -> dict:
        seen.append(threads())
        return {}

    log = tmp_path / "flight.csv"
    log.touch()
    as_command(check)(log=log, as_json=False, quiet=True)
    assert seen == [ALONE]
