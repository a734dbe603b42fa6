"""The cut-offs of every filter that smooths a flight's signals, side by side, each with its reason.

All low-passes are ``signals.low_pass``: zero phase, a Butterworth filter run forwards and
backwards. What is compared passes the same one.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Cutoffs:
    """Cut-off frequencies (Hz)."""

    # of a log's pose before it is differentiated, and of rotor speeds worked out from commands:
    # wide enough to leave a quadrotor's motion alone
    pose_hz: float = 15.0
    # of the residual and of every column that is regressed on it
    residual_hz: float = 5.0
    # of what is bolted on and moves slowly; below the residual's cut-off
    slow_motion_hz: float = 3.0
    # of the residual, where transient disturbances are searched for: they last as long, and sensor
    # noise is weakest below these
    transient_hz: tuple[float, float] = (1.5, 3.0)
    # of a disturbance that counts for the verdict; what is faster is in part noise: of the pose, of
    # the rounding of rotor speeds
    calm_hz: float = 2.0
    # of the position from which a model is flown
    position_hz: float = 10.0
    # below it the measured velocity and angular velocity are used, above it the model's: with the
    # true model, predictions of 46 flights out of 46 came nearer than with 1.5
    twist_hz: float = 1.0


CUTOFFS = Cutoffs()
