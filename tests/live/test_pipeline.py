"""From messages to estimates: equal to the offline filter, what faults of a link do to them, and
recordings, which are whole whenever they end.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.live.stream import VEHICLE, Pipeline, flight, log_of
from windwrench.dynamics import EffectSetting
from windwrench.envs.recording import record_flight
from windwrench.identification.logs.reading import read_log
from windwrench.identification.wrench_series import estimate_log, tune_to_log
from windwrench.live.messages import Measurement
from windwrench.live.recorder import Recorder
from windwrench.live.tallies import Tallies
from windwrench.live.terminal_page import tuning_words

SECOND = 1_000_000_000


def whole(flown, drift=0.0):
    """Each row as one message: stamped by a clock that begins at 0, on its way for 10 ms."""
    return [
        Measurement(
            "row",
            round(t * SECOND),
            round((100.01 + (1.0 - drift) * t) * SECOND),
            whole=True,
            position=flown["position"][k],
            quaternion=flown["quaternion"][k],
            rotor_speeds=flown["rotor_speeds"][k],
            voltage=float(flown["voltage"][k]),
        )
        for k, t in enumerate(flown["t"])
    ]


def split(flown):
    """Rotor speeds at 200 Hz, poses at 100 Hz, by arrival."""
    samples = []
    for k, t in enumerate(flown["t"]):
        speeds = flown["rotor_speeds"][k]
        arrival = round((50.0 + t + 0.004) * SECOND)
        samples.append(Measurement("esc", round(t * SECOND), arrival, rotor_speeds=speeds))
        if k % 2 == 0:
            samples.append(
                Measurement(
                    "pose",
                    round(t * SECOND),
                    round((50.0 + t + 0.01) * SECOND),
                    position=flown["position"][k],
                    quaternion=flown["quaternion"][k],
                )
            )
    return sorted(samples, key=lambda sample: sample.arrival)


def offline(flown):
    found = estimate_log(log_of(flown), VEHICLE)
    return np.column_stack([found.t, found.force, found.torque])


def test_a_tuning_that_is_too_slow_is_told_with_what_to_do():
    """A drag on fast waves: the default tuning is late, and one fitted to the flight less so; the
    figures are those of the log.
    """
    drag = EffectSetting("rotor_drag", {"kdx": 1.2e-4, "kdy": 1.2e-4})
    flown = record_flight(VEHICLE, (drag,), "fast", 12.0)
    fit = tune_to_log(log_of(flown), VEHICLE)
    found = {}
    for tuning in (None, fit.tuning):
        live = Pipeline(tuning=tuning).take(whole(flown))
        found[tuning is None] = live.tallies.consistency
    assert found[True].too_slow
    assert "--tuning" in tuning_words(found[True])
    assert found[True].nis == pytest.approx(fit.before.nis, rel=0.05)
    assert found[False].nis == pytest.approx(fit.after.nis, rel=0.05)
    assert found[False].nis_over_second < 0.3 * found[True].nis_over_second


def test_a_clock_that_drifts_changes_nothing_and_is_told():
    flown = flight(15.0, "gentle")
    live = Pipeline().take(whole(flown, drift=-5e-4))
    assert_allclose(live.wrench(), offline(flown), atol=1e-9, rtol=0)
    assert live.session.clocks.drift == pytest.approx(-500.0, rel=0.1)


def one_from_the_future(samples):
    samples[300].stamp += 3600 * SECOND
    return samples


@pytest.mark.parametrize(
    ("fault", "counts"),
    [
        (lambda samples: [*samples[:200], *samples[201:], samples[200]], {"too late": 1}),
        (one_from_the_future, {"implausible times": 1}),
        (lambda samples: [s for s in samples if not 3.0 < 1e-9 * s.stamp < 5.0], {}),
        (lambda samples: [*samples[:600], *samples[600::5]], {}),
    ],
    ids=["one too late", "one from the future", "silent for 2 s", "slower from 3 s on"],
)
def test_a_fault_of_the_stream_is_counted_and_the_force_is_right_after_it(fault, counts):
    flown = flight()
    samples = fault(whole(flown))
    live = Pipeline().take(samples)
    assert live.tallies.counts == counts
    assert len(live.outputs) == len(samples) - sum(counts.values())
    assert live.outputs[-1].t == pytest.approx(8.0, abs=0.03)
    assert {o.estimate.status for o in live.outputs if o.t > 5.5} == {"tracking"}
    found = np.mean([o.estimate.force for o in live.outputs if o.t > 7.0], axis=0)
    assert abs(found - flown["force"][1400:].mean(axis=0)).max() < 0.1


def test_measured_rotor_speeds_are_waited_for():
    """Commands that come first are left alone where an ESC reports soon after."""
    flown = flight()
    samples = []
    for sample in split(flown)[:900]:
        if sample.kind == "esc":
            command = Measurement("servo", sample.stamp, sample.arrival, command=np.full(4, 0.5))
            samples += [command] if 1e-9 * sample.stamp < 0.5 else [command, sample]
        else:
            samples.append(sample)
    live = Pipeline().take(samples)
    assert live.rows
    assert not any(row.commanded for row in live.rows)
    assert live.tallies.counts["waiting"] > 0


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
    assert_allclose(
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
    rows = Pipeline().take(whole(flight())[:400]).rows
    recorder = record(tmp_path / "flight.csv", rows, close=False)  # as if it had been killed
    whole_text = recorder.path.read_bytes()
    log = read_log(recorder.path)
    assert log.t[-1] > rows[-1].t - 1.0
    last = whole_text.rstrip().rfind(b"\n") + 1
    for cut in range(last, len(whole_text) + 1, 17):
        recorder.path.write_bytes(whole_text[:cut])
        again = read_log(recorder.path)
        assert len(again.t) in (len(log.t) - 1, len(log.t))
        assert_array_equal(again.rotor_speeds, log.rotor_speeds[: len(again.t)])
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
        sample.gyro = flown["gyro"][k]
        sample.accelerometer = flown["accelerometer"][k]
        if k % 2:
            sample.position = sample.quaternion = None
    live = Pipeline().take(samples)
    log = read_log(record(tmp_path / "flight.csv", live.rows).path)
    assert log.valid.sum() == (len(log.t) + 1) // 2
    assert_allclose(log.gyro, flown["gyro"])
    found = estimate_log(log, VEHICLE)
    assert_allclose(live.wrench()[:, 1:4], found.force, atol=1e-9, rtol=0)
