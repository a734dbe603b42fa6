"""The filter alone on a stream of messages, as in a ROS node: two callbacks, late messages, gaps
and outliers.

Motor speeds and poses come at their own times. The filter runs at the time of the poses: it waits
with the motor speeds until a pose says up to when to use them, so that a pose which comes late is
taken in where it belongs.

Install:  pip install .    (in a checkout)
Run:      python examples/filter_on_a_stream.py
"""

from collections import deque

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.estimator import WrenchUKF

PATIENCE = 0.2  # s that the filter waits for a pose; one that is later than that is dropped


class WrenchNode:
    """What a node does with its messages; stamps are times in s, on one clock, of when something
    was measured.
    """

    def __init__(self, vehicle):
        self.ukf = WrenchUKF(
            vehicle, period=0.005, gate=0.999
        )  # the gate refuses outliers; the noise follows each dt
        self.speeds = 4 * [vehicle.hover_rate]  # rad/s, in use at self.now
        self.waiting = deque()  # stamps and motor speeds that the filter has not come to
        self.now = None  # s, up to where the filter is; None before the first pose

    def on_motor_speeds(self, stamp, speeds):
        """Keep rotor speeds (4,) rad/s; where no pose comes for too long, go on without."""
        if not self.waiting or stamp > self.waiting[-1][0]:
            self.waiting.append((stamp, speeds))
        if self.now is not None:
            self.run_to(stamp - PATIENCE)

    def on_pose(self, stamp, position, quaternion):
        """Take in a pose, m and body to world, and return the estimate; None for one that is too
        late.
        """
        if self.now is None:
            self.ukf.reset(position, quaternion)
            self.now = stamp
            return None
        if stamp <= self.now:
            return None
        self.run_to(stamp)
        return self.ukf.correct(position, quaternion)

    def run_to(self, stamp):
        """Predict up to ``stamp``, with each set of motor speeds until the next
        one was measured.
        """
        while self.now < stamp:
            while self.waiting and self.waiting[0][0] <= self.now:
                self.speeds = self.waiting.popleft()[1]
            until = min(stamp, self.waiting[0][0]) if self.waiting else stamp
            self.ukf.predict(self.speeds, dt=until - self.now)
            self.now = until


def stream(vehicle, seconds, force, rng):
    """Return messages (arrival, kind, stamp, values) of a hover that is pushed with ``force`` (3,)
    N, by arrival.
    """
    push = np.array([*force, 0.0, 0.0, 0.0])
    flown = record_flight(
        vehicle,
        trajectory="hover",
        seconds=seconds,
        push=lambda loop: push if loop.time > 2.0 else None,
    )
    messages = []
    for k, t in enumerate(flown["t"]):
        messages.append((t + rng.uniform(0.001, 0.004), "motors", t, (flown["rotor_speeds"][k],)))
        in_gap = 0.5 * seconds < t < 0.5 * seconds + 0.4
        if (
            k % 2 == 0 and not in_gap and rng.random() > 0.1
        ):  # 100 Hz; a tenth gets lost, and there is a gap of 0.4 s
            wrong = rng.normal(0.0, 0.3, 3) if rng.random() < 0.01 else 0.0
            late = 0.1 if rng.random() < 0.02 else rng.uniform(0.015, 0.03)
            messages.append(
                (t + late, "pose", t, (flown["position"][k] + wrong, flown["quaternion"][k]))
            )
    return sorted(messages, key=lambda message: message[0])


def main(seconds=10.0, force=(0.4, -0.2, 0.1), seed=0):
    """Feed a stream to the node; print and return the mean force (3,) N of the last 3 s."""
    vehicle = load_vehicle("ardrone2")
    node, found, late = WrenchNode(vehicle), [], 0
    for _, kind, stamp, values in stream(vehicle, seconds, force, np.random.default_rng(seed)):
        if kind == "motors":
            node.on_motor_speeds(stamp, *values)
        elif (estimate := node.on_pose(stamp, *values)) is None:
            late += 1
        elif stamp > seconds - 3.0:
            found.append(estimate.force)
    mean = np.mean(found, axis=0)
    print(f"poses that came out of order, and were dropped: {late}")
    print("force found (N):", " ".join(f"{x:+.3f}" for x in mean))
    print("force applied  :", " ".join(f"{x:+.3f}" for x in force))
    return mean


if __name__ == "__main__":
    main()
