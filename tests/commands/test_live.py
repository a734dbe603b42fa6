"""``live``: what it prints, records, serves and refuses; ended by its user, and killed."""

import json
import signal
import subprocess
import threading
import urllib.error
import urllib.request
from io import StringIO

import numpy as np
import pytest
from numpy.testing import assert_allclose

from tests.live.stream import Running, as_lines, flight
from tests.live.test_pipeline import offline
from tests.support.browser import browse, needs_browser
from tests.support.outcomes import refused
from tests.support.programs import started, until
from windwrench.cli import app
from windwrench.identification.logs.reading import read_log
from windwrench.live.terminal_page import page
from windwrench.live.web_view import WebView


def run(capsys, *arguments):
    app(["live", *map(str, arguments)], standalone_mode=False)
    return capsys.readouterr()


def test_the_simulated_vehicle_prints_records_and_sums_up(tmp_path, capsys):
    log = tmp_path / "flight.csv"
    said = run(capsys, "sim:static?speed=0", "--seconds", "3", "--record", log)
    lines = said.out.splitlines()
    assert lines[0].startswith("t,fx,fy,fz,tx,ty,tz,std_fx")
    found = np.array([line.split(",") for line in lines[1:]], dtype=float)
    assert found[-1, 0] == pytest.approx(3.0)
    assert "601 estimates over 3.0 s" in said.err
    recorded = read_log(log)
    assert (recorded.vehicle, len(recorded.t)) == ("ardrone2", 601)
    assert recorded.force is not None


@pytest.mark.slow
def test_a_flight_is_diagnosed_when_it_lands(tmp_path, capsys):
    out = run(
        capsys, "sim:base?speed=0", "--seconds", "12", "--record", tmp_path / "flight.csv",
        "--diagnose-after", "--out", tmp_path / "found", "--json",
    )  # fmt: skip
    assert json.loads(out.out)["result"]["diagnosis"]["verdict"]
    assert (tmp_path / "found" / "report.json").exists()


def test_an_address_is_printed_as_it_is(capsys):
    """Not as a picture: ``:radio:`` is the name of one."""
    from windwrench.commands.terminal import errors

    errors.print("mavlink:radio://0/80/2M", markup=False)
    assert "mavlink:radio://0/80" in capsys.readouterr().err


@pytest.fixture(scope="module")
def watched():
    """A flight of 2 s that was watched."""
    running = Running("sim:base?speed=0", seconds=2.0)
    running.thread.join()
    return running.session


def test_the_terminal_page_shows_what_there_is(watched):
    from rich.console import Console

    out = Console(file=StringIO(), width=100)
    out.print(page(watched))
    text = out.file.getvalue()
    for word in ("force (N)", "torque (mNm)", "+-", "status", "rates", "row", "dropped", "nothing"):
        assert word in text


def test_the_page_in_a_browser_is_served_here_alone(watched):
    with WebView(watched, 0) as view:
        assert view.address.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(view.address) as answer:
            text = answer.read().decode()
            assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        assert "http://" not in text
        assert "https://" not in text
        with urllib.request.urlopen(view.address + "events") as answer:
            event = json.loads(answer.readline().removeprefix(b"data: "))
        assert event["vehicle"] == "ardrone2"
        assert len(event["points"]) == 101  # 50 a second
        assert event["points"][-1][0] == 2.0
        other = urllib.request.Request(view.address, headers={"Host": "evil.example"})
        with pytest.raises(urllib.error.HTTPError, match="403"):
            urllib.request.urlopen(other)
        with refused("--port"):
            WebView(watched, int(view.address.rpartition(":")[2].strip("/")))


@pytest.mark.slow
@needs_browser
def test_the_page_in_a_real_browser(watched, tmp_path):
    with WebView(watched, 0) as view:
        threading.Timer(15.0, view._over.set).start()  # the page is done
        shown = browse(view.address, tmp_path)
    assert "sim:base?speed=0, ardrone2" in shown.stdout
    assert "rates: row" in shown.stdout
    assert "finished: 2 s have passed" in shown.stdout
    assert not [line for line in shown.stderr.splitlines() if "CONSOLE" in line]


@pytest.mark.parametrize(
    ("sent", "taken", "code", "word"),
    [
        (signal.SIGINT, signal.default_int_handler, 130, "interrupted"),
        (signal.SIGTERM, signal.SIG_IGN, 143, "terminated"),  # interrupts are ignored, as by nohup
    ],
)
def test_its_user_or_its_system_ends_it_and_loses_nothing(tmp_path, sent, taken, code, word):
    """It has been fed 700 rows of a flight, and has printed as many estimates."""
    log = tmp_path / "flight.csv"
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    running = started(
        *("live", "-", "--vehicle", "ardrone2", "--record", log),
        preexec_fn=lambda: signal.signal(signal.SIGINT, taken),
        **pipes,
    )
    lines = []
    reader = threading.Thread(target=lambda: lines.extend(running.stdout))
    reader.start()
    fed = as_lines(flight()).splitlines(keepends=True)[:700]
    running.stdin.write("".join(fed).encode())
    running.stdin.flush()
    until(lambda: len(lines) > len(fed) or running.poll() is not None)
    running.send_signal(sent)
    said = running.stderr.read().decode()
    assert running.wait() == code
    reader.join()
    assert "700 estimates over 3.5 s" in said
    assert said.rstrip().endswith(word)
    found = np.array([line.split(b",")[:7] for line in lines[1:]], dtype=float)
    assert_allclose(found, offline(flight())[:700], atol=1e-9, rtol=0)
    assert len(read_log(log).t) == 700
