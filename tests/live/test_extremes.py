"""Extreme messages of every source: none is an exception, and the estimates after them are finite.

1,000 of each in the suite; 20,000 of each with ``pytest tests/live/test_extremes.py -m slow``.
"""

import json
import math
import re
import struct
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.random import default_rng

from tests.live.stream import VEHICLE, as_objects, flight, send_odometry, send_rotors
from windwrench.live.filtering import LiveSettings
from windwrench.live.session import Session
from windwrench.live.sources.open import make_source
from windwrench.live.tallies import Tallies
from windwrench.live.terminal_page import page

NUMBERS = (
    *(0, 1, -1, 0.0, -0.0, 0.5, 1.0, -1.0, 376.0, 1e-300, 5e-324, 1e9, 1e18, 1e308, -1e308),
    *(2**31, 2**32 - 1, 2**63, -(2**63), 2**64 - 1, 10**400, math.nan, math.inf, -math.inf),
)
OTHERS = (None, True, "", "1", "NaN", [], [1.0], {}, {"t": 1}, "\x00", "é" * 50)
FAILURES = ("not decoded", "not read", "not estimated", "not sent")
COUNTS = (1_000, pytest.param(20_000, marks=pytest.mark.slow))
counts = pytest.mark.parametrize("count", COUNTS)


class Attacked:
    """A stream of which each good message is followed by nine that are extreme."""

    def __init__(self, text):
        self.source = make_source(text, VEHICLE, None, Tallies())
        self.session = Session(self.source, LiveSettings(wait=0.0, rate_hz=200.0))
        self.rng = default_rng(5)

    def any(self, values=NUMBERS):
        return values[self.rng.integers(len(values))]

    def run(self, count, good, extreme):
        """``good(k)`` and ``extreme()`` put a message where the source finds it."""
        rows = len(flight()["t"])
        for k in range(rows // 2):
            good(k)
            self.session._once()
        for k in range(count):
            extreme()
            self.session._once()
            if k % 9 == 0:
                good(rows // 2 + k // 9 % (rows // 2))
                self.session._once()
        counts = self.source.tallies.counts
        output = self.session.output
        assert not {name: counts[name] for name in FAILURES if counts[name]}, self.said()
        assert self.session.estimates > 100
        assert np.isfinite([*output.wrench, *output.std]).all()
        assert counts["malformed"] > 0
        page(self.session)

    def said(self):
        return self.source.tallies.news()


def changed(rng, data, share):
    """Return a message of which one byte is another, in a share of all cases."""
    data = bytearray(data)
    if rng.random() < share:
        data[rng.integers(len(data))] = rng.integers(256)
    return bytes(data)


class Link:
    """A link by which one piece of bytes comes at a time."""

    peer = sender = opened = "here"

    def __init__(self):
        self.pieces = []

    def open(self):
        return "here"

    def read(self, timeout):
        return self.pieces.pop(0) if self.pieces else None

    def write(self, data):
        pass

    def answer(self, sender):
        pass


@counts
def test_json(count):
    stream = Attacked("udp-json://:9?reply=1")
    stream.source.link = link = Link()
    good = as_objects(flight())

    def extreme():
        one = dict(good[stream.rng.integers(len(good))])
        for name in stream.rng.choice(list(one), stream.rng.integers(1, 5)):
            one[name] = stream.any(NUMBERS + OTHERS)
        text = json.dumps([one] * stream.rng.integers(1, 4) if stream.rng.random() < 0.2 else one)
        link.pieces.append(changed(stream.rng, text.encode(), 0.2))

    stream.run(count, lambda k: link.pieces.append(json.dumps(good[k]).encode()), extreme)


@pytest.mark.parametrize(
    "data",
    [b"[" + b"1," * 7000 + b"1]", b"[" + b'{"t":1},' * 64 + b"{}]", b"[" * 16_000, b"9" * 16_000],
)
def test_a_datagram_that_costs_much_is_malformed(data):
    stream = Attacked("udp-json://:9")
    stream.source.link = SimpleNamespace(read=lambda _: data, sender="")
    stream.source._understood = True
    stream.session._once()
    assert stream.source.tallies.counts == {"malformed": 64}
    (said,) = stream.said()
    assert "left out as malformed" in said


FLOATS = (0.0, -0.0, 0.5, 1.0, -1.0, 1e-45, 1e9, 3e38, -3e38, math.nan, math.inf, -math.inf)


@counts
def test_mavlink(count):
    """Every number of a message of every kind that is read, and bytes that were changed."""
    common = pytest.importorskip("pymavlink.dialects.v20.common")
    from windwrench.live.sources.esc_status import add_esc_status
    from windwrench.live.sources.mavlink_messages import MessageReader

    stream = Attacked("mavlink:udp://:9?pose=ODOMETRY&rate=50")
    stream.source.link = link = Link()
    stream.source.open()
    rng = stream.rng
    flown = flight()
    esc_status = add_esc_status(common)
    sender = common.MAVLink(SimpleNamespace(write=link.pieces.append), srcSystem=7)
    names = [*MessageReader(VEHICLE, "")._readers, "HEARTBEAT"]
    kinds = [one for one in common.mavlink_map.values() if one.msgname in names]

    def number(letter):
        if letter == "f":
            return stream.any(FLOATS)
        bits = 8 * struct.calcsize(letter)
        low = 0 if letter.isupper() else -(2 ** (bits - 1))
        return low + stream.any(
            (0, 1, 2 ** (bits - 1), 2**bits - 1, int(rng.integers(2**16)) % 2**bits)
        )

    def extreme():
        kind = stream.any(kinds)
        wire = kind.unpacker.format
        letters = [
            letter
            for times, letter in re.findall(r"(\d*)([a-zA-Z])", wire)
            for _ in range(int(times or 1))
        ]
        payload = struct.pack(wire, *map(number, letters))
        message = common.MAVLink_message(kind.id, kind.msgname)
        link.pieces.append(changed(rng, message._pack(sender, kind.crc_extra, payload), 0.1))

    def good(k):
        us = round(flown["t"][k] * 1e6)
        send_rotors(sender, esc_status, us, flown, k)
        send_odometry(sender, us, flown, k)
        link.pieces[:] = [b"".join(link.pieces)]

    stream.run(count, good, extreme)
