"""JSON on standard input and in datagrams, and the simulated vehicle, through a session."""

import json
import socket

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from tests.live.stream import (
    VEHICLE,
    Running,
    as_lines,
    as_objects,
    flight,
    free_port,
    standard_input,
)
from tests.live.test_pipeline import offline
from windwrench.identification.logs.log_map import load_map
from windwrench.identification.logs.reading import read_log
from windwrench.live.field_map import FieldMap
from windwrench.live.messages import Malformed
from windwrench.live.sources.open import make_source
from windwrench.live.sources.senders import Senders
from windwrench.live.tallies import Tallies


def run_text(text, log_map=None, pieces=1):
    """Run a text from a pipe; return the stream that it was."""
    with standard_input(text, pieces):
        running = Running("-", log_map=log_map)
        running.thread.join()
    return running.end()


def test_lines_on_standard_input_are_the_log():
    """The pipe's pieces begin and end anywhere in a line."""
    stream = run_text(as_lines(flight()), pieces=977)
    assert_allclose(stream.wrench(), offline(flight()), atol=1e-9, rtol=0)
    assert stream.session.ended == "the source ended"
    assert not stream.tallies.counts


def test_a_file_on_standard_input_is_not_paced(tmp_path, monkeypatch):
    (tmp_path / "flight.jsonl").write_text(as_lines(flight()).rstrip())  # no end of the last line
    with (tmp_path / "flight.jsonl").open() as file:
        monkeypatch.setattr("sys.stdin", file)
        running = Running("-")
        running.thread.join()
    assert not running.source.paced
    assert len(running.outputs) == 1601


def test_fields_of_another_kind_by_their_map(tmp_path):
    """NED, degrees, rpm in PX4's order: field by field what the map makes of the whole table."""
    text = (
        "time_ms;N;E;D;roll;pitch;yaw;r1;r2;r3;r4;v\n"
        "1000;0.1;0.2;-1.5;1;-2;30;3000;3100;3200;3300;11.1\n"
        "1005;0.11;0.21;-1.51;2;-3;31;3010;3110;3210;3310;11.0\n"
        "1010;0.12;0.22;-1.52;3;-4;32;3020;3120;3220;3320;10.9\n"
    )
    (tmp_path / "map.yaml").write_text(
        "time: {column: time_ms, unit: ms, offset: 0}\nworld: ned\nbody: frd\n"
        "position: {columns: [N, E, D]}\n"
        "attitude: {columns: [roll, pitch, yaw], euler: zyx}\n"
        "rotors: {columns: [r1, r2, r3, r4], order: px4-x, unit: rpm}\nbattery: {column: v}\n"
    )
    wanted = load_map(tmp_path / "map.yaml")
    (tmp_path / "log.csv").write_text(text)
    log = read_log(tmp_path / "log.csv", map=tmp_path / "map.yaml")
    fields = FieldMap(wanted, VEHICLE, "here")
    header, *lines = text.splitlines()
    rows = [
        dict(zip(header.split(";"), map(float, line.split(";")), strict=True)) for line in lines
    ]
    for k, row in enumerate(rows):
        sample = fields.sample(row, 0)
        assert sample.stamp == round(log.t[k] * 1e9)
        assert_allclose(sample.position, log.position[k])
        sign = np.sign(sample.quaternion @ log.quaternion[k])
        assert_allclose(sign * sample.quaternion, log.quaternion[k], atol=1e-12)
        assert_allclose(sample.rotor_speeds, log.rotor_speeds[k])
        assert sample.voltage == log.voltage[k]
    assert run_text("\n".join(map(json.dumps, rows)), wanted).session.estimates == 3


@pytest.mark.parametrize("bad", [(500,), (0, 1, 2)])
def test_bad_lines_are_counted_wherever_they_stand(bad):
    lines = as_lines(flight()).splitlines()
    for k in bad:
        lines[k] = lines[k][:20]
    stream = run_text("\n\n".join(lines))  # empty lines are none
    assert not stream.failed
    assert stream.tallies.counts["malformed"] == len(bad)
    assert len(stream.outputs) == len(flight()["t"]) - len(bad)
    said = stream.tallies.news()
    assert len(said) == len(bad)
    assert "standard input: left out as malformed: b'{" in said[0]
    assert said[0].endswith("; expected a line of JSON")


def test_lines_without_a_good_one_are_refused_after_100():
    said = run_text(200 * "[1, 2]\n").failed[0]
    assert "standard input: all of the first 100 messages are malformed, the first: 1; exp" in said


class Sender(Running):
    """Sends datagrams to a session that listens, and reads its answers."""

    def __init__(self, **options):
        self.port = free_port()
        self.answers = []
        super().__init__(f"udp-json://127.0.0.1:{self.port}?reply=1", **options)
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.until(lambda: self.source.link.opened is not None)

    def send(self, value):
        data = value if isinstance(value, bytes) else json.dumps(value).encode()
        self.socket.sendto(data, ("127.0.0.1", self.port))

    def read(self):
        """What has come back, so that it does not wait in a buffer until that is full."""
        while True:
            try:
                self.answers.append(json.loads(self.socket.recv(4096, socket.MSG_DONTWAIT)))
            except BlockingIOError:
                return

    def end(self):
        super().end()
        self.read()
        self.socket.close()
        return self


def test_datagrams_with_faults_over_the_loopback():
    sender = Sender()
    sent = [one for one in as_objects(flight())[:500] if one["seq"] % 50 != 20]  # 10 are lost
    for k, one in enumerate(sent):
        sender.send(one)
        sender.taken("row", k + 1)
        sender.read()
    sender.send(sent[-1])  # once more
    sender.send(b'{"t": 1.0, "px": ')  # cut off
    sender.send({"t": 99.0, "px": 1.0, "py": 2.0})  # a field is missing
    sender.until(lambda: sender.tallies.counts["malformed"] == 2)
    answers = sender.end().answers
    assert not sender.failed
    assert dict(sender.tallies.counts) == {"lost": 10, "doubled": 1, "malformed": 2}
    assert len(sender.outputs) == len(answers) == len(sent)
    assert answers[-1]["fx"] == sender.outputs[-1].estimate.force[0]
    assert answers[-1]["status"] == "tracking"


def taken(senders, sender, seconds, *quantities):
    return senders.take(sender, quantities, round(seconds * 1e9))


def test_the_first_of_two_senders_of_the_same_is_taken_until_it_is_silent():
    tallies = Tallies()
    senders = Senders("port", tallies)
    for k in range(100):  # 100 Hz each
        assert taken(senders, "a", 0.01 * k, "position", "rotor_speeds")
        # the first could be a program that sends once from each address
        assert taken(senders, "b", 0.01 * k + 0.005, "position", "rotor_speeds") == (k < 1)
    assert tallies.counts == {"other senders": 99}
    assert not taken(senders, "b", 1.0, "voltage")  # nor anything else of it
    assert not taken(senders, "b", 2.5, "position")
    assert tallies.news() == [
        "warning: port: a and b send the same; a is listened to until it is silent for 2 s"
    ]
    assert taken(senders, "b", 3.1, "position")
    assert tallies.news() == ["warning: port: a is silent; b is listened to"]
    assert not taken(senders, "a", 3.2, "position")


def test_senders_of_different_quantities_join():
    tallies = Tallies()
    senders = Senders("port", tallies)
    for k in range(300):
        assert taken(senders, "camera", 0.01 * k, "position")
        assert taken(senders, "autopilot", 0.01 * k, "rotor_speeds")
    assert not tallies.counts
    assert not tallies.news()


def test_of_two_vehicles_whose_messages_alternate_one_is_taken_whole():
    """The second's rotor speeds come before the first's: they are not joined with its poses."""
    senders = Senders("port", Tallies())
    order = [("a", "position"), ("b", "rotor_speeds"), ("b", "position"), ("a", "rotor_speeds")]
    found = [(who, taken(senders, who, 0.01 * k, what)) for k in range(50) for who, what in order]
    assert len({who for who, is_taken in found[8:] if is_taken}) == 1
    assert sum(is_taken for _, is_taken in found) >= 98


def test_a_socket_for_each_message_is_one_sender():
    tallies = Tallies()
    senders = Senders("port", tallies)
    assert all(taken(senders, f"address {k}", 0.01 * k, "position") for k in range(1000))
    assert not tallies.news()
    assert len(senders._last) == 1


def test_two_senders_on_one_port_are_told_by_their_addresses():
    sender = Sender()
    flown = as_objects(flight())
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        for k, one in enumerate(flown[:100]):
            sender.send(one)
            sender.taken("row", k + 1)
            if k > 10:  # another vehicle, 5 m away
                away = json.dumps(one | {"px": one["px"] + 5.0}).encode()
                other.sendto(away, ("127.0.0.1", sender.port))
        sender.until(lambda: sender.tallies.counts["other senders"] == 89)
        addresses = [f"127.0.0.1:{one.getsockname()[1]}" for one in (sender.socket, other)]
        with pytest.raises(BlockingIOError):  # nothing is answered to it
            other.recv(4096, socket.MSG_DONTWAIT)
    assert len(sender.end().answers) == len(sender.outputs) == 100
    assert (
        f"{addresses[0]} and {addresses[1]} send the same; {addresses[0]} is listened"
        in (sender.tallies.news()[-1])
    )
    assert max(abs(o.estimate.position[0]) for o in sender.outputs) < 1.0


@pytest.mark.parametrize(
    ("wraps", "numbers"), [(0, (7, 8, 12, 10, 12)), (256, (254, 255, 3, 1, 3))]
)
def test_what_is_missing_in_a_senders_count_is_lost_unless_it_was_late(wraps, numbers):
    source = make_source("sim:base", VEHICLE, None, Tallies())
    lost = []
    for number in numbers:
        source.count_lost("sender", number, wraps)
        lost.append(source.tallies.counts["lost"])
    assert lost == [0, 0, 3, 2, 2]


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ("", "no message came before it ended; expected lines of JSON with t, px"),
        (as_lines(flight()).splitlines()[0], "row came, which is no estimate yet"),
        ("t,px,py\n1,2,3\n", "the first: b't,px,py'; expected a line of JSON"),
        (b"\x00\x01\x02" * 50_000, "a line of more than 16384 bytes"),
        (b"hello", "expected a line of JSON"),
        (b"[1, 2]", "1; expected an object"),
        (b"null", "null; expected an object"),
        (b"[]", "[]; expected an object"),
        (b"NaN", "NaN; expected an object"),
        (b"{}", "none of the fields"),
        (b'{"t": NaN, "px": 1}', "nan; expected a time"),
        (b'{"t": {"s": [1]}, "px": 1}', "expected a time"),
        (b'{"t": 1, "px": "\xff\xfe"}', "expected a line of JSON"),
        (b'{"t": 1, "\\ud800": 1}', "none of the fields"),
        (b'{"t": 1, "px": 1, "py": 2}', "no field pz"),
        (b'{"t": "soon", "px": 1}', "expected a time"),
        (
            b'{"t": 1, "omega1": "fast", "omega2": 1, "omega3": 1, "omega4": 1}',
            "expected a number",
        ),
        (b'{"px":1,"py":1,"pz":1,"qw":2,"qx":0,"qy":0,"qz":0}', "length 2; exp"),
        (b"[" * 5000, "expected a line of JSON"),
    ],
)
def test_what_is_no_json_is_refused(data, said):
    assert said in run_text(data).failed[0]


@pytest.mark.parametrize("data", [b"null", b"hello", b'{"t": 1}'])
def test_a_bad_datagram_at_the_beginning_is_counted(data):
    sender = Sender()
    sender.send(data)
    for k, one in enumerate(as_objects(flight())[:50]):
        sender.send(one)
        sender.taken("row", k + 1)
    assert not sender.end().failed
    assert sender.tallies.counts == {"malformed": 1}
    assert len(sender.outputs) == 50
    assert "left out as malformed" in sender.tallies.news()[-1]


def test_where_nothing_good_comes_the_error_says_what_came():
    sender = Sender()
    sender.send(b"null")
    sender.until(lambda: sender.tallies.counts["malformed"])
    said = str(sender.session._nothing("within 1 s"))
    assert "no good message came within 1 s; 1 malformed, the first: null; expected an" in said
    sender.end()


def test_a_source_that_says_nothing_and_a_second_one_at_its_address_end():
    said = "no message came within 0.2 s; expected datagrams of JSON"
    assert said in Sender(wait=0.2).end_by_itself()
    sender = Sender()
    assert "cannot listen" in Running(f"udp-json://127.0.0.1:{sender.port}").end_by_itself()
    sender.end()


def test_commands_beyond_their_range_are_no_commands():
    fields = FieldMap(load_map("cflib"), VEHICLE, "here")
    with pytest.raises(Malformed, match="expected 0 to 65535"):
        fields.sample({"timestamp": 1} | {f"motor.m{i}": 7e4 for i in range(1, 5)}, 0)


def test_the_simulated_vehicle_feels_the_jet():
    """At its true wrench, as a scenario's flight has it; the same seed flies the same."""
    flights = [Running("sim:static?seed=3&speed=0", seconds=6.0) for _ in range(2)]
    for one in flights:
        one.thread.join()
    force = flights[0].wrench()[:, 1:4]
    assert_array_equal(force, flights[1].wrench()[:, 1:4])
    truth = np.array([o.row.force for o in flights[0].outputs])
    assert truth[600:, 0].mean() > 0.2
    # the filter follows with 1 s, and has come from nothing
    assert_allclose(force[900:].mean(axis=0), truth[900:].mean(axis=0), atol=0.1)
