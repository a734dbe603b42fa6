"""What a filter does after a gap, and with a measurement that it cannot believe.

A Kalman filter's model knows none of four events. Each breaks something else:

* A *gap* makes the covariance grow. A part that is known no better than a prior is *lost*: pose and
  twist are held with the prior's covariance, and the next measurement restarts them.
* An *outlier* is a pose that jumps: far from the filter's expectation and, by more than a vehicle
  can move, from the pose just before. A gate refuses the pose and its successors, which a filter
  that has not seen for a while would take for likely. Poses are believed again once the jumps
  cancel, however wrong the wrench is. Or once the innovation says that there was no jump: a clock's
  blur also exceeds a vehicle's motion by a little.
* A *push* is harder than the random walk of the wrench expects. The pose is far from the
  expectation, yet goes on from the pose before. The filter takes the pose in, gate or not.
* A *jump for good* is an outlier whose successors all agree with each other. The filter restarts
  there after ``Recovery.patience``, without a gate at once. Poses that do not even agree with each
  other restart it after ``Recovery.give_up``, known no better than they disagree.

Whether refused poses agree is asked of the poses alone. A filter that took in a wrong attitude has
a velocity that runs away, and by that velocity two poses at one spot would not agree.

A restart sets pose and twist anew with a prior's covariance. Force and torque keep their estimates,
with variances so wide that there may be no wrench at all. A wrench that the model took for
impossible explains a contradiction as well as a pose that jumped, and after a gap nothing says that
the wrench still acts.
"""

import math
from dataclasses import dataclass, fields

import numpy as np

from ..dynamics.rotation import attitude_error
from ..dynamics.vehicle import Vehicle
from ..runtime.compiled import Record, compiled
from ..runtime.errors import InputError
from ..runtime.vector_lanes import any_of, choose
from .error_state import LARGEST_MRP_VARIANCE
from .estimate import COASTING, REJECTED, RESTARTED, Array

N = 18  # error state (rho, omega, x, v, torque, force)
NOISE = 12  # noise inputs of the prediction: motor torque, torque walk, thrust, force walk
_LOST = 0.9  # of a prior's variance: known no better than that
# poses that go on from each other before they are believed again: of poses 10 cm off in directions
# of their own one in a hundred goes on from the one before by chance, and two in a row 1e-4
AGREEING = 3


@dataclass(frozen=True)
class Recovery:
    """What the filter assumes of gaps, outliers and restarts; the defaults suit vehicles from 30 g
    to a few kg.

    Attributes:
        patience: s, after which refused poses in a row that agree with each other are believed;
            longer than the bursts of motion capture (0.1 to 0.5 s)
        give_up: s, after which refused poses are believed even though they do not agree.
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
        response: s, in which the filter follows a push of at most two weights, and the same about
            the arm; how far two poses in a row may lie apart follows.
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
        for f in fields(self):
            value = getattr(self, f.name)
            if not isinstance(value, int | float) or not (math.isfinite(value) and value > 0):
                raise InputError(
                    f"Recovery: {f.name} must be a positive finite number, got {value!r}"
                )


def load_recovery(record: np.void, vehicle: Vehicle, gate: float | None, given: Recovery) -> None:
    """Write a filter's gate (a probability or None) and recovery into its record, which has its
    period and kappa.
    """
    weight = vehicle.weight
    record["gated"] = gate is not None
    # largest NIS that is taken in unseen, of three numbers and of six
    jump_at = given.jump_at**2
    record["alarm"] = jump_at if gate is None else [largest_nis(gate, dof) for dof in (3, 6)]
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
    record["lost"] = np.repeat(np.square(deviations), 3)
    record["lost"] *= _LOST
    record["lost"][:3] = (given.attitude_std / 4.0) ** 2  # (16)
    record["prior"] = np.repeat(np.square(deviations), 3)
    # accelerations of a push of two weights, and of the same about the arm
    push = 2.0 * weight
    record["push"] = push * vehicle.arm_l / inertia, push / vehicle.mass
    record["response"] = given.response


def largest_nis(probability: float, dof: int) -> float:
    """Return the NIS below which a consistent measurement of ``dof`` numbers lies."""
    from scipy.stats import chi2

    return float(chi2.ppf(probability, dof))


@compiled
def after_prediction(f: Record, dt: float) -> None:
    """Count the time since the last measurements, keep the covariance within what a vehicle can do,
    and hold what is lost.
    """
    x, P, gap = f.x, f.P, f.gap
    f.status = COASTING
    for i in range(4):
        gap[i] += dt
    # over a gap variances grow without an end; at 16 times the prior's they have long lost their
    # meaning
    for i in range(3, N):
        wide = P[i, i] > 16.0 * f.prior[i]
        if any_of(wide):
            scale = choose(wide, math.sqrt(16.0 * f.prior[i] / P[i, i]), 1.0)
            for j in range(len(P)):
                P[i, j] *= scale
                P[j, i] *= scale
    if any_of((gap[0] > f.patience) | (gap[1] > f.patience) | (gap[0] < gap[1])):
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
    broken = choose(math.isfinite(total), 0.0, 1.0) > 0.5
    if any_of(broken):
        _start_over(f, broken)


@compiled
def _start_over(f: Record, broken: bool) -> None:
    x = f.x
    for i in range(7):
        x[i] = choose(broken, f.seen[i], x[i])
    for i in range(7, 19):
        x[i] = choose(broken, 0.0, x[i])
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
    lost_now: bool = wide & (f.gap[0] > f.patience)
    return lost_now


@compiled
def lost_attitude(f: Record) -> bool:
    """Return the same of attitude and angular velocity; or whether the attitude has become a guess
    while positions went on. These then are explained by a turn more or less as well as by a force,
    from sigma points that reach half a turn: rates run away and rounding errors grow.
    """
    P, lost = f.P, f.lost
    guessed = (P[0, 0] > lost[0]) | (P[1, 1] > lost[1]) | (P[2, 2] > lost[2])
    wide = guessed | (P[3, 3] > lost[3]) | (P[4, 4] > lost[4]) | (P[5, 5] > lost[5])
    lost_now: bool = (wide & (f.gap[1] > f.patience)) | (guessed & (f.gap[0] < f.gap[1]))
    return lost_now


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
def judge(
    f: Record,
    position: Array,
    quaternion: Array,
    with_position: bool,
    with_attitude: bool,
    nis: float,
    alarming: bool,
) -> bool:
    """Decide about a measurement that is unlikely (``alarming``) or comes when its part of the
    state is lost; restart there if it must be.

    Returns whether it is to be taken in as any other, by a linear correction.
    """
    taken = with_position | with_attitude
    lost = (with_position & lost_position(f)) | (with_attitude & lost_attitude(f))
    gap, first = f.gap, f.refused < 0.5
    reachable = continues(
        f, position, quaternion, f.seen, gap[0], gap[1], with_position, with_attitude
    )
    back = first
    if f.gated > 0:
        back = _returned(f, position, quaternion, with_position, with_attitude, alarming, reachable)
    going_on = choose(first, choose(reachable, 1.0, 0.0), choose(back, 1.0, 0.0)) > 0.5
    # among refused ones a likely pose too has to come back first
    asked = alarming | (taken & (f.refused > 0.5))
    refused = choose(asked & (choose(lost | going_on, 1.0, 0.0) < 0.5), 1.0, 0.0)
    aliased = with_attitude & turns_between(f)
    hopeless = choose(nis <= f.restart_at, 0.0, 1.0) > 0.5
    contradicted = alarming & (going_on & (hopeless | aliased))
    if f.gated > 0:
        lasting = choose(f.in_row > 1.5, f.lasting + min(gap[2], gap[3]), 0.0)
        f.lasting = choose(refused > 0.5, lasting, f.lasting)
        position_doubted = (refused > 0.5) & with_position
        attitude_doubted = (refused > 0.5) & with_attitude
        for i in range(3):
            f.doubted[i] = choose(position_doubted, position[i], f.doubted[i])
        for i in range(4):
            f.doubted[3 + i] = choose(attitude_doubted, quaternion[i], f.doubted[3 + i])
        gap[2] = choose(position_doubted, 0.0, gap[2])
        gap[3] = choose(attitude_doubted, 0.0, gap[3])
        waited = choose(with_position, gap[0], gap[1])
        at_odds = (refused > 0.5) & (waited > f.give_up)
        contradicted = contradicted | at_odds | ((refused > 0.5) & (f.lasting > f.patience))
        for i in range(6):
            f.mean[12 + i] = choose(at_odds, f.mean[12 + i], 0.0)
    else:
        contradicted = contradicted | (refused > 0.5)
        for i in range(6):
            f.mean[12 + i] = 0.0
    refused = choose(contradicted, 0.0, refused)
    restarted = taken & (lost | contradicted)
    f.refused = choose(refused > 0.5, f.refused + 1.0, f.refused)
    f.status = choose(refused > 0.5, REJECTED, f.status)
    _restart(f, position, quaternion, restarted & with_position, restarted & with_attitude)
    f.restarts = choose(restarted, f.restarts + 1.0, f.restarts)
    f.status = choose(restarted, RESTARTED, f.status)
    remember(f, position, quaternion, restarted & with_position, restarted & with_attitude)
    plain: bool = taken & (choose(restarted, 1.0, refused) < 0.5)
    return plain


@compiled
def _returned(
    f: Record,
    position: Array,
    quaternion: Array,
    with_position: bool,
    with_attitude: bool,
    alarming: bool,
    reachable: bool,
) -> bool:
    """Return whether poses are back from where they jumped to, or never were away.

    How likely a pose is says little after half a second without one, and where a vehicle could have
    got to in that time even less; what jumps from one pose to the next add up to is known to their
    noise however long ago the first of them was. So poses are back where the jumps since the last
    one that was believed cancel.

    Jumps that do not cancel leave two hypotheses: the pose still is off by their sum, or it never
    was. Each has its innovation. The second is believed where it is the likelier by as much as the
    gate asks of a pose; a covariance that has grown beyond the sum of the jumps cannot say so.

    Poses at random may cancel and even agree with the one before by chance, so of more than one
    that were refused three have to go on from each other.
    """
    x, P, gap, jumps, miss = f.x, f.P, f.gap, f.jumps, f.mean
    taken, first = with_position | with_attitude, f.refused < 0.5
    for i in range(7):
        f.doubted[i] = choose(first, f.seen[i], f.doubted[i])
    for k in range(2):
        gap[2 + k] = choose(first, gap[k], gap[2 + k])
        f.stride[k] = choose(first, 0.0, f.stride[k])
        for i in range(6):
            jumps[k, i] = choose(first, 0.0, jumps[k, i])
    agreed = _agrees(f, position, quaternion, with_position, with_attitude)
    in_row = choose(first, 1.0, choose(agreed, f.in_row + 1.0, 1.0))
    f.in_row = choose(taken, in_row, f.in_row)
    for k in range(2):
        known = choose(first, 0.0, choose(agreed, gap[2 + k], 0.0))
        f.stride[k] = choose(with_position if k == 0 else with_attitude, known, f.stride[k])
    follows = continues(
        f, position, quaternion, f.doubted, gap[2], gap[3], with_position, with_attitude
    )
    jumped = choose(follows, 0.0, 1.0) > 0.5
    for i in range(6):
        counts = jumped & (with_attitude if i < 3 else with_position)
        for k in range(2):
            jumps[k, i] += choose(counts, miss[6 * k + i], 0.0)
    attitude_error(quaternion, x[3:7], miss[0:3])
    away, gained = choose(taken, 0.0, 1.0), choose(taken, 0.0, 0.0)
    for i in range(6):
        stray = abs(jumps[0, i])
        if i < 3:
            measured, row, off = with_attitude, i, miss[i]
        else:
            measured, row, off = with_position, 3 + i, position[i - 3] - x[i - 3]
        away += choose(measured & (stray > jumps[1, i]), 1.0, 0.0)
        # NIS if the pose still is where it jumped to, less that if it never was; in either
        # direction, since half a turn has none
        odds = stray * (stray - 2.0 * abs(off)) / (P[row, row] + f.noise[i])
        gained += choose(measured, odds, 0.0)
    over = (away < 0.5) | (gained > f.alarm[0])
    sure = (f.refused < 1.5) | (f.in_row > AGREEING - 0.5)
    likely = choose(alarming, 0.0, 1.0) > 0.5
    back: bool = (f.refused > 0.5) & over & (sure & (likely | reachable))
    return back


@compiled
def _agrees(
    f: Record, position: Array, quaternion: Array, with_position: bool, with_attitude: bool
) -> bool:
    """Return whether a pose goes on from the poses that were refused before it, whatever the filter
    believes of the vehicle's motion.

    Two poses lie no farther apart than a vehicle gets at six times the prior's deviation of its
    speed. A third goes on with the motion from the first to the second, give or take six deviations
    of the three measurements and a push. Leaves that motion, per second, in ``f.pace``, and in the
    last third of ``f.mean`` by how much the pose misses.
    """
    moved, pace, noise = f.mean[12:18], f.pace, f.noise
    attitude_error(quaternion, f.doubted[3:7], moved[0:3])
    apart = choose(with_position, 0.0, 0.0)
    for i in range(6):
        if i < 3:
            measured, k, lever = with_attitude, 1, 0.25  # an MRP is a quarter of an angle
        else:
            measured, k, lever = with_position, 0, 1.0
            moved[i] = position[i - 3] - f.doubted[i - 3]
        age, stride = f.gap[2 + k], f.stride[k]
        has_pace = stride > 0.0
        ratio = age / max(stride, 1e-9)
        variances = choose(has_pace, 1.0 + (1.0 + ratio) * (1.0 + ratio) + ratio * ratio, 2.0)
        fastest = 6.0 * math.sqrt(f.prior[3 + i if i < 3 else 6 + i])
        pushed = 0.5 * (stride + age) * f.push[1 - k]
        reach = lever * age * choose(has_pace, pushed, fastest)
        slack = 6.0 * math.sqrt(variances * noise[i]) + reach
        miss = moved[i] - choose(has_pace, age * pace[i], 0.0)
        apart += choose(measured & (abs(miss) > slack), 1.0, 0.0)
        pace[i] = choose(measured, moved[i] / max(age, 1e-9), pace[i])
        moved[i] = miss
    near: bool = apart < 0.5
    return near


@compiled
def turns_between(f: Record) -> bool:
    """Return whether the vehicle is estimated to turn by more than half a turn from one measured
    attitude to the next: as many attitudes are explained by one turn more in each, or one less.

    Where attitudes contradict the filter as well, it has taken a vehicle that was elsewhere for one
    that spins, and a torque for what keeps it spinning up.
    """
    x, age = f.x, f.gap[1]
    rate = x[10] * x[10] + x[11] * x[11] + x[12] * x[12]
    more: bool = rate * age * age > math.pi * math.pi
    return more


@compiled
def continues(
    f: Record,
    position: Array,
    quaternion: Array,
    before: Array,
    position_age: float,
    attitude_age: float,
    with_position: bool,
    with_attitude: bool,
) -> bool:
    """Return whether a pose can follow an earlier one (7,) that was measured some seconds before,
    of a vehicle that moves as estimated, give or take six standard deviations and a push.

    Leaves in ``f.mean`` by how much it misses, MRP and m (6,), and by how much it may (6,).
    """
    x, P, error = f.x, f.P, f.mean
    attitude_error(quaternion, before[3:7], error[0:3])
    far = choose(with_position, 0.0, 0.0)
    rate = math.sqrt(x[10] * x[10] + x[11] * x[11] + x[12] * x[12])
    for i in range(6):
        # the difference of two measurements, at six standard deviations
        slack = 6.0 * math.sqrt(2.0 * f.noise[i])
        if i < 3:
            age, measured = attitude_age, with_attitude
            slack = slack + 0.25 * age * (
                rate + 6.0 * math.sqrt(P[3 + i, 3 + i]) + f.push[0] * (f.response + 0.5 * age)
            )
        else:
            age, measured = position_age, with_position
            error[i] = position[i - 3] - before[i - 3] - age * x[4 + i]
            slack = slack + age * (
                6.0 * math.sqrt(P[6 + i, 6 + i]) + f.push[1] * (f.response + 0.5 * age)
            )
        error[6 + i] = slack
        far += choose(measured & (abs(error[i]) > slack), 1.0, 0.0)
    near: bool = far < 0.5
    return near


@compiled
def _restart(
    f: Record,
    position: Array,
    quaternion: Array,
    at_position: bool,
    at_attitude: bool,
) -> None:
    """Start pose and twist anew at what was measured, and doubt the wrench. The last third of
    ``f.mean`` is by how much poses disagree with each other.
    """
    x, P, prior, miss = f.x, f.P, f.prior, f.mean[12:18]
    restarted = at_position | at_attitude
    aliased = at_attitude & turns_between(f)
    _forget(f, at_position, at_attitude, False)
    for i in range(4):
        x[3 + i] = choose(at_attitude, quaternion[i], x[3 + i])
    for i in range(3):
        variance = min(f.noise[i] + miss[i] * miss[i], prior[i])
        P[i, i] = choose(at_attitude, variance, P[i, i])
        variance = min(f.noise[3 + i] + miss[3 + i] * miss[3 + i], prior[6 + i])
        P[6 + i, 6 + i] = choose(at_position, variance, P[6 + i, 6 + i])
        x[i] = choose(at_position, position[i], x[i])
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


@compiled
def remember(
    f: Record, position: Array, quaternion: Array, with_position: bool, with_attitude: bool
) -> None:
    """Keep the pose that was believed last, and note that it was now. Refused ones are done with,
    unless what jumped in them was not measured now: an attitude alone says nothing of a position.
    """
    seen, gap, jumps = f.seen, f.gap, f.jumps
    for i in range(3):
        seen[i] = choose(with_position, position[i], seen[i])
    for i in range(4):
        seen[3 + i] = choose(with_attitude, quaternion[i], seen[3 + i])
    gap[0] = choose(with_position, 0.0, gap[0])
    gap[1] = choose(with_attitude, 0.0, gap[1])
    away = choose(with_position, 0.0, 0.0)
    if f.gated > 0:
        for i in range(6):
            unmeasured = choose(with_attitude if i < 3 else with_position, 0.0, 1.0) > 0.5
            away += choose(unmeasured & (abs(jumps[0, i]) > jumps[1, i]), 1.0, 0.0)
    f.refused = choose((with_position | with_attitude) & (away < 0.5), 0.0, f.refused)


@compiled
def doubted_variance(f: Record, out: Array) -> None:
    """Write into ``out`` (18,) what refused poses add to the variances of the error state.

    Either the poses are wrong or the filter is. Over ``Recovery.patience`` the weight of the second
    grows to one: a restart there would move the pose to the refused one, and leave twist and wrench
    a prior's variance.
    """
    x, doubted, weight = f.x, f.doubted, choose(f.refused > 0.5, 1.0 / f.patience, 0.0)
    attitude_error(doubted[3:7], x[3:7], out[0:3])
    # a part is in doubt where it was refused since it was believed last
    at_position = weight * choose(f.gap[2] < f.gap[0], min(f.gap[0], f.patience), 0.0)
    at_attitude = weight * choose(f.gap[3] < f.gap[1], min(f.gap[1], f.patience), 0.0)
    for i in range(3):
        away = doubted[i] - x[i]
        out[i] = at_attitude * min(out[i] * out[i], f.prior[i])
        out[6 + i] = at_position * min(away * away, f.prior[6 + i])
        out[3 + i] = at_attitude * f.prior[3 + i]
        out[9 + i] = at_position * f.prior[9 + i]
    for i in range(12, N):
        out[i] = max(at_position, at_attitude) * f.prior[i]
