"""The report of a diagnosis: strict numbers, a vehicle that loads again, and a page that a real
browser shows whole.
"""

import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from tests.support.alike import strict_json
from tests.support.browser import look, needs_browser
from tests.support.diagnoses import made_diagnosis, made_trace
from windwrench.dynamics import dump_vehicle
from windwrench.identification.findings import (
    Candidate,
    Disturbance,
    Errors,
    NamedEffect,
    Structure,
)
from windwrench.identification.report.files import write_report
from windwrench.identification.report.headline import headline
from windwrench.identification.report.words import rounded, with_std

DRAG = {"kdx": 2.4e-4, "kdy": 1.8e-4}
TRIED = ("rotor_drag", "body_drag", "mass", *(f"effect_{i}" for i in range(14)))


@pytest.fixture(scope="module")
def diagnosis():
    """A diagnosis that names rotor drag, of a flight of 20 s."""
    made = made_diagnosis(made_trace(20.0))
    (drag,) = made.effects
    unit = "N/(rad/s m/s)"
    std = {"kdx": 3e-6, "kdy": 4e-6}
    drag = replace(drag, coefficients=DRAG, std=std, units=dict.fromkeys(DRAG, unit))
    return replace(
        made,
        remainder="random",
        effects=(drag,),
        before=replace(made.before, nis_without_wrench_state=41.3),
        after=replace(made.after, rollout_1s_position_rms=math.nan),
        floor_force_rms=0.0123,
        floor_torque_rms=0.00094,
        advice=("Fly at 2 m/s and more along both body axes, to tell rotor drag from body drag.",),
        notes=("battery voltage falls from 11.1 to 10.9 V",),
        candidates=tuple(
            Candidate(name, 0.9 / (1 + i), name == "rotor_drag") for i, name in enumerate(TRIED)
        ),
        signatures=(made.signatures[0], replace(made.signatures[0], channel="Fy")),
        gusts=(Disturbance("Fx", 0.0153, 0.25), Disturbance("tau_z", 0.0004, 0.11)),
        seconds=20.0,
    )


def hard(diagnosis):
    """All that makes a page long, wide or wrong: many effects, several logs with rude names,
    missing numbers.
    """
    rude = (
        '<script>alert("1")</script> & ' + "a_very_long_name_without_a_single_space_" * 3 + "$x_{"
    )
    effects = [
        replace(diagnosis.effects[0], indistinguishable_from=("body_drag", "attitude_gain")),
        NamedEffect(
            "wind",
            {"wx": 1.234, "wy": -0.004, "wz": math.nan, "cd": 0.02},
            {"wx": 0.05, "wy": 0.3, "cd": 0.0},
            {"wx": "m/s", "wy": "m/s", "wz": "m/s", "cd": "N/(m/s)^2"},
            True,
            (),
            {},
        ),
        NamedEffect(
            "com_offset", {"cx": 0.00612}, {"cx": 0.0002}, {"cx": "m"}, False, (), {"share": 0.2}
        ),
    ]
    trace = diagnosis.traces[0]
    signature = diagnosis.signatures[0]
    return replace(
        diagnosis,
        verdict="partly explained",
        remainder="structured",
        effects=tuple(effects),
        logs=(rude, "second"),
        traces=(replace(trace, log=rude), replace(trace, log="second", before=3 * trace.before)),
        test_logs=("third",),
        held_out_segments=(*diagnosis.held_out_segments, ("second", 1.0, 2.5), (rude, 4.0, 5.0)),
        signatures=(
            *diagnosis.signatures,
            replace(
                signature, effect="wind", channel="tau_z", regressor=5 * "$x_{ <b>speed</b> (m/s) "
            ),
            replace(signature, effect="com_offset", fitted=0 * signature.fitted),
        ),
        after=Errors(math.nan, math.inf, math.nan, math.nan),
        notes=(rude,),
        candidates=(
            *diagnosis.candidates,
            *(Candidate(n, -0.4, n == "wind") for n in ("wind", "battery_sag")),
            Candidate("fan_jet", math.nan, False),
        ),
        structure=(
            Structure("a wave at 1.1 Hz", "Fx", 0.31),
            Structure("a dependence on height", "Fz over height", 0.084),
        ),
    )


@pytest.fixture(scope="module")
def reports(diagnosis, tmp_path_factory):
    """The diagnosis, plain and hard, with the paths of its report."""
    made = {"plain": diagnosis, "hard": hard(diagnosis)}
    folder = tmp_path_factory.mktemp("report") / "new"
    return {
        kind: (d, write_report(d, folder / kind, f"windwrench diagnose '{kind} log.csv'"))
        for kind, d in made.items()
    }


def test_the_numbers(reports):
    diagnosis, paths = reports["plain"]
    assert [p.name for p in paths] == ["report.json", "report.html", "vehicle.yaml"]
    assert set(paths[0].parent.iterdir()) == set(paths)
    data = strict_json(paths[0])
    first = "verdict remainder effects alternatives unknown error advice"
    assert " ".join(list(data)[:7]) == first
    assert (data["verdict"], data["remainder"]) == ("explained", "random")
    (effect,) = data["effects"]
    assert (effect["name"], effect["coefficients"]) == ("rotor_drag", DRAG)
    error = data["error"]
    assert set(error) == {"held_out_segments", "before", "after", "floor"}
    assert error["held_out_segments"] == [pytest.approx(s[1:]) for s in diagnosis.held_out_segments]
    assert error["before"]["force_rms_N"] == pytest.approx(diagnosis.before.force_rms, rel=1e-5)
    assert error["after"]["rollout_1s_position_rms_m"] is None
    assert error["floor"] == {"force_rms_N": 0.0123, "torque_rms_Nm": 0.00094}
    assert data["advice"] == list(diagnosis.advice)
    std = {e.name: e.std for e in diagnosis.effects}
    text = dump_vehicle(diagnosis.amended, std)
    assert paths[2].read_text(encoding="utf-8") == text
    made, (numbers, *_) = reports["hard"]
    blocks = strict_json(numbers)["error"]["held_out_by_log"]
    assert set(blocks) == {made.logs[0], "second", "flight"}
    assert blocks["second"] == [[1.0, 2.5]]


def test_names_that_are_no_text(diagnosis, tmp_path):
    numbers, html, _ = write_report(
        replace(diagnosis, logs=("log\udcff",)), tmp_path, command="windwrench diagnose log\udcff"
    )
    assert strict_json(numbers)["logs"] == ["log?"]
    assert "windwrench diagnose log?" in html.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (2.4312e-4, 3.14e-6, "(2.431 ± 0.031) × 10⁻⁴"),
        (1.2345, 0.05, "1.234 ± 0.050"),
        (-0.004, 0.3, "−0.00 ± 0.30"),
        (0.02, 0.0, "0.0200"),
        (0.02, math.nan, "0.0200"),
        (math.nan, 1.0, "–"),
        (123456.0, 1000.0, "(1.235 ± 0.010) × 10⁵"),
        (0.0, 1e-6, "(0.0 ± 1.0) × 10⁻⁶"),
        (0.0, 0.0, "0"),
        (5.0, 40.0, "5 ± 40"),
    ],
)
def test_a_coefficient_is_as_precise_as_it_is_known(value, std, text):
    assert with_std(value, std) == text


class Page(HTMLParser):
    """The tags of a page, and its text."""

    def __init__(self, text):
        super().__init__()
        self.tags = []
        self.words = []
        self.feed(text)
        self.text = " ".join(" ".join(self.words).split())

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data):
        self.words.append(data)


def test_the_page_stands_alone(reports):
    for _, (_, path, _) in reports.values():
        text = path.read_text(encoding="utf-8")
        page = Page(text)
        assert path.stat().st_size < 600_000
        assert not re.search(r"url\((?!#)|@import", text)
        for _, attrs in page.tags:
            for name in ("src", "href"):
                assert (attrs.get(name) or "#").startswith(("#", "data:"))
        ids = [attrs["id"] for _, attrs in page.tags if "id" in attrs]
        assert len(ids) == len(set(ids))


def test_the_page_says_it(reports):
    diagnosis, (_, path, _) = reports["plain"]
    page = Page(path.read_text("utf-8"))
    before, after = (rounded(1e3 * e.force_rms) for e in (diagnosis.before, diagnosis.after))
    assert (
        f"Held-out force error: {before} mN before, {after} mN after (noise floor 12.3 mN)."
        in page.text
    )
    kdx = with_std(diagnosis.effects[0].coefficients["kdx"], diagnosis.effects[0].std["kdx"])
    for words in (
        "The model lacks rotor drag up to 0.3614",
        kdx,
        "per rotor, along body x",
        "looks random",
        diagnosis.advice[0],
        diagnosis.notes[0],
        "windwrench diagnose 'plain log.csv'",
        "41.3",
        "20 s of flight",
    ):
        assert words in page.text


def test_doubts_stand_before_all_else(diagnosis, tmp_path):
    notes = ("flight: warning: pz stands still for 0.8 s", "flight: 2 gaps", "5 s are too few")
    made = replace(diagnosis, notes=notes, doubts={"short": notes[2:]})
    text = write_report(made, tmp_path)[1].read_text("utf-8")
    first, _, rest = text.partition('id="sure"')
    assert all(first.count(doubt) == 1 for doubt in (notes[0], notes[2]))
    assert [rest.count(note) for note in notes] == [0, 1, 0]


def test_nothing_to_draw(diagnosis, tmp_path):
    empty = ("effects", "traces", "signatures", "candidates", "advice", "notes")
    nothing = dict.fromkeys((*empty, "held_out_segments"), ())
    nothing |= {"verdict": "nothing to explain", "remainder": "none", "after": diagnosis.before}
    bare = replace(diagnosis, **nothing)
    page = Page(write_report(bare, tmp_path)[1].read_text("utf-8"))
    assert "The model explains these logs" in page.text
    assert "script" not in {tag for tag, _ in page.tags}


@needs_browser
class TestInABrowser:
    """What chromium makes of the page at the width of a telephone and of a desk."""

    @pytest.mark.parametrize(
        ("kind", "width", "scripts"),
        [
            ("hard", 1280, True),
            pytest.param("hard", 360, False, marks=pytest.mark.slow),
            pytest.param("plain", 390, True, marks=pytest.mark.slow),
        ],
    )
    def test_it_shows_whole(self, reports, tmp_path, kind, width, scripts):
        made, (_, path, _) = reports[kind]
        found = look(path.read_text("utf-8"), width, tmp_path, scripts=scripts)
        assert found["width"] == width
        assert found["scroll_width"] <= width
        assert found["wide"] == []
        assert found["complaints"] == []
        assert found["missing"] == []
        plots = 6 + 2 + len(made.signatures)
        assert len(found["pictures"]) == (plots if scripts else 0)
        assert all(p["alt"] and p["width"] > 250 and p["height"] > 100 for p in found["pictures"])
        heads = ("Held out\tBefore\tAfter", "Frequency (Hz)\tBefore", "without it\tEffect")
        assert all((head in found["text"]) != scripts for head in heads)  # tables stand open
        assert headline(made) in found["text"]
