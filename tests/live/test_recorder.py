"""Recordings: whole whenever they end, and the log that the live filter saw."""

import numpy as np

from tests.live.stream import Pipeline, flight
from tests.live.test_pipeline import VEHICLE, split, whole
from windwrench.identification.logs.reading import read_log
from windwrench.identification.wrench_series import estimate_log
from windwrench.live.recorder import Recorder
from windwrench.live.tallies import Tallies


def record(path, rows, close=True):
    recorder = Recorder(path, "ardrone2", Tallies(), 0.3)
    for row in rows:
        recorder.add(row)
    if close:
        recorder.end()
        recorder.close()
    return recorder


def test_a_recording_diagnosed_offline_is_what_was_seen_live(tmp_path):
    live = Pipeline().take(split(flight())[:700])
    recorder = record(tmp_path / "flight.csv", live.rows)
    log = read_log(recorder.path)
    assert (log.vehicle, len(log.t)) == ("ardrone2", recorder.rows)
    found = estimate_log(log, VEHICLE)
    np.testing.assert_allclose(
        live.wrench()[:, 1:], np.column_stack([found.force, found.torque]), atol=1e-9, rtol=0
    )


def test_late_rows_stand_where_they_belong(tmp_path):
    rows = Pipeline().take(whole(flight())[:600]).rows
    shuffled = rows.copy()
    shuffled[300], shuffled[330] = shuffled[330], shuffled[300]
    record(tmp_path / "a.csv", rows)
    record(tmp_path / "b.csv", shuffled)
    assert (tmp_path / "a.csv").read_text() == (tmp_path / "b.csv").read_text()


def test_a_recording_that_is_cut_anywhere_is_a_log_up_to_there(tmp_path):
    rows = Pipeline().take(whole(flight())[:800]).rows
    recorder = record(tmp_path / "flight.csv", rows, close=False)  # as if it had been killed
    whole_text = recorder.path.read_bytes()
    log = read_log(recorder.path)
    assert log.t[-1] > rows[-1].t - 1.0
    last = whole_text.rstrip().rfind(b"\n") + 1
    for cut in range(last, len(whole_text) + 1, 3):
        recorder.path.write_bytes(whole_text[:cut])
        again = read_log(recorder.path)
        assert len(again.t) in (len(log.t) - 1, len(log.t))
        np.testing.assert_array_equal(again.rotor_speeds, log.rotor_speeds[: len(again.t)])
        assert (len(again.t) < len(log.t)) == any("cut off" in note for note in again.notes) or (
            cut == last
        )


def test_nothing_is_written_of_a_stream_that_is_none(tmp_path):
    rows = Pipeline().take(whole(flight())[:150]).rows
    record(tmp_path / "flight.csv", rows, close=False)
    assert not list(tmp_path.iterdir())


def test_inertial_rows_between_poses(tmp_path):
    """A row of gyro and accelerometer alone has no pose, and reads back so."""
    flown = flight(4.0, "gentle", imu=True)
    samples = whole(flown)
    for k, sample in enumerate(samples):
        sample.gyro, sample.accelerometer = flown["gyro"][k], flown["accelerometer"][k]
        if k % 2:
            sample.position = sample.quaternion = None
    live = Pipeline().take(samples)
    recorder = record(tmp_path / "flight.csv", live.rows)
    log = read_log(recorder.path)
    assert log.valid.sum() == (len(log.t) + 1) // 2
    np.testing.assert_allclose(log.gyro, flown["gyro"])
    found = estimate_log(log, VEHICLE)
    np.testing.assert_allclose(live.wrench()[:, 1:4], found.force, atol=1e-9, rtol=0)
