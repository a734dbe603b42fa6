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
    ONE_REFUSED, more   back (``_is_back``)               TRACKING    BELIEVING
    ONE_REFUSED, more   neither                           REJECTED    REFUSING
    ONE_REFUSED, more   lasting (``_outlasts``)           RESTARTED   BELIEVING

Where an unlikely pose goes on or is back, and no linear correction leads there (``_is_beyond``),
the filter restarts instead of tracking. The phase stays while a part with uncancelled jumps is not
measured.

Whether refused poses agree is asked of the poses alone. After a wrong attitude the filter's
velocity runs away, and by that velocity two poses at one spot would not agree.

A restart sets pose and twist anew with a prior's covariance. Force and torque keep their estimates,
with variances so wide that there may be no wrench at all. An impossible wrench explains a
contradiction as well as a jump of the pose. After a gap nothing says that the wrench still acts.

One compiled code is that of single filters, of filters side by side in lanes, and of the exported
C: so phases are numbers, and conditions have an answer for each lane (``runtime.vector_lanes``).
"""

import math
from dataclasses import dataclass

import numpy as np

from ..dynamics.rotation import attitude_error
from ..dynamics.vehicle import Vehicle
from ..runtime.arguments import check_positive
from ..runtime.compiled import Record, compiled
from ..runtime.vector_lanes import any_of, choose, opposite
from .error_state import LARGEST_MRP_VARIANCE, bound_variance
from .estimate import COASTING, NIS, REJECTED, RESTARTED, TRACKING, Array

N = 18  # error state (rho, omega, x, v, torque, force)
NOISE = 12  # noise inputs of the prediction: motor torque, torque walk, thrust, force walk
_LOST = 0.9  # of a prior's variance: known no better than that
# poses in a row, in agreement, before they are believed again. With poses 10 cm off in random
# directions one in a hundred agrees with the one before by chance, and two in a row 1e-4.
AGREEING = 3

# How the noise of measured poses is learned. The declared one counts as this many poses,
PRIOR_OF_NOISE = 5.0
# and later ones are forgotten over as many: 1 s at 200 Hz
MEMORY_OF_NOISE = 200.0
# a pose counts with at most this many times the square expected of its three numbers: noise alone
# exceeds that in one of 140, and a jump of any size counts as little
LARGEST_SQUARE = 4.0
# The declared variance is refuted where a learned one, less three of its own deviations, exceeds it
# by half: vehicle files state deviations to some 20 %
SURE, REFUTED = 3.0, 1.5

# Phases, what a filter makes of measured poses, as a record holds them, lanes too
BELIEVING = 0.0  # the last pose was taken in, or the filter restarted there
ONE_REFUSED = 1.0  # one alone was refused since
REFUSING = 2.0  # more were

# What is remembered of poses from one step to the next
MEMORY = np.dtype(
    [
        ("phase", "f8"),
        ("strain", "f8"),  # NIS, of 1 expected, of unlikely poses that were taken in; falls
        ("astray", "f8"),  # s for which a jump that was followed at once may have been an outlier
        ("settling", "f8"),  # s for which a restart may be repeated; a repetition ends it
        ("judged", "f8"),  # poses that the noise was learned from, up to ``MEMORY_OF_NOISE``
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


@compiled
def grow_older(f: Record, dt: float) -> None:
    """Count the time since poses were believed and refused, and widen the measurement's noise by
    what was learned of it.
    """
    m = f.poses
    uncertainty = 1.0 + SURE / math.sqrt(PRIOR_OF_NOISE + m.judged)
    for part in range(2):
        proved = (1.0 + f.excess[part]) / uncertainty
        m.widened[part] = choose(proved > REFUTED, proved - 1.0, 0.0)
    m.settling -= dt
    m.astray -= dt
    m.strain -= min(dt / f.patience, 1.0) * m.strain
    m.position_age += dt
    m.attitude_age += dt
    m.doubted_position_age += dt
    m.doubted_attitude_age += dt


@compiled
def pose_noise(f: Record, i: int) -> float:
    """Return the variance of number ``i`` of a measured pose, (rho, x), that the filter assumes."""
    variance: float = f.noise[i] * (1.0 + f.poses.widened[0 if i < 3 else 1])
    return variance


@compiled
def likeliest_scale(f: Record, i: int) -> float:
    """Return the same as poses show it, as a multiple of the declared variance: at least 1."""
    share: float = max(1.0 + f.excess[0 if i < 3 else 1], 1.0)
    return share


@compiled
def learn_noise(f: Record, with_position: bool, with_attitude: bool) -> None:
    """Learn from a measured pose how large the noise of attitudes and positions is.

    The motion from the last measured pose, less the motion that the filter expected
    (``f.increment``), holds the noise of both measurements, 2 R. The uncertainty of the expected
    pose, ``f.unsure``, adds to that. A wrench that sets in adds little in so short a time, and a
    jump for good adds once. Their innovations stay large, and would make noise of every gust.
    """
    m = f.poses
    poses = PRIOR_OF_NOISE + m.judged
    for part in range(2):
        measured, wide = with_attitude if part == 0 else with_position, 1.0 + m.widened[part]
        share, square = 0.0 * wide, 0.0 * wide
        for j in range(3):
            i = 3 * part + j
            noise, variance = wide * f.noise[i], f.unsure[i]
            expected = 2.0 * noise + variance * (variance / (variance + noise))
            share = share + 2.0 * noise / (3.0 * expected)
            square = square + f.increment[i] * f.increment[i] / (3.0 * expected)
        # the variance that this pose shows, times the share; the weight is the square of the share:
        # an innovation of an unknown pose is no noise
        shown = max(wide * (share + min(square, LARGEST_SQUARE) - 1.0), 0.0)
        news = share * (shown - share * (1.0 + f.excess[part])) / poses
        # a covariance whose numbers overflow says nothing
        f.excess[part] += choose(measured & math.isfinite(news), news, 0.0)
    judged = min(m.judged + 1.0, MEMORY_OF_NOISE)
    m.judged = choose(with_position | with_attitude, judged, m.judged)


@compiled
def after_prediction(f: Record, dt: float) -> None:
    """Count the time since the last measurements, keep the covariance within what a vehicle can do,
    and hold what is lost.
    """
    x, m = f.x, f.poses
    f.status = COASTING
    grow_older(f, dt)
    # over a gap variances grow without an end; at 16 times the prior's they have long lost their
    # meaning
    for i in range(3, N):
        bound_variance(f.P, i, 16.0 * f.prior[i])
    late = (m.position_age > f.patience) | (m.attitude_age > f.patience)
    if any_of(late | (m.position_age < m.attitude_age)):
        position, attitude = lost_position(f), lost_attitude(f)
        _forget(f, position, attitude, False)
        for i in range(3):
            # where it was before this step: the velocity of what is held is zero
            x[i] -= choose(position, 0.5 * dt * x[7 + i], 0.0)
            x[7 + i] = choose(position, 0.0, x[7 + i])
            x[10 + i] = choose(attitude, 0.0, x[10 + i])
    start_over_if_broken(f)


@compiled
def start_over_if_broken(f: Record) -> None:
    """Begin again at the last pose that was believed, where inputs that no vehicle can have (rotor
    speeds of 1e200 rad/s) made numbers overflow.
    """
    x, P = f.x, f.P
    total = x[0]
    for i in range(1, 19):
        total += x[i]
    for i in range(N):  # a float of the C overflows sooner than a double: all of P is looked at
        row = P[i, i]
        for j in range(i):
            row += P[i, j]
        total += row
    broken = opposite(math.isfinite(total))
    if any_of(broken):
        for i in range(19):
            x[i] = choose(broken, f.poses.seen[i] if i < 7 else 0.0, x[i])
        _forget(f, broken, broken, broken)
        f.restarts = choose(broken, f.restarts + 1.0, f.restarts)
        f.status = choose(broken, RESTARTED, f.status)


@compiled
def lost_position(f: Record) -> bool:
    """Return whether position and velocity have long not been measured, and are known no better
    than a prior.
    """
    P, lost = f.P, f.lost
    wide = P[6, 6] > lost[6]
    for i in range(7, 12):
        wide = wide | (P[i, i] > lost[i])
    lost_now: bool = wide & (f.poses.position_age > f.patience)
    return lost_now


@compiled
def lost_attitude(f: Record) -> bool:
    """Return the same of attitude and angular velocity; or whether the attitude has become a guess
    while positions went on. These then are explained by a turn more or less as well as by a force,
    from sigma points that reach half a turn: rates run away and rounding errors grow.
    """
    P, lost, m = f.P, f.lost, f.poses
    guessed = _is_guessed(f)
    wide = guessed | (P[3, 3] > lost[3]) | (P[4, 4] > lost[4]) | (P[5, 5] > lost[5])
    unseen = m.attitude_age > f.patience
    lost_now: bool = (wide & unseen) | (guessed & (m.position_age < m.attitude_age))
    return lost_now


@compiled
def _is_guessed(f: Record) -> bool:
    """Return whether the attitude is known no better than ``Recovery.attitude_std``."""
    P, lost = f.P, f.lost
    guessed: bool = (P[0, 0] > lost[0]) | (P[1, 1] > lost[1]) | (P[2, 2] > lost[2])
    return guessed


@compiled
def _forget(f: Record, position: bool, attitude: bool, wrench: bool) -> None:
    """Give what is forgotten the prior's covariance, and none with the rest."""
    P = f.P
    for i in range(N):
        gone = attitude if i < 6 else position if i < 12 else wrench
        for j in range(len(P)):
            P[i, j] = choose(gone, 0.0, P[i, j])
            P[j, i] = choose(gone, 0.0, P[j, i])
        P[i, i] = choose(gone, f.prior[i], P[i, i])


@compiled
def believable(
    f: Record, pose: Array, with_position: bool, with_attitude: bool, nis: float
) -> bool:
    """Give the verdict on a measured pose, or a part of one, of which ``ukf.innovate`` was called;
    restart there if it must be.

    Returns whether a linear correction takes the pose in.
    """
    m, alarm = f.poses, f.alarm
    measured = with_position | with_attitude
    learn_noise(f, with_position, with_attitude)
    f.x[NIS] = choose(measured, nis, math.nan)
    largest = choose(with_position & with_attitude, alarm[1], alarm[0])
    # the likeliest noise judges, of which the filter takes only what is proved
    largest = largest * max(
        choose(with_attitude, likeliest_scale(f, 0) / (1.0 + m.widened[0]), 1.0),
        choose(with_position, likeliest_scale(f, 3) / (1.0 + m.widened[1]), 1.0),
    )
    unlikely = measured & opposite(nis <= largest)  # so is what is no number
    late = with_position & (m.position_age > f.patience)
    late = late | (with_attitude & (m.attitude_age > f.patience))
    verdict = choose(measured, TRACKING, f.status)
    if any_of(unlikely | late | (m.phase > BELIEVING)):
        verdict = _judge(f, pose, with_position, with_attitude, nis, unlikely)
    f.status = verdict
    believed = measured & opposite(verdict == REJECTED)
    remember(f, pose, believed & with_position, believed & with_attitude)
    taken: bool = measured & (verdict == TRACKING)
    strain = nis / choose(with_position & with_attitude, 6.0, 3.0)
    m.strain = choose(taken & unlikely, max(m.strain, strain), m.strain)
    return taken


@compiled
def _judge(
    f: Record, pose: Array, with_position: bool, with_attitude: bool, nis: float, unlikely: bool
) -> float:
    """Return the verdict on a pose that is unlikely, comes when its part is lost, or comes after
    refused ones; change the phase, and restart where that is the verdict.
    """
    m = f.poses
    measured, believing = with_position | with_attitude, m.phase == BELIEVING
    lost = (with_position & lost_position(f)) | (with_attitude & lost_attitude(f))
    beyond = (unlikely & _is_beyond(f, with_attitude, nis)) | (
        opposite(believing) & with_attitude & _is_guessed(f)
    )
    explained = continues(
        f, pose, m.seen, m.position_age, m.attitude_age, with_position, with_attitude
    )
    if f.gated > 0:
        _compare_refused(f, pose, with_position, with_attitude)
        back = _is_back(f, pose, with_position, with_attitude)
        back = back & (explained | opposite(unlikely))
        explained = choose(believing, explained, back)
    # among refused ones a likely pose too has to come back first
    refused = (unlikely | (measured & opposite(believing))) & opposite(lost | explained)
    restarted = measured & (lost | (explained & beyond))
    if f.gated > 0:
        _remember_refused(f, pose, refused & with_position, refused & with_attitude)
        lasting = _outlasts(f, with_position, refused)  # writes: asked whatever else holds
        restarted = restarted | (refused & lasting)
        refused = refused & opposite(restarted)
        m.phase = choose(refused, choose(believing, ONE_REFUSED, REFUSING), m.phase)
    else:
        restarted = restarted | refused
        m.astray = choose(refused, f.patience, m.astray)
    _restart(f, pose, restarted & with_position, restarted & with_attitude)
    verdict = choose(refused, REJECTED, choose(measured, TRACKING, f.status))
    final: float = choose(restarted, RESTARTED, verdict)
    return final


@compiled
def _is_beyond(f: Record, with_attitude: bool, nis: float) -> bool:
    """Return whether an unlikely pose is beyond what a linear correction can follow.

    Just after a restart a wrench of any size is likely. An unlikely pose then means an attitude or
    a rate off by more than a linear model holds, with all conclusions since.
    """
    far = _turns_between(f) | (f.poses.settling > 0.0)
    beyond: bool = opposite(nis <= f.restart_at) | (with_attitude & far)
    return beyond


@compiled
def _turns_between(f: Record) -> bool:
    """Return whether the vehicle is estimated to turn by more than half a turn from one measured
    attitude to the next: as many attitudes are explained by one turn more in each, or one less.

    If attitudes contradict the filter as well, the filter has taken a vehicle elsewhere for a
    spinning one, and a torque for the cause of the spin.
    """
    x, age = f.x, f.poses.attitude_age
    rate = x[10] * x[10] + x[11] * x[11] + x[12] * x[12]
    more: bool = rate * age * age > math.pi * math.pi
    return more


@compiled
def continues(
    f: Record,
    pose: Array,
    before: Array,
    position_age: float,
    attitude_age: float,
    with_position: bool,
    with_attitude: bool,
) -> bool:
    """Return whether a pose can follow an earlier one (7,) that was measured some seconds before,
    of a vehicle that moves as estimated, give or take six standard deviations and a push.

    Leaves in ``f.miss`` by how much it misses, MRP and m (6,), and in ``f.slack`` by how much it
    may.
    """
    x, P, miss, near = f.x, f.P, f.miss, True
    attitude_error(pose[3:7], before[3:7], miss[0:3])
    rate = math.sqrt(x[10] * x[10] + x[11] * x[11] + x[12] * x[12])
    for i in range(6):
        # the difference of two measurements, at six standard deviations
        slack = 6.0 * math.sqrt(2.0 * f.noise[i] * likeliest_scale(f, i))
        if i < 3:
            age, measured = attitude_age, with_attitude
            slack = slack + 0.25 * age * (
                rate + 6.0 * math.sqrt(P[3 + i, 3 + i]) + f.push[0] * (f.response + 0.5 * age)
            )
        else:
            age, measured = position_age, with_position
            miss[i] = pose[i - 3] - before[i - 3] - age * x[4 + i]
            slack = slack + age * (
                6.0 * math.sqrt(P[6 + i, 6 + i]) + f.push[1] * (f.response + 0.5 * age)
            )
        f.slack[i] = slack
        near = near & opposite(measured & (abs(miss[i]) > slack))
    return near


@compiled
def _compare_refused(f: Record, pose: Array, with_position: bool, with_attitude: bool) -> None:
    """Remember how a pose goes on from those that were refused before it: whether it agrees with
    them, and by how much it jumped. The first is compared with the pose that was believed last.
    """
    m = f.poses
    first, measured = m.phase == BELIEVING, with_position | with_attitude
    for i in range(7):
        m.doubted[i] = choose(first, m.seen[i], m.doubted[i])
    m.doubted_position_age = choose(first, m.position_age, m.doubted_position_age)
    m.doubted_attitude_age = choose(first, m.attitude_age, m.doubted_attitude_age)
    m.position_stride = choose(first, 0.0, m.position_stride)
    m.attitude_stride = choose(first, 0.0, m.attitude_stride)
    for i in range(6):
        m.jump[i] = choose(first, 0.0, m.jump[i])
        m.blur[i] = choose(first, 0.0, m.blur[i])
    agreed = _agrees(f, pose, with_position, with_attitude) & opposite(first)
    m.agreeing = choose(measured, choose(agreed, m.agreeing + 1.0, 1.0), m.agreeing)
    stride = choose(agreed, m.doubted_position_age, 0.0)
    m.position_stride = choose(with_position, stride, m.position_stride)
    stride = choose(agreed, m.doubted_attitude_age, 0.0)
    m.attitude_stride = choose(with_attitude, stride, m.attitude_stride)
    jumped = opposite(
        continues(
            f,
            pose,
            m.doubted,
            m.doubted_position_age,
            m.doubted_attitude_age,
            with_position,
            with_attitude,
        )
    )
    for i in range(6):
        counts = jumped & (with_attitude if i < 3 else with_position)
        m.jump[i] += choose(counts, f.miss[i], 0.0)
        m.blur[i] += choose(counts, f.slack[i], 0.0)


@compiled
def _agrees(f: Record, pose: Array, with_position: bool, with_attitude: bool) -> bool:
    """Return whether a pose goes on from the poses that were refused before it, whatever the filter
    believes of the vehicle's motion.

    Two poses lie no farther apart than a vehicle gets at six times the prior's deviation of its
    speed. A third goes on with the motion from the first to the second, give or take six deviations
    of the three measurements and a push. Leaves that motion, per second, in the memory, and in
    ``f.disagreement`` by how much the pose misses.
    """
    m, moved, near = f.poses, f.disagreement, True
    attitude_error(pose[3:7], m.doubted[3:7], moved[0:3])
    for i in range(6):
        if i < 3:
            measured, age, stride = with_attitude, m.doubted_attitude_age, m.attitude_stride
            lever, push = 0.25, f.push[0]  # an MRP is a quarter of an angle
        else:
            measured, age, stride = with_position, m.doubted_position_age, m.position_stride
            lever, push = 1.0, f.push[1]
            moved[i] = pose[i - 3] - m.doubted[i - 3]
        has_pace = stride > 0.0
        ratio = age / max(stride, 1e-9)
        variances = choose(has_pace, 1.0 + (1.0 + ratio) * (1.0 + ratio) + ratio * ratio, 2.0)
        fastest = 6.0 * math.sqrt(f.prior[3 + i if i < 3 else 6 + i])
        reach = lever * age * choose(has_pace, 0.5 * (stride + age) * push, fastest)
        slack = 6.0 * math.sqrt(variances * pose_noise(f, i)) + reach
        miss = moved[i] - choose(has_pace, age * m.pace[i], 0.0)
        near = near & opposite(measured & (abs(miss) > slack))
        m.pace[i] = choose(measured, moved[i] / max(age, 1e-9), m.pace[i])
        moved[i] = miss
    return near


@compiled
def _is_back(f: Record, pose: Array, with_position: bool, with_attitude: bool) -> bool:
    """Return whether poses are back from where they jumped to, or never were away.

    The likelihood of a pose says little after half a second without one, and the vehicle's reach in
    that time even less. The sum of the jumps from pose to pose is known to the poses' noise,
    however old the first of them. So poses are back once the jumps since the last believed one
    cancel.

    Jumps that do not cancel leave two hypotheses: the pose still is off by their sum, or never was.
    Each has its innovation. The second is believed if likelier by as much as the gate asks of a
    pose. A covariance larger than the sum of the jumps cannot decide.

    Poses at random may cancel and even agree with the one before by chance. So after more than one
    refusal three have to go on from each other.
    """
    x, P, m, miss, cancelled = f.x, f.P, f.poses, f.miss, True
    attitude_error(pose[3:7], x[3:7], miss[0:3])
    gained = choose(with_position, 0.0, 0.0)
    for i in range(6):
        stray = abs(m.jump[i])
        if i < 3:
            measured, row, off = with_attitude, i, miss[i]
        else:
            measured, row, off = with_position, 3 + i, pose[i - 3] - x[i - 3]
        cancelled = cancelled & opposite(measured & (stray > m.blur[i]))
        # NIS if the pose still is where it jumped to, less that if it never was; in either
        # direction, since half a turn has none
        odds = stray * (stray - 2.0 * abs(off)) / (P[row, row] + pose_noise(f, i))
        gained += choose(measured, odds, 0.0)
    sure = (m.phase < REFUSING) | (m.agreeing > AGREEING - 0.5)
    back: bool = (cancelled | (gained > f.alarm[0])) & sure
    return back


@compiled
def _remember_refused(f: Record, pose: Array, at_position: bool, at_attitude: bool) -> None:
    """Keep the parts of a pose that are refused now, and for how long those refused have agreed."""
    m = f.poses
    agreed_for = m.agreed_for + min(m.doubted_position_age, m.doubted_attitude_age)
    agreed_for = choose(m.agreeing > 1.5, agreed_for, 0.0)
    m.agreed_for = choose(at_position | at_attitude, agreed_for, m.agreed_for)
    for i in range(7):
        m.doubted[i] = choose(at_position if i < 3 else at_attitude, pose[i], m.doubted[i])
    m.doubted_position_age = choose(at_position, 0.0, m.doubted_position_age)
    m.doubted_attitude_age = choose(at_attitude, 0.0, m.doubted_attitude_age)


@compiled
def _outlasts(f: Record, with_position: bool, refused: bool) -> bool:
    """Return whether refused poses have lasted too long to be wrong: they have agreed with each
    other for ``Recovery.patience``, or nothing was believed for ``Recovery.give_up``. Only the
    second leaves something in ``f.disagreement``.
    """
    m = f.poses
    at_odds = refused & (choose(with_position, m.position_age, m.attitude_age) > f.give_up)
    for i in range(6):
        f.disagreement[i] = choose(at_odds, f.disagreement[i], 0.0)
    lasting: bool = at_odds | (m.agreed_for > f.patience)
    return lasting


@compiled
def _restart(f: Record, pose: Array, at_position: bool, at_attitude: bool) -> None:
    """Start pose and twist anew at what was measured, as well known as ``f.disagreement`` says, and
    doubt the wrench.
    """
    x, P, prior, miss = f.x, f.P, f.prior, f.disagreement
    restarted = at_position | at_attitude
    aliased = at_attitude & _turns_between(f)
    _forget(f, at_position, at_attitude, False)
    for i in range(4):
        x[3 + i] = choose(at_attitude, pose[3 + i], x[3 + i])
    for i in range(3):
        variance = min(pose_noise(f, i) + miss[i] * miss[i], prior[i])
        P[i, i] = choose(at_attitude, variance, P[i, i])
        variance = min(pose_noise(f, 3 + i) + miss[3 + i] * miss[3 + i], prior[6 + i])
        P[6 + i, 6 + i] = choose(at_position, variance, P[6 + i, 6 + i])
        x[i] = choose(at_position, pose[i], x[i])
        # the twist is still the best guess, unless none of such a vehicle
        mad = at_position & (x[7 + i] * x[7 + i] > 4.0 * prior[9 + i])
        x[7 + i] = choose(mad, 0.0, x[7 + i])
        mad = aliased | (at_attitude & (x[10 + i] * x[10 + i] > 4.0 * prior[3 + i]))
        x[10 + i] = choose(mad, 0.0, x[10 + i])
    for i in range(12, N):
        for j in range(12):
            P[i, j] = choose(restarted, 0.0, P[i, j])
            P[j, i] = choose(restarted, 0.0, P[j, i])
        # a wrench that itself is out of all reason was made by what is now forgotten; any other may
        # have been
        mad = restarted & (x[1 + i] * x[1 + i] > f.reason[i - 12])
        x[1 + i] = choose(mad, 0.0, x[1 + i])
        doubt = prior[i] + x[1 + i] * x[1 + i]
        P[i, i] = choose(restarted & (P[i, i] < doubt), doubt, P[i, i])
    for i in range(6):
        f.poses.residual[i] = choose(
            at_attitude if i < 3 else at_position, 0.0, f.poses.residual[i]
        )
    f.restarts = choose(restarted, f.restarts + 1.0, f.restarts)
    # one that repeats another does not allow a third
    repeated = f.poses.settling > 0.0
    f.poses.settling = choose(restarted, choose(repeated, 0.0, f.patience), f.poses.settling)


@compiled
def remember(f: Record, pose: Array, with_position: bool, with_attitude: bool) -> None:
    """Keep the parts of a pose that are believed now. Refused poses are done with, unless what
    jumped in them was not measured now: an attitude alone says nothing of a position.
    """
    m, done = f.poses, with_position | with_attitude
    for i in range(7):
        m.seen[i] = choose(with_position if i < 3 else with_attitude, pose[i], m.seen[i])
    m.position_age = choose(with_position, 0.0, m.position_age)
    m.attitude_age = choose(with_attitude, 0.0, m.attitude_age)
    if f.gated > 0:
        for i in range(6):
            away = abs(m.jump[i]) > m.blur[i]
            done = done & ((with_attitude if i < 3 else with_position) | opposite(away))
        m.phase = choose(done, BELIEVING, m.phase)


@compiled
def doubted_variance(f: Record, out: Array) -> None:
    """Write into ``out`` (18,) what poses that jumped add to the variances of the error state.

    Either the poses are wrong or the filter is. Over ``Recovery.patience`` the weight of the second
    grows to one: a restart there would move the pose to the refused one, and leave twist and wrench
    a prior's variance. Without a gate the filter has followed, and the weight of the first falls
    from one to zero in that time.
    """
    x, m, patience = f.x, f.poses, f.patience
    weight = choose(m.phase > BELIEVING, 1.0 / patience, 0.0)
    attitude_error(m.doubted[3:7], x[3:7], out[0:3])
    # a part is in doubt where it was refused since it was believed last
    waited = choose(m.doubted_position_age < m.position_age, min(m.position_age, patience), 0.0)
    at_position = weight * waited
    waited = choose(m.doubted_attitude_age < m.attitude_age, min(m.attitude_age, patience), 0.0)
    at_attitude = weight * waited
    for i in range(3):
        away = m.doubted[i] - x[i]
        out[i] = at_attitude * min(out[i] * out[i], f.prior[i])
        out[6 + i] = at_position * min(away * away, f.prior[6 + i])
        out[3 + i] = at_attitude * f.prior[3 + i]
        out[9 + i] = at_position * f.prior[9 + i]
    astray = max(m.astray, 0.0) / patience
    for i in range(12, N):
        out[i] = max(max(at_position, at_attitude), astray) * f.prior[i]
