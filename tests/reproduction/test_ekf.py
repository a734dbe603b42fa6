"""The extended filter against the literal one."""

import numpy as np

from tests.support.flights import PERIOD, begin, fly, yawing_flight
from tests.support.model_flights import ANISOTROPIC
from tests.support.reference_filters import as_reference, initial_covariance
from tests.support.vehicles import VEHICLE
from windwrench.estimator.reference import ReferenceUKF, difference, displaced
from windwrench.reproduction import WrenchEKF


class Literal(ReferenceUKF):
    """F and B by central differences of the paper's model, P = F P F' + B Q B'."""

    def predict(self, rotor_speeds):
        steps = 1e-6 * np.vstack([np.zeros(30), np.eye(30), -np.eye(30)])
        points = displaced(self.state, steps[:, :18])
        after = self.process(points, steps[:, 18:], np.asarray(rotor_speeds))
        _, ahead, back = np.split(difference(after, after[0]), [1, 31])
        slopes = (ahead - back).T / 2e-6
        F = slopes[:, :18]
        B = slopes[:, 18:]
        self.covariance = F @ self.covariance @ F.T + B @ self.Q @ B.T
        self.state = after[0]


def test_the_filter_equals_the_literal_one():
    flight = yawing_flight(VEHICLE, 300, seed=3)
    slow = Literal(VEHICLE, ANISOTROPIC, PERIOD)
    begin(slow, flight, initial_covariance())
    missing = range(25, 40)
    fast = fly(WrenchEKF(VEHICLE, ANISOTROPIC, PERIOD), flight, missing, initial_covariance())
    for k, e in enumerate(fast, 1):
        slow.predict(flight["rotors"][k])
        if k not in missing:
            slow.correct(flight["position"][k], flight["quaternion"][k])
        size = np.sqrt(np.diag(slow.covariance))
        error = difference(as_reference(e, slow.state), slow.state)
        assert abs(error / size).max() < 1e-5
        assert abs((e.covariance - slow.covariance) / np.outer(size, size)).max() < 1e-5
