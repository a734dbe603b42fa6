// The filter with the gain of steady flight: the same mean, (2)-(5), (11)-(14), and no covariance,
// for less than a tenth of the work. After a gap, a restart or an unlikely pose a covariance of the
// model linearised at hover takes over, in the frame of the vehicle's heading, until it has
// converged again: estimator/constant_gain.py has the reasons.
#pragma once
#include "linear_model.hpp"
#include "ukf.hpp"

namespace windwrench {

constexpr double LONGEST_GAP = 0.1;  // s of coasting without a position or an attitude
constexpr double NEAR = 1.1;         // of the converged variances: nearly converged again
constexpr int CATCH_UP = 32;         // predictions, at most, that make up for a gap

// Laid out as Python's record of a filter, whose beginning is the filter with a covariance
template <class S> struct ConstantGain {
  Filter<S> filter;
  S innovation[6];      // of the last pose, written by the other filter
  S gain[N][6];         // facing along x, of (rho, x)
  S information[6][6];  // inverse covariance of the innovation
  int64_t steady;       // whether that gain holds now
  S converged[N][N];    // the covariance that goes with it
  S near;               // s for which the covariance has been near that
  S settle;             // s for which it must have been
  S hover[6][N];        // derivatives of angular and linear acceleration at hover, error state
};

// the number of a ConstantGain, or of another struct with these fields: those that do not change in
// flight may be constants
template <class G> using NumberOf = std::remove_reference_t<decltype(std::declval<G>().near)>;

// Turn the horizontal part of `count` vectors, one behind the other, about the vertical. A
// difference here and a sum there GCC would fuse, told not to
template <class S> void turn_vectors(S *values, int count, S cosine, S sine) {
  S minus = -sine;
  for (int k = 0; k < count; k++) {
    S a = values[3 * k], b = values[3 * k + 1];
    values[3 * k] = cosine * a + minus * b;
    values[3 * k + 1] = sine * a + cosine * b;
  }
}

// A turn about the vertical: cosine and sine of half the angle
template <class S> struct Heading {
  S w, z;
};

// The turn about the vertical that is in an attitude; none where the vehicle hangs head down
template <class S> Heading<S> heading(const S *q) {
  S square = q[0] * q[0] + q[3] * q[3];
  if (square < S(1e-6)) return {S(1), S(0)};
  S scale = S(1) / root(square);
  return {q[0] * scale, q[3] * scale};
}

// Turn a pose (7) about the vertical through `before` (3) m, which moves to `after` (3) m
template <class S> void turn_pose(S *pose, Heading<S> h, const S *before, const S *after) {
  for (int i = 0; i < 3; i++) pose[i] -= before[i];
  turn_vectors(pose, 1, h.w * h.w - h.z * h.z, S(2) * h.w * h.z);
  for (int i = 0; i < 3; i++) pose[i] += after[i];
  for (int i = 0; i < 2; i++) {
    S a = pose[3 + i], b = pose[6 - i];
    pose[3 + i] = h.w * a - h.z * b;
    pose[6 - i] = h.w * b + h.z * a;
  }
}

// Turn the world likewise: estimate, pose (7) and remembered poses. About the vehicle, so that
// single precision turns small numbers: 17 m away the rounding of a turn about the origin was 0.2 %
// of a pose's noise, in each step
template <class S>
void turn_world(Filter<S> &f, S *pose, Heading<S> h, const S *before, const S *after) {
  S cosine = h.w * h.w - h.z * h.z, sine = S(2) * h.w * h.z, *x = f.belief.x;
  Poses<S> &m = f.belief.poses;
  turn_pose(x, h, before, after);
  turn_pose(pose, h, before, after);
  turn_pose(m.seen, h, before, after);
  turn_vectors(x + VELOCITY, 1, cosine, sine);
  turn_vectors(x + TORQUE, 2, cosine, sine);
  if (f.settings.gated > 0) {
    turn_pose(m.doubted, h, before, after);
    turn_vectors(m.pace, 2, cosine, sine);
  }
}

// Carry the covariance dt s ahead by the model at hover
template <class G, class S = NumberOf<G>> void carry_at_hover(G &c, S dt) {
  Filter<S> &f = c.filter;
  S A[12][N] = {}, B[6][N];
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < N; j++) {
      A[3 + i][j] = dt * c.hover[i][j];
      A[9 + i][j] = dt * c.hover[3 + i][j];
      A[6 + i][j] = S(0.5) * dt * A[9 + i][j];
    }
  for (int i = 0; i < 3; i++) {
    A[i][3 + i] = S(0.25) * dt;  // an MRP is a quarter of an angle
    A[6 + i][9 + i] += dt;
    for (int j = 0; j < 3; j++) f.centre_rotation[i][j] = S(i == j);
  }
  WrenchWalk<S> walk(f.settings, dt);
  carry_by_jacobian(walk, A, f.belief.P);
  noise_inputs(f.vehicle.body, f.settings, f.centre_rotation, dt, B);
  add_noise(f.vehicle.body, walk, B, f.belief.P);
  symmetrise<N>(f.belief.P);
  for (int i = 0; i < 3; i++) bound_variance<N>(f.belief.P, i, S(LARGEST_MRP_VARIANCE));
}

// Carry the covariance over the time since the last measurement
template <class G, class S = NumberOf<G>> void catch_up(G &c) {
  const Poses<S> &m = c.filter.belief.poses;
  S since = larger(m.position_age, m.attitude_age);
  if (since <= S(0)) return;
  int count = int(smaller(since / c.filter.settings.period, S(CATCH_UP)) + S(0.5));
  if (count < 1) count = 1;
  for (int i = 0; i < count; i++) carry_at_hover(c, since / S(count));
}

// Correct with the covariance, in the frame of the vehicle's heading
template <class S> void correct_with_covariance(Filter<S> &f, S *sample, int usable) {
  if (usable == 0) return;
  Innovation<S> n;
  const S *x = f.belief.x, here[3] = {x[0], x[1], x[2]}, origin[3] = {};
  Heading<S> h = heading(x + QUATERNION), back = {h.w, -h.z};
  turn_world(f, sample + 4, back, here, origin);
  correct_parts(f, sample, usable, n);
  turn_world(f, sample + 4, h, origin, here);
}

// Return to the constant gain once the covariance has stayed near the converged one for a while
template <class G, class S = NumberOf<G>> void look_for_steady_state(G &c) {
  Belief<S> &f = c.filter.belief;
  bool near = f.status == S(TRACKING);
  S noise = S(1) + larger(f.poses.widened[0], f.poses.widened[1]);
  for (int i = 0; i < N; i++) near = near && f.P[i][i] <= S(NEAR) * noise * c.converged[i][i];
  if (!near) c.near = S(0);
  if (c.near <= c.settle) return;
  c.steady = 1;
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) f.P[i][j] = c.converged[i][j];
}

// Correct a predicted state (20) by the constant gain with the usable parts of a sample; false, and
// nothing is changed, where a covariance has to judge: after a gap, or at an unlikely pose
template <class G, class S = NumberOf<G>>
bool correct_with_gain(G &c, const S *sample, int usable, const S *centre) {
  Belief<S> &f = c.filter.belief;
  const Settings<S> &s = c.filter.settings;
  Poses<S> &m = f.poses;
  const S *q = centre + QUATERNION;
  bool with_position = usable & POSITION_PART, with_attitude = usable & ATTITUDE_PART;
  S y[6] = {}, change[6], unsure[6], mean[N], nis = S(0);
  if (with_attitude) attitude_error(sample + 7, q, y);
  for (int i = 0; i < 3 && with_position; i++) y[3 + i] = sample[4 + i] - centre[i];
  for (int i = 0; i < 6; i++) {
    change[i] = y[i] - m.residual[i];
    unsure[i] = c.converged[row_of(i)][row_of(i)];
  }
  // the heading as cosine and sine; straight up or down there is none, and none is needed
  S across = q[0] * q[3] + q[1] * q[2], along = S(0.5) - q[2] * q[2] - q[3] * q[3];
  S length = root(across * across + along * along);
  bool level = length > S(1e-6);
  S cosine = level ? along / length : S(1), sine = level ? across / length : S(0);
  turn_vectors(y, 2, cosine, -sine);
  for (int i = 0; i < N; i++) {
    mean[i] = S(0);
    for (int j = 0; j < 6; j++) mean[i] += c.gain[i][j] * y[j];
  }
  for (int i = 0; i < 6; i++)
    for (int j = 0; j < 6; j++) nis += y[i] * c.information[i][j] * y[j];
  S noise = S(1) + larger(m.widened[0], m.widened[1]);
  S likeliest = larger(likeliest_scale(f, 0), likeliest_scale(f, 3));
  bool late = m.position_age > S(LONGEST_GAP) || m.attitude_age > S(LONGEST_GAP);
  if (late || !(nis <= likeliest * s.alarm[usable / 3])) return false;
  f.x[NIS] = usable == 3 ? nis : S(NAN);
  if (usable > 0) {
    learn_noise(s, change, unsure, with_position, with_attitude, f);
    // with this gain more noise has more of a share in the covariance: at most all of it
    m.strain = larger(m.strain, noise - S(1));
  }
  turn_vectors(mean, 1, cosine, sine);  // the rate, next, is in body axes
  turn_vectors(mean + 6, 4, cosine, sine);
  fold(centre, mean, f.x);
  for (int i = 0; i < 6; i++) {
    if (i < 3 ? with_attitude : with_position) m.residual[i] += change[i];
    m.residual[i] -= mean[row_of(i)];
  }
  if (usable > 0) {
    f.status = S(TRACKING);
    remember(s, sample + 4, with_position, with_attitude, f);
  }
  return true;
}

// As `step` of the filter with a covariance
template <class G, class S = NumberOf<G>> int step(G &c, int parts, S dt, S voltage) {
  Filter<S> &f = c.filter;
  Belief<S> &b = f.belief;
  Model<S> &m = f.vehicle;
  int usable = check_sample(f.settings, b, f.z, parts);
  if (usable < 0) return usable;
  true_sample(f, usable, dt);
  S *sample = numbers_of<S>(m.sample), centre[STATE], R[3][3];
  for (int i = 0; i < NIS; i++) centre[i] = b.x[i];
  if (dt > S(0)) {
    drive(m, sample, dt, voltage);
    matrix_of(b.x + QUATERNION, R);
    apply_effects(m, b.x, R);
    WrenchWalk<S> walk(f.settings, dt);
    move(m.body, b.x, R, m.rotor_wrench, m.effect_wrench, dt, centre);
    decay_wrench(walk, centre);
    follow_loads(f.settings, walk, R, m.rotor_wrench, m.effect_wrench, b);
    m.time += dt;
  }
  if (c.steady) {
    grow_older(f.settings, dt, b);
    b.status = S(COASTING);
    if (correct_with_gain(c, sample, usable, centre)) return usable;
  }
  // a covariance goes on from the predicted state
  for (int i = 0; i < NIS; i++) b.x[i] = centre[i];
  b.x[NIS] = S(NAN);
  if (c.steady) {  // after a gap the gap's widening is made up for
    c.steady = 0;
    c.near = S(0);
    catch_up(c);
    after_prediction(f.settings, S(0), b);
    correct_with_covariance(f, sample, usable);
    return usable;
  }
  if (dt > S(0)) {
    c.near += dt;
    carry_at_hover(c, dt);
    after_prediction(f.settings, dt, b);
  }
  correct_with_covariance(f, sample, usable);
  if (usable > 0) look_for_steady_state(c);
  return usable;
}

// Derivatives (6) of angular (body) and linear acceleration by the error state of a filter that
// hovers, at its last rotor speeds
template <class S> void jacobian_at_hover(Filter<S> &f, S voltage, S out[6][N]) {
  Model<S> &m = f.vehicle;
  S R[3][3], a[6], A[12][N];
  drive(m, f.belief.last_speeds, f.settings.period, voltage);
  matrix_of(f.belief.x + QUATERNION, R);
  apply_effects(m, f.belief.x, R);
  accelerations(m.body, R, f.belief.x, m.rotor_wrench, m.effect_wrench, a);
  acceleration_jacobian(m, f.belief.x, R, a + 3, true, A);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < N; j++) out[i][j] = A[3 + i][j], out[3 + i][j] = A[9 + i][j];
}

}  // namespace windwrench
