// Gyro and accelerometer as further measurements of the same filter: estimator/imu.py has the
// reasons. An accelerometer at the geometric centre measures the specific force R' (a + g), a being
// the acceleration (4) over the last step.
#pragma once
#include "bias_states.hpp"
#include "ukf.hpp"

namespace windwrench {

// s of nothing but refusals after which a sensor's bias is no longer believed
constexpr double IMU_PATIENCE = 0.5;

// What gyro (rad/s) and accelerometer (m/s2) without bias would measure in a state x: out (6)
template <class S> void expected_imu(Filter<S> &f, const S *x, S *out) {
  Model<S> &m = f.vehicle;
  S R[3][3], a[6];
  matrix_of(x + QUATERNION, R);
  apply_effects(m, x, R);
  accelerations(m.body, R, x, m.rotor_wrench, m.effect_wrench, a);
  a[2] += m.body.gravity;
  for (int i = 0; i < 3; i++) {
    out[i] = x[RATE + i];
    out[3 + i] = R[0][i] * a[0] + R[1][i] * a[1] + R[2][i] * a[2];
  }
}

// An inertial measurement's innovation and its covariances
template <class S> struct ImuInnovation {
  S y[6];
  S covariance[6][6];
  S cross[N][6];                // of the error state with what is measured
  S companions[COMPANIONS][6];  // of the companions
};

// The innovation of z (6), with the 37 sigma points of the error state: (28)-(33). Biases and noise
// are linear in it
template <class S> void innovate_imu(Filter<S> &f, const S *z, ImuInnovation<S> &n) {
  const Imu<S> &u = f.imu;
  const auto &C = u.sensitivity;
  S lower[N][N], centre[6], plus[6], minus[6], half[N][6], second[N][6], mean[6] = {};
  S spread = root(S(N) + f.settings.kappa), weight = S(0.5) / (S(N) + f.settings.kappa);  // (28)
  root_of<N>(f.belief.P, lower);
  expected_imu(f, f.belief.x, centre);
  for (int j = 0; j < N; j++) {
    S along[N], back[N], point[STATE], turned[COMPANIONS] = {};
    for (int i = 0; i < N; i++) along[i] = spread * lower[i][j], back[i] = -along[i];
    displace(f.belief.x, along, point);
    expected_imu(f, point, plus);
    displace(f.belief.x, back, point);
    expected_imu(f, point, minus);
    for (int i = j; i < N; i++)  // the companions along this column of the root
      for (int c = 0; c < COMPANIONS; c++) turned[c] += u.regression[i][c] * lower[i][j];
    for (int i = 0; i < 6; i++) {
      half[j][i] = S(0.5) * (plus[i] - minus[i]) / spread;
      for (int c = 0; c < COMPANIONS; c++) half[j][i] += C[i][c] * turned[c];
      second[j][i] = plus[i] + minus[i] - S(2) * centre[i];
      mean[i] += weight * second[j][i];
    }
  }
  // with a pair of deviations p and m: pp' + mm' = ((p - m)(p - m)' + (p + m)(p + m)') / 2, and
  // 2 weight spread^2 = 1
  S rest[COMPANIONS][6];  // E C'
  for (int c = 0; c < COMPANIONS; c++)
    for (int i = 0; i < 6; i++) {
      rest[c][i] = S(0);
      for (int k = 0; k < COMPANIONS; k++) rest[c][i] += u.rest[c][k] * C[i][k];
    }
  for (int i = 0; i < 6; i++) {
    n.y[i] = z[i] - centre[i] - mean[i];
    for (int c = 0; c < COMPANIONS; c++) n.y[i] -= C[i][c] * u.mean[c];
    for (int j = 0; j < 6; j++) {
      S sum = i == j ? f.settings.imu_noise[i] : S(0), bent = S(0);
      for (int c = 0; c < COMPANIONS; c++) sum += C[i][c] * rest[c][j];
      for (int k = 0; k < N; k++)
        sum += half[k][i] * half[k][j], bent += second[k][i] * second[k][j];
      n.covariance[i][j] = sum + S(0.5) * weight * bent - mean[i] * mean[j];
    }
  }
  for (int k = 0; k < N; k++) {
    for (int i = 0; i < 6; i++) n.cross[k][i] = S(0);
    for (int j = 0; j <= k; j++)
      for (int i = 0; i < 6; i++) n.cross[k][i] += lower[k][j] * half[j][i];
  }
  for (int c = 0; c < COMPANIONS; c++)
    for (int i = 0; i < 6; i++) n.companions[c][i] = rest[c][i];
  add_products<N, COMPANIONS, 6>(u.regression, n.cross, n.companions);
}

// Root of the covariance of rows `first` to `last` of what is measured; one elsewhere
template <class S> void root_of_rows(const S covariance[6][6], int first, int last, S lower[6][6]) {
  S rows[6][6] = {};
  for (int i = 0; i < 6; i++) {
    rows[i][i] = S(1);
    for (int j = first; first <= i && i < last && j < last; j++) rows[i][j] = covariance[i][j];
  }
  root_of<6>(rows, lower);
}

// Normalised square of rows `first` to `last` of the innovation
template <class S> S imu_nis(const S covariance[6][6], const S *y, int first, int last) {
  S lower[6][6], white[6][1], nis = S(0);
  root_of_rows(covariance, first, last, lower);
  for (int i = 0; i < 6; i++) white[i][0] = first <= i && i < last ? y[i] : S(0);
  divide<6, 1>(lower, white);
  for (int i = first; i < last; i++) nis += white[i][0] * white[i][0];
  return nis;
}

// Are the accelerometer samples that were unlikely in a row a push: far from what the filter
// expects, by no more than two weights, and no farther from each other than noise alone makes them?
// Vibration does not agree with itself, and a saturated sensor is too far
template <class S> bool is_push(Filter<S> &f, const ImuInnovation<S> &n) {
  Imu<S> &u = f.imu;
  for (int i = 0; i < 3; i++) u.unlikely[u.in_row % AGREEING_SAMPLES][i] = n.y[3 + i];
  u.in_row += 1;
  if (u.in_row < AGREEING_SAMPLES) return false;
  S mean[3] = {}, apart[6] = {}, square = S(0);
  for (int i = 0; i < 3; i++) {
    for (int k = 0; k < AGREEING_SAMPLES; k++) mean[i] += u.unlikely[k][i];
    mean[i] /= S(AGREEING_SAMPLES);
    if (absolute(mean[i]) > S(2) * f.vehicle.body.gravity) return false;
  }
  for (int k = 0; k < AGREEING_SAMPLES; k++) {
    for (int i = 0; i < 3; i++) apart[3 + i] = u.unlikely[k][i] - mean[i];
    square += imu_nis(n.covariance, apart, 3, 6);
  }
  return square <= u.gate[2];
}

// The rows that the gate lets in, from `first` to `last`. One of two sensors that are unlikely
// together may be right: a saturated accelerometer does not cost the gyro
template <class S>
void believed_rows(Filter<S> &f, const ImuInnovation<S> &n, int &first, int &last) {
  Imu<S> &u = f.imu;
  if (f.belief.x[NIS] <= u.gate[last - first == 6 ? 1 : 0]) {
    for (int s = first / 3; s < last / 3; s++) u.doubt[s] = S(-1);
    if (last == 6) u.in_row = 0;
    return;
  }
  S gyro = first == 0 ? imu_nis(n.covariance, n.y, 0, 3) : S(INFINITY);
  S accelerometer = last == 6 ? imu_nis(n.covariance, n.y, 3, 6) : S(INFINITY);
  bool pushed = last == 6 && accelerometer > u.gate[0] && is_push(f, n);
  if (last == 6 && accelerometer <= u.gate[0]) u.in_row = 0;
  // unlikely only together: the likelier of the two
  bool take_gyro = gyro <= u.gate[0] && (pushed || gyro < accelerometer);
  bool take_accelerometer = pushed || (accelerometer <= u.gate[0] && !take_gyro);
  int begin = take_gyro ? 0 : 3, end = take_accelerometer ? 6 : 3;
  if (end - begin < last - first) u.refused += 1;
  for (int s = first / 3; s < last / 3; s++) {
    if (begin <= 3 * s && 3 * s < end) {
      u.doubt[s] = S(-1);
    } else if (u.doubt[s] < S(0)) {
      u.doubt[s] = S(0);
    } else if (u.doubt[s] > S(IMU_PATIENCE)) {
      restore_bias_prior(u, 3 * s);
      u.doubt[s] = S(0);
      last = first;  // the innovation at hand is that of the old bias
      return;
    }
  }
  first = begin;
  last = end;
}

// Write the rate's covariances after a correction once more, from W (6, N) and V (6, COMPANIONS),
// whitened by `lower` and overwritten. The gyro measures the sum of rate and bias: of the sum noise
// S^-1 W is left, without the difference of two large numbers that single precision would lose
template <class S>
void keep_measured_rate(Filter<S> &f, const S lower[6][6], S W[6][N], S V[6][COMPANIONS],
                        S cross[N][COMPANIONS], const S joint[COMPANIONS][COMPANIONS]) {
  auto &P = f.belief.P;
  const S *noise = f.settings.imu_noise;
  divide_transposed<6, N>(lower, W);
  divide_transposed<6, COMPANIONS>(lower, V);
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < COMPANIONS; j++) cross[3 + i][j] = noise[i] * V[i][j] - joint[i][j];
    for (int j = 0; j < N; j++)
      if (j < 3 || j > 5) P[3 + i][j] = P[j][3 + i] = noise[i] * W[i][j] - cross[j][i];
  }
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) P[3 + i][3 + j] = noise[i] * W[i][3 + j] - cross[3 + j][i];
}

// Update error state and companions with rows `first` to `last` of the innovation: (34)-(37)
template <class S>
void correct_with_imu(Filter<S> &f, const ImuInnovation<S> &n, int first, int last) {
  Belief<S> &b = f.belief;
  Imu<S> &u = f.imu;
  S lower[6][6], W[6][N] = {}, V[6][COMPANIONS] = {}, y[6][1] = {};
  root_of_rows(n.covariance, first, last, lower);
  for (int i = first; i < last; i++) {
    for (int j = 0; j < N; j++) W[i][j] = n.cross[j][i];
    for (int j = 0; j < COMPANIONS; j++) V[i][j] = n.companions[j][i];
    y[i][0] = n.y[i];
  }
  divide<6, N>(lower, W);
  divide<6, COMPANIONS>(lower, V);
  divide<6, 1>(lower, y);
  S cross[N][COMPANIONS], joint[COMPANIONS][COMPANIONS], mean[N] = {}, before[STATE];
  cross_covariance<COMPANIONS>(f, cross);
  for (int i = 0; i < COMPANIONS; i++)
    for (int j = 0; j < COMPANIONS; j++) joint[i][j] = u.rest[i][j];
  add_products<N, COMPANIONS, COMPANIONS>(u.regression, cross, joint);
  for (int k = first; k < last; k++)
    for (int i = 0; i < COMPANIONS; i++)
      for (int j = 0; j < COMPANIONS; j++) joint[i][j] -= V[k][i] * V[k][j];
  for (int i = 0; i < N; i++)
    for (int k = first; k < last; k++) {
      mean[i] += W[k][i] * y[k][0];
      for (int j = 0; j < COMPANIONS; j++) cross[i][j] -= W[k][i] * V[k][j];
      for (int j = 0; j < N; j++) b.P[i][j] -= W[k][i] * W[k][j];
    }
  for (int j = 0; j < COMPANIONS; j++)
    for (int k = first; k < last; k++) u.mean[j] += V[k][j] * y[k][0];
  if (sizeof(S) < sizeof(double) && first == 0) keep_measured_rate(f, lower, W, V, cross, joint);
  symmetrise<N>(b.P);
  for (int i = 0; i < 3; i++) bound_variance<N>(b.P, i, S(LARGEST_MRP_VARIANCE));
  for (int i = 0; i < NIS; i++) before[i] = b.x[i];
  fold(before, mean, b.x);
  bound_biases(u);
  split(f, cross, joint);
}

// Correct with the measured parts of z (6), gyro rad/s and accelerometer m/s2, unless the gate
// refuses them. The accelerometer is left out before the first prediction
template <class S> void take_in_imu(Filter<S> &f, const S *z, bool gyro, bool accelerometer) {
  S &nis = f.belief.x[NIS];
  nis = S(NAN);
  int first = gyro ? 0 : 3, last = accelerometer && f.imu.known > 0 ? 6 : 3;
  if (first >= last) return;
  ImuInnovation<S> n;
  innovate_imu(f, z, n);
  nis = imu_nis(n.covariance, n.y, first, last);
  believed_rows(f, n, first, last);
  if (first < last) correct_with_imu(f, n, first, last);
}

// Step like `step`, and with the biases of an IMU
template <class S>
int step_with_biases(Filter<S> &f, int parts, S dt, S voltage, Innovation<S> &n) {
  Belief<S> &b = f.belief;
  int usable = check_sample(f.settings, b, f.z, parts);
  if (usable < 0) return usable;
  const S *sample = true_sample(f, usable, dt);
  S restarts = b.restarts;
  if (dt > S(0)) {
    Prediction<S> w;
    S cross[N][BIASES], after[N][BIASES];
    cross_covariance<BIASES>(f, cross);
    predict(f, sample, dt, voltage, w);
    carry_with_points(f, dt, w, cross, after);
    carry_companions(f, dt, w.B, after);
    if (b.restarts > restarts) forget_biases(f.imu);
  }
  S before[STATE];
  for (int i = 0; i < STATE; i++) before[i] = b.x[i];
  restarts = b.restarts;
  correct_parts(f, sample, usable, n);
  if (b.restarts > restarts) forget_biases(f.imu);
  else correct_companions(f, before);
  return usable;
}

}  // namespace windwrench
