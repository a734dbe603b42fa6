"""Recovery of a filter from gaps, from poses noisier than declared, and from wrong poses.

A Kalman filter's model knows none of five events. Each breaks another assumption:

* *Noise* other than declared makes every pose unlikely, or none. The filter learns the variances of
  measured attitudes and positions from the poses (``learn_noise``), starting at the declared ones.
  A refuted variance is replaced by a wider one, never by a narrower one: smooth errors of a motion
  capture change little from pose to pose. Unrefuted, the filter is the paper's, bit for bit.
* A *gap* makes the covariance grow. A part known no better than a prior is *lost*: pose and twist
  are held with the prior's covariance, and the next measurement restarts them.
* An *outlier* is a pose that jumps: far from the filter's expectation and, by more than a vehicle
  can move, from the pose just before. A gate refuses the pose and its successors, likely to a
  filter that has not seen for a while. Poses are accepted again once the jumps cancel, however
  wrong the wrench is. Or once the innovation says that there was no jump: a clock's blur also
  exceeds a vehicle's motion by a little.
* A *push* is harder than the random walk of the wrench expects. The pose is far from the
  expectation, yet goes on from the pose before. The filter takes the pose in, gate or not.
* A *jump for good* is an outlier whose successors all agree with each other. The filter restarts
  there after ``Recovery.patience``, without a gate at once. Poses in disagreement restart the
  filter after ``Recovery.give_up``, with their disagreement as deviation.

After a restart attitude and rate may be little known: a spin, and then a torque, would explain a
contradicting pose. So the filter restarts again at poses that come back to a guessed attitude.
Within ``Recovery.patience`` it restarts once at an unlikely pose that goes on. A repeated restart
allows no third: with noise twice the declared each restart brought the next, 44 a second. The
wrench after unlikely poses is not known either: while they are taken in, and as the filter forgets
them, the stated variances are widened by their NIS.

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

Where an unlikely pose goes on or is back, and no linear correction leads there (``is_beyond``),
the filter restarts instead of tracking. The phase stays while a part with uncancelled jumps is not
measured.

Whether refused poses agree is asked of the poses alone. After a wrong attitude the filter's
velocity runs away, and by that velocity two poses at one spot would not agree.

A restart sets pose and twist anew with a prior's covariance. Force and torque keep their estimates,
with variances so wide that there may be no wrench at all. An impossible wrench explains a
contradiction as well as a jump of the pose. After a gap nothing says that the wrench still acts.

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
_LOST = 0.9  # of a prior's variance: known no better than that
BELIEVING = 0.0  # phase: the last pose was taken in, or the filter restarted there

# What is remembered of poses from one step to the next
MEMORY = np.dtype(
    [
        ("phase", "f8"),
        ("strain", "f8"),  # NIS, of 1 expected, of unlikely poses that were taken in; falls
        ("astray", "f8"),  # s for which a jump that was followed at once may have been an outlier
        ("settling", "f8"),  # s for which a restart may be repeated; a repetition ends it
        ("judged", "f8"),  # poses that the noise was learned from, up to 200
        ("widened", "f8", (2,)),  # by this share the filter takes more than the declared variance
        # of attitude and position
        ("residual", "f8", (6,)),  # (rho, x) of the last measurement after its correction
        ("seen", "f8", (7,)),  # position and quaternion that were believed last
        ("position_age", "f8"),  # s since a position was believed
        ("attitude_age", "f8"),  # s since an attitude was
        ("doubted", "f8", (7,)),  # position and quaternion that were refused last
        ("doubted_position_age", "f8"),  # s since a position was refused
        ("doubted_attitude_age", "f8"),  # s since an attitude was
        ("position_stride", "f8"),  # s between the last two positions refused; 0: not two
        ("attitude_stride", "f8"),  # the same of attitudes
        ("pace", "f8", (6,)),  # motion of (rho, x) over that time, per second
        ("agreeing", "f8"),  # of those refused: how many went on from each other, up to the last
        ("agreed_for", "f8"),  # s for which they have
        ("jump", "f8", (6,)),  # of (rho, x): what those from one to the next add up to
        ("blur", "f8", (6,)),  # what these may miss by
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
        jump_at: standard deviations of an innovation beyond which a filter without a gate asks
            whether the pose jumped; a consistent filter never sees them.
        restart_at: standard deviations beyond which the filter restarts instead of following a
            push. A push of one weight makes 70 on a filter that rises in 1 s.
        attitude_std: rad, of the attitude, beyond which a vehicle without a measured attitude is no
            longer predicted: its thrust's direction is a guess, and sigma points reach half a turn.
        velocity_std: m/s, of a vehicle of which only the pose is known; a small multirotor in brisk
            flight.
        angular_velocity_std: rad/s, likewise. At long periods this and the torque's are less: no
            more than attitudes a period apart can tell.
        position_std: m, beyond which a position means nothing; a flight hall.
        force_std: share of the weight, of a force of which a contradiction has left nothing known.
        torque_std: share of weight times arm, likewise.
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


def load_recovery(record: np.void, vehicle: Vehicle, gate: float | None, given: Recovery) -> None:
    """Write a filter's gate (a probability or None) and recovery into its record, which has its
    period and kappa.
    """
    weight = vehicle.weight
    # largest NIS that is taken in unseen, of three numbers and of six
    record["alarm"] = given.jump_at**2
    if gate is not None:
        record["alarm"] = largest_nis(gate, 3, 6)
    record["gated"] = gate is not None
    record["restart_at"] = given.restart_at**2
    record["patience"], record["give_up"] = given.patience, given.give_up
    torque = given.torque_std * weight * vehicle.arm_l
    # attitudes do not tell a rate from one that is faster by a turn from each to the next: sigma
    # points that lie further out than half a turn would find such rates, and torques that make them
    period, inertia = float(record["period"]), float(np.linalg.eigvalsh(vehicle.inertia)[0])
    rate = math.pi / (math.sqrt(N + NOISE + float(record["kappa"])) * period)
    told = rate / period * inertia
    record["reason"] = np.repeat(
        np.square((min(4.0 * torque, told), 4.0 * given.force_std * weight)), 3
    )
    torque = min(torque, told)
    deviations = (
        math.sqrt(LARGEST_MRP_VARIANCE),
        min(given.angular_velocity_std, rate),
        given.position_std,
        given.velocity_std,
        torque,
        given.force_std * weight,
    )
    record["prior"] = np.repeat(np.square(deviations), 3)
    record["lost"] = _LOST * record["prior"]
    record["lost"][:3] = (given.attitude_std / 4.0) ** 2  # (16)
    # accelerations of a push of two weights, and of the same about the arm
    push = 2.0 * weight
    record["push"] = push * vehicle.arm_l / inertia, push / vehicle.mass
    record["response"] = given.response
