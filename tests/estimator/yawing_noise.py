"""How much worse the torque of a constant gain is than the full filter's, by yaw rate, in much
noise of the pose.

``python -m tests.estimator.yawing_noise`` flies ``tests.support.flights.yawing_flight`` (a constant
wrench, 12 s at 200 Hz of which the last 8 count) at several mean yaw rates, between half and one
and a half times of which the rate swings, and prints a row for each.
"""

import numpy as np
from scipy.stats import t as student

from tests.support.flights import yawing_flight
from windwrench.dynamics import load_vehicle
from windwrench.estimator import ConstantGainFilter, UKFTuning, WrenchUKF

TORQUE = (0.01, -0.015, 0.02)  # Nm
RATES = (0.0, 3.0, 6.0, 9.0)  # rad/s
# standard deviations of position (m) and of the attitude about the world's axes (rad)
NOISES = {
    "1 mm, 5 mrad": (0.001, (0.005, 0.005, 0.005)),
    "10 mm, 50 mrad": (0.01, (0.05, 0.05, 0.05)),
    "10 mm, 20 mrad, yaw 100 mrad": (0.01, (0.02, 0.02, 0.1)),
    "10 mm, x 100 mrad, y 20 mrad, yaw 50 mrad": (0.01, (0.1, 0.02, 0.05)),
}
SEEDS = 6
SETTLED = 800  # steps that do not count


def squared_error(kind, tuning, flight):
    """Mean squared error (3,) of a filter's torque, Nm^2."""
    made = kind(load_vehicle("ardrone2"), tuning)
    made.reset(
        flight["position"][0],
        flight["quaternion"][0],
        velocity=flight["velocity"][0],
        angular_velocity=flight["omega"][0],
    )
    rows = zip(
        *(flight[name][1:] for name in ("rotors", "position", "quaternion")),
        strict=True,
    )
    torques = np.array([made.step(*row).torque for row in rows])
    return np.mean(np.square(torques[SETTLED:] - TORQUE), axis=0)


def main():
    """Print the table."""
    print("| noise | yaw rate, rad/s | RMSE, constant by full | 95 % | axis where it is most |")
    print("| --- | ---: | ---: | --- | ---: |")
    for name, (position, attitude) in NOISES.items():
        tuning = UKFTuning(position_noise=position, attitude_noise=attitude)
        for rate in RATES:
            errors = []
            for seed in range(SEEDS):
                flight = yawing_flight(
                    load_vehicle("ardrone2"),
                    2400,
                    seed,
                    position,
                    np.array(attitude),
                    torque=TORQUE,
                    substeps=2,
                    yaw_rate=rate,
                )
                errors.append(
                    [
                        squared_error(kind, tuning, flight)
                        for kind in (WrenchUKF, ConstantGainFilter)
                    ]
                )
            full, constant = np.array(errors).transpose(1, 0, 2)
            ratios = np.sqrt(constant.sum(axis=1) / full.sum(axis=1))
            middle, half = ratios.mean(), student.ppf(0.975, SEEDS - 1) * ratios.std(ddof=1)
            half /= np.sqrt(SEEDS)
            most = np.sqrt(constant.mean(axis=0) / full.mean(axis=0)).max()
            print(
                f"| {name} | {rate:g} | {middle:.3f} | {middle - half:.3f}-{middle + half:.3f} "
                f"| {most:.2f} |",
                flush=True,
            )


if __name__ == "__main__":
    main()
