"""The filter alone on a stream of messages, as in a ROS node: two callbacks, late messages, gaps
and outliers.

Rotor speeds and poses come at their own times. The filter runs at the time of the rotor speeds, so
that its estimate is of now; a pose that comes late or out of order is fused at the time when it was
measured. The gate refuses outliers.

Install:  pip install .    (in a checkout)
Run:      python examples/filter_on_a_stream.py
"""

from collections import deque

import numpy as np

from windwrench.dynamics import load_vehicle
from windwrench.envs.recording import record_flight
from windwrench.estimator import TimedFilter, WrenchUKF

HORIZON = 0.3  # s that a pose may be late; one that is later than that is refused


class WrenchNode:
    """What a node does with its messages; stamps are times in s, on one clock, of when something
    was measured.
    """

    def __init__(self, vehicle):
        # the gate refuses outliers; the noise follows the time between messages
        self.filter = TimedFilter(WrenchUKF(vehicle, period=0.005, gate=0.999), HORIZON)
        self.early = deque()  # poses of a time that the rotor speeds have not come to
        self.largest = 0.0  # NIS of the most unlikely pose; of 6 numbers it is 6 on average

    def on_rotor_speeds(self, stamp, speeds):
        """Carry the filter to ``stamp`` with rotor speeds (4,) rad/s; return the present estimate,
        or None before the first pose and for rotor speeds that come out of order.
        """
        if not stamp > self.filter.time:  # neither before a first pose, when there is no time
            return None
        estimate = self.filter.predict(stamp, speeds)
        for pose in [pose for pose in self.early if pose[0] <= stamp]:
            self.early.remove(pose)
            estimate = self.on_pose(*pose) or estimate
        return estimate

    def on_pose(self, stamp, position, quaternion):
        """Take in a pose, m and body to world, wherever its stamp belongs; return the present
        estimate, or None for one that is too late, or of a time that is still to come.
        """
        if np.isnan(self.filter.time):
            self.filter.reset(stamp, position, quaternion)
        if stamp > self.filter.time:
            self.early.append((stamp, position, quaternion))
            return None
        estimate = self.filter.correct(stamp, position, quaternion)
        if estimate is not None:
            self.largest = max(self.largest, self.filter.fused.nis)
        return estimate


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
        messages.append((t + 0.002, "rotors", t, (flown["rotor_speeds"][k],)))
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
    node, found = WrenchNode(vehicle), []
    for _, kind, stamp, values in stream(vehicle, seconds, force, np.random.default_rng(seed)):
        if kind == "pose":
            node.on_pose(stamp, *values)
        elif (estimate := node.on_rotor_speeds(stamp, *values)) and stamp > seconds - 3.0:
            found.append(estimate.force)
    mean = np.mean(found, axis=0)
    print(f"poses fused where they belong: {node.filter.late}, too late: {node.filter.too_late}")
    print(f"the most unlikely pose: NIS {node.largest:.0f}")
    print("force found (N):", " ".join(f"{x:+.3f}" for x in mean))
    print("force applied  :", " ".join(f"{x:+.3f}" for x in force))
    return mean


if __name__ == "__main__":
    main()
