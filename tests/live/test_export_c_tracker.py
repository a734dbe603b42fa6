"""The tracker in C: the same commands as in Python, given the same random numbers."""

import numpy as np
import pytest

from tests.support.exported_c.compiled import CompiledFilter, needs
from tests.support.synthetic_wrench import TICKS, observations
from windwrench.controllers import Tracker
from windwrench.controllers.observation import FORCE_X, FORCE_Y, TORQUE_Z, VELOCITY_Y
from windwrench.dynamics import load_vehicle
from windwrench.estimator import UKFTuning
from windwrench.live.export_c import export_c, exportable_policy
from windwrench.live.export_c.tracker import PARTICLES, briefing_of

VEHICLE = load_vehicle("ardrone2")
BRIEFING = briefing_of(VEHICLE, UKFTuning.for_vehicle(VEHICLE, 0.005, 0.45), 0.005)
SEEDS = (2463534242, 1013904223, 362436069, 521288629, 88675123)


class Streams:
    """The random numbers of the C, a stream for each use, in the order in which Python asks."""

    def __init__(self):
        self.state = list(SEEDS)
        self.asked = 0  # uniform numbers since normal ones

    def _uniform(self, stream, count):
        out, x = np.empty(count), self.state[stream]
        for i in range(count):
            x ^= (x << 13) & 0xFFFFFFFF
            x ^= x >> 17
            x ^= (x << 5) & 0xFFFFFFFF
            out[i] = np.float32((x >> 9) + 0.5) / 2**23
        self.state[stream] = x
        return out

    def _normal(self, stream, count):
        u = self._uniform(stream, 2 * count).reshape(-1, 2)
        return np.sqrt(-2.0 * np.log(u[:, 0])) * np.cos(2.0 * np.pi * u[:, 1])

    def uniform(self, low, high, count):
        return low + (high - low) * self._uniform(0, count)

    def random(self, count=None):
        if count is None:
            return self._uniform(4, 1)[0]
        self.asked += 1
        return self._uniform(self.asked, count)

    def standard_normal(self, count):
        # of the drift, or once two kinds of uniform numbers are drawn, of fresh velocities
        stream, self.asked = (3, 0) if self.asked == 2 else (0, self.asked)
        return self._normal(stream, count)


class OwnTracker(Tracker):
    """The tracker with those numbers."""

    def _begin(self):
        self._rng = Streams()
        self._rng.asked = 1  # at first nothing jumps
        super()._begin()


@pytest.fixture(scope="module")
def c(tmp_path_factory):
    needs("gcc")
    policy = exportable_policy("tracker")
    exported = export_c(VEHICLE, "constant-gain", 200.0, 0.45, policy=policy)
    return CompiledFilter(exported, tmp_path_factory.mktemp("tracker"))


def commands(c, seen):
    """The commands (n,) of the C along observations (n, 8)."""
    c.c.ww_policy_init(c._policy)
    e, out = c.estimate, []
    for row in seen:
        e.torque[2], e.force[0], e.force[1] = row[TORQUE_Z], row[FORCE_X], row[FORCE_Y]
        e.velocity[1] = row[VELOCITY_Y]
        out.append(c.policy(e))
    return np.array(out)


def fans(count, decisions, rng):
    t = 0.005 * np.arange(decisions * TICKS)
    start, speed = rng.uniform(-0.3, 0.3, (count, 1)), rng.uniform(0.05, 0.35, (count, 1))
    return start + 0.8 * np.sin(speed / 0.8 * t)


def test_given_the_same_random_numbers_it_commands_the_same(c):
    rng = np.random.default_rng(1)
    seen = observations(fans(6, 60, rng), BRIEFING, rng)
    apart = []
    for one in seen.astype(np.float32):
        law = OwnTracker(particles=PARTICLES)
        law.brief(BRIEFING)
        law.reset()
        python = np.array([float(law(row)[0]) for row in one])
        assert np.ptp(python) > 0.2
        apart.append(np.abs(commands(c, one) - python))
    apart = np.array(apart)
    assert np.max(apart[:, :6]) < 1e-4
    # where rounding once draws another particle than Python does, commands go on a little apart
    assert np.sum(np.max(apart, axis=1) < 1e-3) >= 4
    assert np.max(apart) < 0.1
    # and it says how much memory it takes
    assert 90 * PARTICLES < c.policy_bytes < 110 * PARTICLES + 100
