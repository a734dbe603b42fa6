"""The plots that a report's script draws: their numbers, their library, and what they do in a
browser.
"""

import base64
import hashlib
import html
import json
import re
from dataclasses import replace
from importlib import resources
from pathlib import Path

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_array_equal

from tests.support.browser import look, needs_browser
from tests.support.diagnoses import made_diagnosis, made_trace
from windwrench.identification.findings import CHANNELS
from windwrench.identification.report import log_channels
from windwrench.identification.report.files import write_report
from windwrench.identification.report.page import report_page
from windwrench.identification.report.plot_numbers import page_plots, telling_samples
from windwrench.identification.report.words import error_table, rounded

UPLOT = {
    "uPlot.iife.min.js": "19c8d4c6ad88929a79f4ae49d6f7161566dfd0ba3d15cc495e974f787eb78f1f",
    "uPlot.min.css": "df630c6a8d6f8eeaff264b50f73ce5b114f646ffd9a0bb74f049b0a00135fa04",
    "LICENSE": "8f989229699b4fe2f1a0432d0e9edc338a8a911e250e2d1b01ecd770a5f5b1bd",
}


FACTORS = {"N": 1.0, "Nm": 1.0, "mN": 1e3, "mNm": 1e3}


def unpacked(series):
    integers = np.frombuffer(base64.b64decode(series["data"]), "<i2")
    return series["scale"] * integers


def times(channel, pieces):
    steps = np.frombuffer(base64.b64decode(channel["steps"]), "<u2")
    each = np.split(steps, np.cumsum(channel["counts"])[:-1])
    return np.concatenate(
        [p["x"] + channel["tick"] * np.cumsum(s) for p, s in zip(pieces, each, strict=True)]
    )


def test_a_flight_of_a_minute_is_carried_whole():
    trace = made_trace(effects=("rotor_drag", "wind"))
    time = page_plots(made_diagnosis(trace)).data["time"]
    assert time["effects"] == ["rotor_drag", "wind"]
    for i, channel in enumerate(time["channels"]):
        factor = FACTORS[channel["unit"]]
        assert abs(times(channel, time["pieces"]) - trace.t).max() < 1e-4
        series = [channel["before"], channel["after"], *channel["parts"]]
        truth = [trace.before, trace.after, *(trace.parts[name] for name in time["effects"])]
        for packed, x in zip(series, truth, strict=True):
            x = factor * x[:, i]
            assert (packed is None) == (not x.any())
            assert packed is None or abs(unpacked(packed) - x).max() <= 1e-4 * np.abs(x).max()


SPIKES = (("before", 12_345, 0, 7.0), ("before", 100_001, 4, -8.0), ("after", 170_000, 2, 9.0))


def test_a_spike_of_any_channel_stays():
    trace = made_trace(seconds=900.0, rate=200.0)
    for side, row, i, size in SPIKES:
        getattr(trace, side)[row, i] = size
    plots = page_plots(made_diagnosis(trace)).time
    for side, _, i, size in SPIKES:
        channel = plots[i].packed
        drawn = FACTORS[channel["unit"]] * size
        assert abs(unpacked(channel[side]) - drawn).min() <= 1e-4 * abs(drawn)


def test_the_rms_of_any_choice_of_effects_is_exact():
    trace = made_trace(effects=("rotor_drag", "wind", "mass"))
    channel = page_plots(made_diagnosis(trace)).data["time"]["channels"][1]
    for chosen in ((), ("wind",), ("rotor_drag", "mass"), ("rotor_drag", "wind", "mass")):
        weight = np.array([1.0, *(name in chosen for name in trace.parts)])
        rms = np.sqrt(weight @ np.array(channel["products"]) @ weight)
        x = trace.after[:, 1] + sum((trace.parts[name][:, 1] for name in chosen), 0.0)
        assert rms == pytest.approx(np.sqrt(np.mean(x**2)), rel=1e-3)


def test_a_page_of_a_minute_is_below_600_kb(tmp_path):
    """Of noise, which nothing makes smaller, at four times the rate of a residual."""
    made = made_diagnosis(made_trace(effects=tuple("abcdef"), rate=100.0))
    assert write_report(made, tmp_path)[1].stat().st_size < 600_000


def test_pieces_of_several_logs_stand_side_by_side():
    traces = [made_trace(20.0, seed=i, log=f"log {i}") for i in range(3)]
    time = page_plots(made_diagnosis(*traces)).data["time"]
    assert [p["log"] for p in time["pieces"]] == ["log 0", "log 1", "log 2"]
    x = times(time["channels"][0], time["pieces"])
    assert (np.diff(x) > 0).all()
    assert x[-1] == pytest.approx(time["end"], abs=1e-3)
    assert len(time["held"]) == 2 * 3
    (plot, *_) = page_plots(made_diagnosis(*traces)).time
    assert plot.table.head == ("Piece", "Time (s)", "Held out", "Before", "After")


def test_only_the_pages_own_scripts_may_run():
    rude = "</script><script>alert(1)</script>\u2028"
    page = report_page(made_diagnosis(replace(made_trace(), log=rude)), "command")
    scripts = re.findall(r"<script[^>]*>(.*?)</script>", page, re.S)
    assert len(scripts) == 3
    assert json.loads(scripts[0])["time"]["pieces"][0]["log"] == rude
    (policy,) = map(html.unescape, re.findall(r'Policy" content="([^"]*)"', page))
    hashes = {
        f"'sha256-{base64.b64encode(hashlib.sha256(s.encode()).digest()).decode()}'"
        for s in scripts[1:]
    }
    assert set(re.findall(r"script-src ([^;]*)", policy)[0].split()) == hashes
    assert "default-src 'none'" in policy
    assert "http" not in policy


def test_the_library_is_as_it_was_published():
    folder = resources.files("windwrench.identification.report").joinpath("uplot")
    found = {name: hashlib.sha256(folder.joinpath(name).read_bytes()).hexdigest() for name in UPLOT}
    assert found == UPLOT
    page = report_page(made_diagnosis(), "command")
    assert "Copyright (c) 2022 Leon Sorokin" in page
    assert "uPlot (v1.6.32)" in page


def test_a_torque_that_the_logs_do_not_tell_is_not_drawn():
    trace = made_trace()
    trace.before[:, 3:] = trace.after[:, 3:] = 0.0
    made = made_diagnosis(trace)
    plots = page_plots(made)
    keys = [plot.packed["key"] for plot in (*plots.time, *plots.frequency)]
    assert keys == ["time-Fx", "time-Fy", "time-Fz", "frequency-force"]
    torque = error_table(made)[1]
    assert (torque["before"], torque["after"], torque["floor"]) == ("–", "–", "")
    page = report_page(made, "command")
    assert 'id="plot-time-Fz"' in page
    assert "plot-time-tau_x" not in page


ACT = Path(__file__).with_name("act.js").read_text(encoding="utf-8")


@needs_browser
@pytest.mark.parametrize(
    ("width", "dark"), [(390, True), pytest.param(1280, False, marks=pytest.mark.slow)]
)
def test_keys_zoom_and_switches_in_a_browser(tmp_path, width, dark):
    trace = made_trace(effects=("rotor_drag", "wind"))
    made = made_diagnosis(trace)
    found = look(report_page(made, "command"), width, tmp_path, dark=dark, act=ACT)
    assert found["complaints"] == []
    assert found["wide"] == []
    assert (sum(map(int, re.findall(r"\d+", found["background"])[:3])) < 200) == dark
    done = found["done"]
    rms = [np.sqrt(np.mean(x[:, 0] ** 2)) for x in (trace.before, trace.after)]
    old, new = (rounded(x, 2) for x in rms)
    assert done["idle"][0] == f"rms {old} → {new} N"
    # one cursor: a key on one plot, the values of all six at the same time
    seconds = {re.search(r"t = ([\d.]+) s", text)[1] for text in done["linked"]}
    assert len(seconds) == 1
    i = int(np.argmin(abs(trace.t - float(seconds.pop()))))
    for k, text in enumerate(done["linked"]):
        told = re.findall(r"(?:before|after) (−?[\d.]+)", text)
        values = [float(value.replace("−", "-")) for value in told]
        scale = 1e3 if text.split()[-1].startswith("mN") else 1.0
        truth = [scale * trace.before[i, k], scale * trace.after[i, k]]
        assert values == pytest.approx(truth, rel=6e-3, abs=scale * 1e-5), CHANNELS[k]
    assert done["announced"].startswith("Fx: t = ")
    # zoomed twice about the cursor, all plots begin later; Escape shows the whole flight again
    begins = {float(re.search(r"t = ([\d.]+) s", text)[1]) for text in done["zoomed"]}
    assert len(begins) == 1
    assert begins.pop() > trace.t[0] + 10.0
    assert f"t = {trace.t[0]:.2f} s" in done["whole"]
    # without rotor_drag, "after" grows by its share
    left = np.sqrt(np.mean((trace.after + trace.parts["rotor_drag"])[:, 0] ** 2))
    assert done["without"].split(" → ")[1] == f"{rounded(left, 2)} N"
    assert re.search(r"residual|effect|mean", done["signature"])
    assert " Hz: before " in done["frequency"]
    # every stop of the keyboard has a name, and every plot a table
    assert done["unnamed"] == []
    assert done["plots"] == 6 + 2 + 2
    assert done["tables"] == 6 + 2 + 2
    assert done["first"] < 900  # pixels: the answers fit a telephone's first screen


@needs_browser
@pytest.mark.slow  # of a minute it is quick
def test_cursors_over_a_long_flight_say_one_time(tmp_path):
    trace = made_trace(400.0)  # of which each channel keeps other samples
    act = ACT.split('  await key("time-Fx", "Escape"')[0] + "  return out;"
    done = look(report_page(made_diagnosis(trace), "command"), 1280, tmp_path, act=act)["done"]
    for texts in (done["linked"], done["zoomed"]):
        assert len({text.split(":")[0] for text in texts}) == 1


def test_a_line_of_many_rows_is_drawn_by_its_extremes():
    rows = 1_000_003
    values = default_rng(1).normal(size=(rows, 2))
    values[777_777, 0], values[rows - 1, 1] = 50.0, -50.0
    shown = telling_samples(values, log_channels._BINS)
    assert (np.diff(shown) > 0).all()
    assert {0, 777_777, rows - 1} <= set(shown.tolist())
    assert len(shown) < 5 * log_channels._BINS
    few = values[: 2 * log_channels._BINS]
    assert_array_equal(few[telling_samples(few, log_channels._BINS)], few)
