"""Recovery of a filter from gaps, from poses noisier than declared, and from wrong poses.

A Kalman filter's model knows none of five events. Each breaks another assumption:

* *Noise* other than declared makes every pose unlikely, or none. The filter learns the variances of
  measured attitudes and positions from the poses (``learn_noise``), starting at the declared ones.
  A refuted variance is replaced by a wider one, never by a narrower one: smooth errors of a motion
  capture change little from pose to pose. Unrefuted, the filter is the paper's, bit for bit.
* A *gap* makes the covariance grow. A part known no better than a prior is *lost*: pose and twist
  are held with the prior's covariance, and the next measurement restarts them.
* An *outlier* is a pose that jumps: far from the filter's expectation and, by more than a vehicle
  can move, from the pose just before. A gate refuses the pose and its successors, even if
  they look likely to a filter without recent poses. Poses are accepted again when the accumulated
  jump returns to zero, or when the innovation shows no jump: the jitter of a clock also exceeds a
  vehicle's motion by a little.
* A *push* is harder than the random walk of the wrench expects. The pose is far from the
  expectation, yet goes on from the pose before. The filter takes the pose in, gate or not.
* A *jump for good* is an outlier whose successors all agree with each other. The filter restarts
  there after ``Recovery.patience``, without a gate at once. Poses in disagreement restart the
  filter after ``Recovery.give_up``, with their disagreement as deviation.

After a restart attitude and rate may be uncertain: a spin, and then a torque, would explain a
contradicting pose. So the filter restarts again at poses that return to a guessed attitude. Within
``Recovery.patience`` the filter restarts once more at an unlikely pose that continues the motion. A
third restart is not allowed: with noise twice the declared each restart caused the next, 44 a
second. The wrench after unlikely poses is uncertain, too: until the filter forgets them, their NIS
widens the stated variances.

So a filter is in one of three phases, and each measured pose has one verdict, its ``Status``:

    phase               pose                              verdict     next phase
    any                 of a part that is lost            RESTARTED   BELIEVING
    BELIEVING           likely                            TRACKING    BELIEVING
    BELIEVING           unlikely, goes on (``continues``) TRACKING    BELIEVING
    BELIEVING           unlikely, jumped; no gate         RESTARTED   BELIEVING
    BELIEVING           unlikely, jumped                  REJECTED    ONE_REFUSED
    ONE_REFUSED, more   back (``is_back``)                TRACKING    BELIEVING
    ONE_REFUSED, more   neither                           REJECTED    REFUSING
    ONE_REFUSED, more   lasting (``judge``)               RESTARTED   BELIEVING

Beyond a linear correction (``is_beyond``), an unlikely pose that goes on or is back restarts the
filter. The phase stays while a part with an open jump is not measured.

The agreement of refused poses depends on the poses alone. After a wrong attitude the filter's
velocity runs away, and by this velocity two poses at one place would disagree.

A restart sets pose and twist to the measurement, with a prior's covariance. Force and torque keep
their estimates, with variances wide enough for no wrench at all. An impossible wrench explains a
contradiction as well as a jump of the pose. After a gap the wrench may have ended.

``core/recovery.hpp`` has the functions in brackets, ``core/noise.hpp`` learns the noise.
"""

import math
from dataclasses import dataclass

import numpy as np

from ..dynamics.vehicle import Vehicle
from ..runtime.arguments import check_positive
from .estimate import Array

N = 18  # error state (rho, omega, x, v, torque, force)
NOISE = 12  # noise inputs of the prediction: motor torque, torque walk, thrust, force walk
LARGEST_MRP_VARIANCE = 0.25  # a standard deviation of about 115 degrees
_LOST = 0.9  # share of a prior's variance: a state known no better is lost
BELIEVING = 0.0  # phase: the last pose was taken in, or the filter restarted there

# Memory of poses between steps
MEMORY = np.dtype(
    [
        ("phase", "f8"),
        ("strain", "f8"),  # NIS over its expectation, of accepted unlikely poses; decays
        ("astray", "f8"),  # s in which an accepted jump may still prove an outlier
        ("settling", "f8"),  # s in which one more restart is allowed
        ("judged", "f8"),  # poses behind the learned noise, up to 200
        # relative excess over the declared variances of attitude and position, in use
        ("widened", "f8", (2,)),
        ("residual", "f8", (6,)),  # (rho, x) of the last pose after its correction
        ("seen", "f8", (7,)),  # last accepted position and quaternion
        ("position_age", "f8"),  # s since an accepted position
        ("attitude_age", "f8"),  # s since an accepted attitude
        ("doubted", "f8", (7,)),  # last refused position and quaternion
        ("doubted_position_age", "f8"),  # s since a refused position
        ("doubted_attitude_age", "f8"),  # s since a refused attitude
        ("position_stride", "f8"),  # s between the last two refused positions; 0: fewer than two
        ("attitude_stride", "f8"),  # the same for attitudes
        ("pace", "f8", (6,)),  # motion of (rho, x) between them, per second
        ("agreeing", "f8"),  # refused poses in agreement, up to the last
        ("agreed_for", "f8"),  # s of this agreement
        ("jump", "f8", (6,)),  # accumulated jump of (rho, x)
        ("blur", "f8", (6,)),  # uncertainty of the accumulated jump
    ]
)


@dataclass(frozen=True)
class Recovery:
    """The filter's assumptions on gaps, outliers and restarts; the defaults suit vehicles from 30 g
    to a few kg.

    Attributes:
        patience: s of refused poses in a row, in agreement with each other, until they are
            believed; longer than the bursts of motion capture (0.1 to 0.5 s).
        give_up: s of refused poses until they are believed in spite of disagreement.
        jump_at: standard deviations of an innovation beyond which a filter without a gate checks
            for a jump; a consistent filter has none so large.
        restart_at: standard deviations beyond which the filter restarts instead of following a
            push. A push of one weight gives 70 with a rise time of 1 s.
        attitude_std: rad, of the attitude, beyond which a vehicle without a measured attitude is no
            longer predicted: its thrust's direction is a guess, and sigma points reach half a turn.
        velocity_std: m/s, with a known pose alone; a small multirotor in brisk flight.
        angular_velocity_std: rad/s, likewise. At long periods this and the torque's are smaller:
            attitudes a period apart limit both.
        position_std: m, of an unknown position; a flight hall.
        force_std: share of the weight, of an unknown force.
        torque_std: share of weight times arm, of an unknown torque.
        response: s to follow a push of at most two weights, and the same about the arm. The largest
            distance between two poses in a row follows.
    """

    patience: float = 0.6
    give_up: float = 1.5
    jump_at: float = 10.0
    restart_at: float = 100.0
    attitude_std: float = 0.4
    velocity_std: float = 5.0
    angular_velocity_std: float = 10.0
    position_std: float = 100.0
    force_std: float = 0.5
    torque_std: float = 0.25
    response: float = 0.05

    def __post_init__(self) -> None:
        check_positive(self)


def largest_nis(gate: float, *numbers: int) -> Array:
    """Return the largest believed NIS of so many numbers each: chi squared's quantile at ``gate``.

    SciPy's statistics have the same, and take half a second to import.
    """
    from scipy.special import gammaincinv

    return np.asarray(2.0 * gammaincinv(0.5 * np.array(numbers), gate))


def load_recovery(
    record: np.void, vehicle: Vehicle, gate: float | None, recovery: Recovery
) -> None:
    """Write a filter's gate (a probability or None) and recovery into its record; the record has
    period and kappa.
    """
    weight = vehicle.weight
    # largest NIS without a check, three numbers and six
    record["alarm"] = recovery.jump_at**2
    if gate is not None:
        record["alarm"] = largest_nis(gate, 3, 6)
    record["gated"] = gate is not None
    record["restart_at"] = recovery.restart_at**2
    record["patience"], record["give_up"] = recovery.patience, recovery.give_up
    torque = recovery.torque_std * weight * vehicle.arm_l
    # attitudes a period apart do not tell a rate from a rate one turn faster. Sigma points beyond
    # half a turn would find such rates, and the torques behind them
    period, inertia = float(record["period"]), float(np.linalg.eigvalsh(vehicle.inertia)[0])
    rate = math.pi / (math.sqrt(N + NOISE + float(record["kappa"])) * period)
    largest_torque = rate / period * inertia
    record["reason"] = np.repeat(
        np.square((min(4.0 * torque, largest_torque), 4.0 * recovery.force_std * weight)), 3
    )
    torque = min(torque, largest_torque)
    deviations = (
        math.sqrt(LARGEST_MRP_VARIANCE),
        min(recovery.angular_velocity_std, rate),
        recovery.position_std,
        recovery.velocity_std,
        torque,
        recovery.force_std * weight,
    )
    record["prior"] = np.repeat(np.square(deviations), 3)
    record["lost"] = _LOST * record["prior"]
    record["lost"][:3] = (recovery.attitude_std / 4.0) ** 2  # (16)
    # accelerations of a push of two weights, and of the same about the arm
    push = 2.0 * weight
    record["push"] = push * vehicle.arm_l / inertia, push / vehicle.mass
    record["response"] = recovery.response
