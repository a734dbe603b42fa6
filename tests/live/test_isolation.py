"""Whatever fails or stalls beside a stream, its estimates go on: one line, and a count."""

import os
import pty
import resource
import select
import socket
import subprocess
import threading
from contextlib import ExitStack, contextmanager, suppress
from time import sleep

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.live.stream import Kept, Running, free_port
from tests.support.programs import started, until
from windwrench.identification.logs.reading import read_log
from windwrench.live.outlets import Outlet
from windwrench.live.outputs import Lines
from windwrench.live.recorder import Recorder
from windwrench.live.sources.simulated import Simulated
from windwrench.live.tallies import Tallies
from windwrench.live.web_view import WebView

ROWS = 601
STREAM = "sim:static?speed=0"


@contextmanager
def limited(size):
    """A disk on which no file grows beyond ``size`` bytes."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


def fly(**options):
    """A flight of 3 s, to its end; every estimate is there."""
    running = Running(STREAM, seconds=3.0, **options)
    running.thread.join()
    assert running.session.estimates == ROWS
    assert not running.failed
    return running


@pytest.fixture(scope="module")
def watched():
    """A flight that has ended."""
    return fly()


@pytest.fixture
def outputs(watched):
    return watched.outputs


def record(path, **options):
    return lambda tallies: Outlet(Recorder(path, "ardrone2", tallies, 0.3), tallies, **options)


@pytest.mark.parametrize("size", [40_000, 50])
def test_a_full_disk_ends_the_recording_and_not_the_estimates(tmp_path, size, outputs):
    path = tmp_path / "flight.csv"
    with limited(size):
        flown = fly(record=record(path))
    rows = flown.session.recording.sink.rows
    assert flown.tallies.counts == {"not recorded": ROWS - rows}
    (line,) = flown.tallies.news()
    assert f"the recording {path}: File too large; {rows} rows" in line
    assert path.exists() == bool(rows)
    if rows:
        assert_allclose(read_log(path).t, 0.005 * np.arange(rows))


def test_a_disk_that_stalls_costs_rows_and_no_estimate(tmp_path, monkeypatch, outputs):
    """What came after the queue was full is missing; what comes once it goes on is there."""
    path = tmp_path / "flight.csv"
    goes_on = threading.Event()
    write = os.write

    def stalling(descriptor, data):
        goes_on.wait()
        return write(descriptor, data)

    tallies = Tallies()
    outlet = record(path, waiting=100)(tallies)
    rows = [output.row for output in outputs]
    monkeypatch.setattr(os, "write", stalling)
    for row in rows[:500]:
        outlet.put(row)
    lost = tallies.counts["not recorded"]
    assert lost > 0
    (line,) = tallies.news()
    assert "stalls" in line
    goes_on.set()
    for row in rows[500:]:
        until(lambda: not outlet._held)
        outlet.put(row)
    outlet.close()
    log = read_log(path)
    assert len(log.t) == ROWS - lost
    assert log.t[-1] == pytest.approx(3.0)
    assert tallies.counts == {"not recorded": lost}


def test_a_reader_who_reads_nothing_stalls_nobody(outputs):
    """A pipe that nobody reads, to the end of the stream and beyond."""
    read, write = os.pipe()
    file = os.fdopen(write, "w")
    told = Outlet(Lines(file), tallies := Tallies())
    came = outputs * 20
    for output in came:
        told.put(output)
    told.close(0.01)
    assert tallies.counts["not told"] == len(came) - told.sink.rows
    assert ["stalls" in line for line in tallies.news()] == [True, True]
    os.close(read)  # the writer sees its end
    told._thread.join()
    with suppress(BrokenPipeError):
        file.close()


def test_a_terminal_that_stalls_costs_no_estimate(tmp_path):
    """Nobody reads on after the first page, as after Ctrl-S: the flight goes on to its end."""
    path = tmp_path / "flight.csv"
    terminal, end = pty.openpty()
    words = ("live", "sim:static", "--seconds", "5", "--record", path)
    child = started(*words, stdout=end, stderr=subprocess.PIPE)
    os.close(end)
    told = b""
    while b"status" not in told:
        told += os.read(terminal, 4096)
    until(lambda: path.exists() and path.read_text().count("\n") >= 1000, lambda _: sleep(0.05))
    assert child.poll() is None
    with suppress(OSError):  # of a terminal whose other end is closed
        while piece := os.read(terminal, 4096):
            told += piece
    os.close(terminal)
    assert child.wait() == 0, child.stderr.read()
    child.stderr.close()
    assert_allclose(read_log(path).t[-1], 5.0)


def test_a_pipe_that_is_closed_ends_the_telling_and_not_the_estimates(outputs):
    read, write = os.pipe()
    os.close(read)
    file = os.fdopen(write, "w")
    ended = threading.Event()
    tallies = Tallies()
    told = Outlet(Lines(file), tallies, ended.set)
    for output in outputs:
        told.put(output)
    told.close()
    assert ended.is_set()
    assert tallies.counts["not told"] == ROWS
    assert "standard output: Broken pipe; 0 rows" in tallies.news()[0]
    with pytest.raises(BrokenPipeError):
        file.close()


def fails():
    raise RuntimeError("no [/b] thanks\n")


def test_what_takes_the_estimates_may_raise_or_never_return():
    flown = fly(kept=Kept(fails))
    assert flown.tallies.counts == {"not told": ROWS - 1}  # not counted: the one that it failed at
    assert "RuntimeError: no [/b] thanks; 0 rows" in flown.tallies.news()[0]
    never = threading.Event()
    flown = Running(STREAM, seconds=3.0, kept=Kept(never.wait))
    flown.until(lambda: flown.session.ended)
    assert flown.session.estimates == ROWS
    never.set()
    flown.thread.join()


@pytest.mark.parametrize(
    ("part", "count"), [("decode", "not decoded"), ("read", "not read"), ("send", "not sent")]
)
def test_an_exception_of_a_source_costs_a_message(monkeypatch, part, count):
    works = getattr(Simulated, part)
    calls = []

    def sometimes(source, *arguments):
        calls.append(0)
        if len(calls) % 30 == 15:
            fails()
        return works(source, *arguments)

    monkeypatch.setattr(Simulated, part, sometimes)
    monkeypatch.setattr("windwrench.live.session._POLL", 0.0)
    running = Running(STREAM, seconds=3.0)
    running.thread.join()
    assert not running.failed
    assert running.outputs[-1].t == pytest.approx(3.0, abs=0.01)
    assert running.tallies.counts == {count: (len(calls) + 15) // 30}
    (line,) = running.tallies.news()
    assert "RuntimeError: no [/b] thanks; the stream goes on" in line


@pytest.fixture
def view(monkeypatch, watched):
    """A page that is impatient, with buffers that are small."""
    monkeypatch.setattr("windwrench.live.web_view._TIMEOUT", 0.5)
    monkeypatch.setattr("windwrench.live.web_view._EVERY", 0.01)
    view = WebView(watched.session, 0)
    view._socket.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)
    with view:
        yield view


def connected(view, stack, request=b""):
    one = stack.enter_context(socket.socket())
    one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    one.connect(view._socket.getsockname())
    one.sendall(request)
    return one


GET = b"GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n"


@pytest.mark.parametrize("request_", [b"", b"GET / HT", GET])
def test_connections_are_few_and_last_for_a_time(view, watched, request_):
    """Half open, or never read: 16 of 40 are held, none for ever, all by one thread."""
    counts = watched.tallies.counts
    threads = threading.active_count()
    turned = counts["turned away"]
    with ExitStack() as stack:
        some = [connected(view, stack, request_) for _ in range(40)]
        until(lambda: counts["turned away"] > turned)
        until(lambda: select.select(some[16:17], [], [], 0.0)[0])
        answer = some[16].recv(12)
        assert threading.active_count() == threads
        until(lambda: not view._open)
    assert answer == b"HTTP/1.1 503"
    assert counts["turned away"] == turned + 24
    assert (counts["not shown"] > 0) == (request_ == GET)
    counts["not shown"] = 0
    with ExitStack() as stack:  # and then there is room
        assert connected(view, stack, GET).recv(15) == b"HTTP/1.1 200 OK"


def test_a_page_that_fails_is_told_and_the_stream_goes_on(monkeypatch, watched):
    monkeypatch.setattr(WebView, "_look", lambda view: fails())
    view = WebView(watched.session, 0)
    with view:
        view._thread.join()
    assert "the page: RuntimeError" in watched.tallies.news()[-1]


def test_it_listens_to_this_machine_alone_unless_told_and_says_so():
    for kind, host in (("mavlink:udp", ""), ("mavlink:udpin", "0.0.0.0"), ("udp-json", "")):
        port = free_port()
        at = host or "127.0.0.1"
        running = Running(f"{kind}://{host}:{port}")
        running.until(lambda one=running: one.source.link.opened)
        assert running.source.link.opened.getsockname() == (at, port)
        running.end()
        assert running.tallies.news() == [f"listening at {at}:{port}, UDP"]
