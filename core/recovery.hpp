// Recovery of a filter from gaps, from poses noisier than declared, and from wrong poses:
// estimator/recovery.py has the reasons, and the table of phases and verdicts.
//
// What is rare is written for single numbers, with plain `if`s. A lane that leaves the normal path
// is copied out to a single filter, and copied back.
#pragma once
#include "linear_algebra.hpp"
#include "noise.hpp"

namespace windwrench {

// poses in a row, in agreement, before they are believed again. With poses 10 cm off in random
// directions one in a hundred agrees with the one before by chance, and two in a row 1e-4
constexpr double AGREEING = 3;

// Do something that is rare with a single filter, or with each lane of several
template <class T, class F> void one_by_one(Belief<T> &f, F with) {
  if constexpr (is_single<T>) {
    with(f);
  } else {
    for (int i = 0; i < lanes_of<T>; i++) {
      Belief<Single<T>> one;
      take_lane<T>(f, i, one);
      with(one);
      put_lane<T>(f, i, one);
    }
  }
}

// Is the attitude known no better than Recovery.attitude_std?
template <class S> bool is_guessed(const Settings<S> &s, const Belief<S> &f) {
  return f.P[0][0] > s.lost[0] || f.P[1][1] > s.lost[1] || f.P[2][2] > s.lost[2];
}

// Have position and velocity long not been measured, and are known no better than a prior?
template <class S> bool lost_position(const Settings<S> &s, const Belief<S> &f) {
  bool wide = false;
  for (int i = 6; i < 12; i++) wide |= f.P[i][i] > s.lost[i];
  return wide && f.poses.position_age > s.patience;
}

// The same of attitude and rate; or has the attitude become a guess while positions went on? These
// then are explained by a turn more or less as well as by a force
template <class S> bool lost_attitude(const Settings<S> &s, const Belief<S> &f) {
  const Poses<S> &m = f.poses;
  bool guessed = is_guessed(s, f), wide = guessed;
  for (int i = 3; i < 6; i++) wide |= f.P[i][i] > s.lost[i];
  return (wide && m.attitude_age > s.patience) || (guessed && m.position_age < m.attitude_age);
}

// Give what is forgotten the prior's covariance, and none with the rest
template <class S>
void forget(const Settings<S> &s, bool position, bool attitude, bool wrench, Belief<S> &f) {
  for (int i = 0; i < N; i++)
    if (i < 6 ? attitude : i < 12 ? position : wrench) {
      for (int j = 0; j < N; j++) f.P[i][j] = f.P[j][i] = S(0);
      f.P[i][i] = s.prior[i];
    }
}

// Hold what is lost after a prediction over dt s where it was before: its velocity is zero
template <class S> void hold_lost(const Settings<S> &s, S dt, Belief<S> &f) {
  Poses<S> &m = f.poses;
  if (m.position_age > s.patience || m.attitude_age > s.patience ||
      m.position_age < m.attitude_age) {
    bool position = lost_position(s, f), attitude = lost_attitude(s, f);
    forget(s, position, attitude, false, f);
    for (int i = 0; i < 3; i++) {
      if (position) {
        f.x[i] -= S(0.5) * dt * f.x[VELOCITY + i];
        f.x[VELOCITY + i] = S(0);
      }
      if (attitude) f.x[RATE + i] = S(0);
    }
  }
}

// Have inputs that no vehicle can have (rotor speeds of 1e200 rad/s) made numbers overflow? A float
// overflows sooner than a double: all of P is looked at
template <class T> Answer<T> is_broken(const Belief<T> &f) {
  T total = f.x[0];
  for (int i = 1; i < NIS; i++) total += f.x[i];
  for (int i = 0; i < N; i++) {
    T row = f.P[i][i];
    for (int j = 0; j < i; j++) row += f.P[i][j];
    total += row;
  }
  return opposite(finite(total));
}

// Begin again at the last pose that was believed, if numbers overflowed
template <class S> void start_over_if_broken(const Settings<S> &s, Belief<S> &f) {
  if (!is_broken(f)) return;
  for (int i = 0; i < NIS; i++) f.x[i] = i < 7 ? f.poses.seen[i] : S(0);
  forget(s, true, true, true, f);
  f.restarts += S(1);
  f.status = S(RESTARTED);
}

// After a prediction over dt s: count the time since the last measurements, keep the covariance
// within what a vehicle can do, and hold what is lost
template <class T> void after_prediction(const Settings<Single<T>> &s, Single<T> dt, Belief<T> &f) {
  using S = Single<T>;
  const Poses<T> &m = f.poses;
  f.status = T{} + S(COASTING);
  grow_older(s, dt, f);
  // over a gap variances grow without an end; at 16 times the prior's they have lost their meaning
  for (int i = 3; i < N; i++) bound_variance<N>(f.P, i, S(16) * s.prior[i]);
  T patience = T{} + s.patience;
  if (any((m.position_age > patience) | (m.attitude_age > patience) |
          (m.position_age < m.attitude_age) | is_broken(f)))
    one_by_one(f, [&](Belief<S> &one) {
      hold_lost(s, dt, one);
      start_over_if_broken(s, one);
    });
}

// Is the vehicle estimated to turn by more than half a turn from one measured attitude to the next?
// As many attitudes are explained by one turn more in each, or one less
template <class S> bool turns_between(const Belief<S> &f) {
  const S *w = f.x + RATE, age = f.poses.attitude_age;
  return (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * age * age > S(PI * PI);
}

// Is an unlikely pose beyond what a linear correction can follow? Just after a restart a wrench of
// any size is likely: an unlikely pose then means an attitude or a rate off by more than that
template <class S>
bool is_beyond(const Settings<S> &s, const Belief<S> &f, bool with_attitude, S nis) {
  bool far = turns_between(f) || f.poses.settling > S(0);
  return !(nis <= s.restart_at) || (with_attitude && far);
}

// Can a pose follow an earlier one (7) that was measured some seconds before, of a vehicle that
// moves as estimated, give or take six standard deviations and a push? miss (6), MRP and m: by how
// much it misses; slack (6): by how much it may
template <class S>
bool continues(const Settings<S> &s, const Belief<S> &f, const S *pose, const S *before,
               S position_age, S attitude_age, bool with_position, bool with_attitude, S *miss,
               S *slack) {
  const S *w = f.x + RATE;
  bool near = true;
  attitude_error(pose + 3, before + 3, miss);
  S rate = root(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
  for (int i = 0; i < 6; i++) {
    S age = i < 3 ? attitude_age : position_age;
    bool measured = i < 3 ? with_attitude : with_position;
    // the difference of two measurements, at six standard deviations
    slack[i] = S(6) * root(S(2) * s.noise[i] * likeliest_scale(f, i));
    if (i < 3) {
      slack[i] += S(0.25) * age *
                  (rate + S(6) * root(f.P[3 + i][3 + i]) + s.push[0] * (s.response + S(0.5) * age));
    } else {
      miss[i] = pose[i - 3] - before[i - 3] - age * f.x[4 + i];
      slack[i] += age * (S(6) * root(f.P[6 + i][6 + i]) + s.push[1] * (s.response + S(0.5) * age));
    }
    if (measured && absolute(miss[i]) > slack[i]) near = false;
  }
  return near;
}

// Does a pose go on from the poses that were refused before it, whatever the filter believes of the
// vehicle's motion? Two lie no farther apart than a vehicle gets at six times the prior's deviation
// of its speed; a third goes on with the motion from the first to the second, give or take six
// deviations of the three measurements and a push. Leaves that motion, per second, in the memory,
// and in `missed` (6) by how much the pose misses
template <class S>
bool agrees(const Settings<S> &s, Belief<S> &f, const S *pose, bool with_position,
            bool with_attitude, S *missed) {
  Poses<S> &m = f.poses;
  bool near = true;
  attitude_error(pose + 3, m.doubted + 3, missed);
  for (int i = 0; i < 6; i++) {
    bool measured = i < 3 ? with_attitude : with_position;
    S age = i < 3 ? m.doubted_attitude_age : m.doubted_position_age;
    S stride = i < 3 ? m.attitude_stride : m.position_stride;
    S lever = i < 3 ? S(0.25) : S(1),
      push = s.push[i < 3 ? 0 : 1];  // an MRP: a quarter of an angle
    if (i >= 3) missed[i] = pose[i - 3] - m.doubted[i - 3];
    bool has_pace = stride > S(0);
    S ratio = age / larger(stride, S(1e-9));
    S variances = has_pace ? S(1) + (S(1) + ratio) * (S(1) + ratio) + ratio * ratio : S(2);
    S fastest = S(6) * root(s.prior[i < 3 ? 3 + i : 6 + i]);
    S reach = lever * age * (has_pace ? S(0.5) * (stride + age) * push : fastest);
    S slack = S(6) * root(variances * pose_noise(s, f, i)) + reach;
    S miss = missed[i] - (has_pace ? age * m.pace[i] : S(0));
    if (measured && absolute(miss) > slack) near = false;
    if (measured) m.pace[i] = missed[i] / larger(age, S(1e-9));
    missed[i] = miss;
  }
  return near;
}

// Remember how a pose goes on from those that were refused before it: whether it agrees with them,
// and by how much it jumped. The first is compared with the pose that was believed last
template <class S>
void compare_refused(const Settings<S> &s, Belief<S> &f, const S *pose, bool with_position,
                     bool with_attitude, S *missed) {
  Poses<S> &m = f.poses;
  bool first = m.phase == S(BELIEVING);
  if (first) {
    for (int i = 0; i < 7; i++) m.doubted[i] = m.seen[i];
    m.doubted_position_age = m.position_age;
    m.doubted_attitude_age = m.attitude_age;
    m.position_stride = m.attitude_stride = S(0);
    for (int i = 0; i < 6; i++) m.jump[i] = m.blur[i] = S(0);
  }
  bool agreed = agrees(s, f, pose, with_position, with_attitude, missed) && !first;
  if (with_position || with_attitude) m.agreeing = agreed ? m.agreeing + S(1) : S(1);
  if (with_position) m.position_stride = agreed ? m.doubted_position_age : S(0);
  if (with_attitude) m.attitude_stride = agreed ? m.doubted_attitude_age : S(0);
  S miss[6], slack[6];
  bool jumped = !continues(s, f, pose, m.doubted, m.doubted_position_age, m.doubted_attitude_age,
                           with_position, with_attitude, miss, slack);
  for (int i = 0; i < 6; i++)
    if (jumped && (i < 3 ? with_attitude : with_position)) {
      m.jump[i] += miss[i];
      m.blur[i] += slack[i];
    }
}

// Are poses back from where they jumped to, or never were away? The sum of the jumps from pose to
// pose is known to the poses' noise, however old the first of them: poses are back once the jumps
// since the last believed one cancel. Jumps that do not cancel leave two hypotheses: the pose still
// is off by their sum, or never was. The second is believed if likelier by as much as the gate asks
// of a pose. After more than one refusal three have to go on from each other
template <class S>
bool is_back(const Settings<S> &s, const Belief<S> &f, const S *pose, bool with_position,
             bool with_attitude) {
  const Poses<S> &m = f.poses;
  bool cancelled = true;
  S miss[3], gained = S(0);
  attitude_error(pose + 3, f.x + QUATERNION, miss);
  for (int i = 0; i < 6; i++) {
    bool measured = i < 3 ? with_attitude : with_position;
    int row = i < 3 ? i : 3 + i;
    S off = i < 3 ? miss[i] : pose[i - 3] - f.x[i - 3], stray = absolute(m.jump[i]);
    if (!measured) continue;
    if (stray > m.blur[i]) cancelled = false;
    // NIS if the pose still is where it jumped to, less that if it never was; in either direction,
    // since half a turn has none
    gained += stray * (stray - S(2) * absolute(off)) / (f.P[row][row] + pose_noise(s, f, i));
  }
  bool sure = m.phase < S(REFUSING) || m.agreeing > S(AGREEING - 0.5);
  return (cancelled || gained > s.alarm[0]) && sure;
}

// Keep the parts of a pose that are refused now, and for how long those refused have agreed
template <class S>
void remember_refused(Belief<S> &f, const S *pose, bool at_position, bool at_attitude) {
  Poses<S> &m = f.poses;
  if (!(at_position || at_attitude)) return;
  S longer = m.agreed_for + smaller(m.doubted_position_age, m.doubted_attitude_age);
  m.agreed_for = m.agreeing > S(1.5) ? longer : S(0);
  for (int i = 0; i < 7; i++)
    if (i < 3 ? at_position : at_attitude) m.doubted[i] = pose[i];
  if (at_position) m.doubted_position_age = S(0);
  if (at_attitude) m.doubted_attitude_age = S(0);
}

// Start pose and twist anew at what was measured, as well known as `missed` (6) says, and doubt the
// wrench
template <class S>
void restart(const Settings<S> &s, Belief<S> &f, const S *pose, bool at_position, bool at_attitude,
             const S *missed) {
  if (!(at_position || at_attitude)) return;
  Poses<S> &m = f.poses;
  bool aliased = at_attitude && turns_between(f);
  forget(s, at_position, at_attitude, false, f);
  for (int i = 0; i < 4; i++)
    if (at_attitude) f.x[QUATERNION + i] = pose[3 + i];
  for (int i = 0; i < 3; i++) {
    S *v = f.x + VELOCITY + i, *w = f.x + RATE + i;
    if (at_attitude) f.P[i][i] = smaller(pose_noise(s, f, i) + missed[i] * missed[i], s.prior[i]);
    if (at_position) {
      S variance = pose_noise(s, f, 3 + i) + missed[3 + i] * missed[3 + i];
      f.P[6 + i][6 + i] = smaller(variance, s.prior[6 + i]);
      f.x[i] = pose[i];
      // the twist is still the best guess, unless none of such a vehicle
      if (*v * *v > S(4) * s.prior[9 + i]) *v = S(0);
    }
    if (aliased || (at_attitude && *w * *w > S(4) * s.prior[3 + i])) *w = S(0);
  }
  for (int i = 12; i < N; i++) {
    S &wrench = f.x[1 + i];
    for (int j = 0; j < 12; j++) f.P[i][j] = f.P[j][i] = S(0);
    // a wrench that itself is out of all reason was made by what is now forgotten; any other may
    // have been
    if (wrench * wrench > s.reason[i - 12]) wrench = S(0);
    S doubt = s.prior[i] + wrench * wrench;
    if (f.P[i][i] < doubt) f.P[i][i] = doubt;
  }
  for (int i = 0; i < 6; i++)
    if (i < 3 ? at_attitude : at_position) m.residual[i] = S(0);
  f.restarts += S(1);
  // one that repeats another does not allow a third
  m.settling = m.settling > S(0) ? S(0) : s.patience;
}

// The verdict on a pose that is unlikely, comes when its part is lost, or comes after refused ones;
// changes the phase, and restarts where that is the verdict. At least a part of it was measured
template <class S>
Status judge(const Settings<S> &s, Belief<S> &f, const S *pose, bool with_position,
             bool with_attitude, S nis, bool unlikely) {
  Poses<S> &m = f.poses;
  bool believing = m.phase == S(BELIEVING);
  bool lost = (with_position && lost_position(s, f)) || (with_attitude && lost_attitude(s, f));
  bool beyond = (unlikely && is_beyond(s, f, with_attitude, nis)) ||
                (!believing && with_attitude && is_guessed(s, f));
  S miss[6], slack[6], missed[6] = {};
  bool explained = continues(s, f, pose, m.seen, m.position_age, m.attitude_age, with_position,
                             with_attitude, miss, slack);
  if (s.gated > 0) {
    compare_refused(s, f, pose, with_position, with_attitude, missed);
    bool back = is_back(s, f, pose, with_position, with_attitude) && (explained || !unlikely);
    if (!believing) explained = back;
  }
  // among refused ones a likely pose too has to come back first
  bool refused = (unlikely || !believing) && !(lost || explained);
  bool restarted = lost || (explained && beyond);
  if (s.gated > 0) {
    remember_refused(f, pose, refused && with_position, refused && with_attitude);
    // refused ones have lasted too long to be wrong: they have agreed with each other for
    // Recovery.patience, or nothing was believed for Recovery.give_up, and they are at odds
    bool at_odds = refused && (with_position ? m.position_age : m.attitude_age) > s.give_up;
    for (int i = 0; i < 6; i++)
      if (!at_odds) missed[i] = S(0);
    if (refused && (at_odds || m.agreed_for > s.patience)) {
      restarted = true;
      refused = false;
    }
    if (refused) m.phase = S(believing ? ONE_REFUSED : REFUSING);
  } else if (refused) {
    restarted = true;
    m.astray = s.patience;
  }
  restart(s, f, pose, restarted && with_position, restarted && with_attitude, missed);
  return restarted ? RESTARTED : refused ? REJECTED : TRACKING;
}

// Keep the parts of a pose that are believed now. Refused poses are done with, unless what jumped
// in them was not measured now: an attitude alone says nothing of a position
template <class T, class A>
void remember(const Settings<Single<T>> &s, const T *pose, A with_position, A with_attitude,
              Belief<T> &f) {
  using S = Single<T>;
  Poses<T> &m = f.poses;
  for (int i = 0; i < 7; i++)
    m.seen[i] = choose(i < 3 ? with_position : with_attitude, pose[i], m.seen[i]);
  m.position_age = choose(with_position, T{}, m.position_age);
  m.attitude_age = choose(with_attitude, T{}, m.attitude_age);
  if (s.gated > 0) {
    A done = with_position | with_attitude;
    for (int i = 0; i < 6; i++) {
      auto away = absolute(m.jump[i]) > m.blur[i];
      done = done & ((i < 3 ? with_attitude : with_position) | opposite(away));
    }
    m.phase = choose(done, T{} + S(BELIEVING), m.phase);
  }
}

// What poses that jumped add to the variances of the error state, out (18). Either the poses are
// wrong or the filter is. Over Recovery.patience the weight of the second grows to one: a restart
// there would move the pose to the refused one, and leave twist and wrench a prior's variance.
// Without a gate the filter has followed, and the weight of the first falls from one to zero in
// that time
template <class S> void doubted_variance(const Settings<S> &s, const Belief<S> &f, S *out) {
  const Poses<S> &m = f.poses;
  S weight = m.phase > S(BELIEVING) ? S(1) / s.patience : S(0), none = S(0);
  attitude_error(m.doubted + 3, f.x + QUATERNION, out);
  // a part is in doubt where it was refused since it was believed last
  S waited = m.doubted_position_age < m.position_age ? smaller(m.position_age, s.patience) : none;
  S at_position = weight * waited;
  waited = m.doubted_attitude_age < m.attitude_age ? smaller(m.attitude_age, s.patience) : none;
  S at_attitude = weight * waited;
  for (int i = 0; i < 3; i++) {
    S away = m.doubted[i] - f.x[i];
    out[i] = at_attitude * smaller(out[i] * out[i], s.prior[i]);
    out[6 + i] = at_position * smaller(away * away, s.prior[6 + i]);
    out[3 + i] = at_attitude * s.prior[3 + i];
    out[9 + i] = at_position * s.prior[9 + i];
  }
  S astray = larger(m.astray, none) / s.patience;
  for (int i = 12; i < N; i++)
    out[i] = larger(larger(at_position, at_attitude), astray) * s.prior[i];
}

// Is an estimate's variance more than the covariance's?
template <class T> Answer<T> is_doubted(const Poses<T> &m) {
  using S = Single<T>;  // strain: a hundredth of a variance is not told
  return (m.phase > T{} + S(BELIEVING)) | (m.strain > T{} + S(0.01)) | (m.astray > T{});
}

// Widen variances (18) of the error state by refused and unlikely poses
template <class S> void add_doubt(const Settings<S> &s, const Belief<S> &f, S *variances) {
  S more[N];
  doubted_variance(s, f, more);
  for (int i = 0; i < N; i++) variances[i] += f.poses.strain * variances[i] + more[i];
}

}  // namespace windwrench
