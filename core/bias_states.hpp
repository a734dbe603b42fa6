// Biases of gyro and accelerometer, and the last step's noise, beside the filter's error state e:
// companions c = c_mean + T' e + r, cov(r) = E, r independent of e. Neither enters the dynamics.
// estimator/imu.py says why in this form. Order of c: biases of gyro (3, rad/s) and
// accelerometer (3, m/s2), body; motor torque (3) and thrust (3) of the last step, in deviations.
#pragma once
#include "prediction.hpp"

namespace windwrench {

constexpr double BLIND = 1e-12;  // of a variance: less than this cannot be left of it

// Give the biases their prior, and forget the step before with its rotors
template <class S> void forget_biases(Imu<S> &u) {
  u.known = u.in_row = 0;
  u.doubt[0] = u.doubt[1] = S(-1);
  for (int i = 0; i < COMPANIONS; i++) {
    u.mean[i] = S(0);
    for (int j = 0; j < N; j++) u.regression[j][i] = S(0);
    for (int j = 0; j < COMPANIONS; j++) u.rest[i][j] = S(0);
    for (int j = 0; j < 6; j++) u.sensitivity[j][i] = S(0);
  }
  for (int i = 0; i < BIASES; i++) {
    for (int j = 0; j < BIASES; j++) u.bias_covariance[i][j] = S(0);
    u.rest[i][i] = u.bias_covariance[i][i] = u.prior[i];
    // a bias is in its sensor from the first sample on; the noise of a step, from the first step on
    u.rest[BIASES + i][BIASES + i] = u.sensitivity[i][i] = S(1);
  }
}

// Keep the biases within what a sensor of their class can have
template <class S> void bound_biases(Imu<S> &u) {
  for (int i = 0; i < BIASES; i++) u.mean[i] = smaller(larger(u.mean[i], -u.bound[i]), u.bound[i]);
}

// Give the bias of a sensor, of first number `first` (0 or 3), its prior variance without any
// correlation: measurements contradicted the bias for too long
template <class S> void restore_bias_prior(Imu<S> &u, int first) {
  for (int i = first; i < first + 3; i++) {
    for (int j = 0; j < N; j++) u.regression[j][i] = S(0);
    for (int j = 0; j < COMPANIONS; j++) u.rest[i][j] = u.rest[j][i] = S(0);
    for (int j = 0; j < BIASES; j++) u.bias_covariance[i][j] = u.bias_covariance[j][i] = S(0);
  }
  for (int i = first; i < first + 3; i++) u.rest[i][i] = u.bias_covariance[i][i] = u.prior[i];
}

// cov(e, c) of the first COLUMNS companions: P T
template <int COLUMNS, class S> void cross_covariance(const Filter<S> &f, S out[N][COLUMNS]) {
  for (int i = 0; i < N; i++) {
    for (int j = 0; j < COLUMNS; j++) out[i][j] = S(0);
    for (int k = 0; k < N; k++)
      for (int j = 0; j < COLUMNS; j++) out[i][j] += f.belief.P[i][k] * f.imu.regression[k][j];
  }
}

// Regression T and rest E of the companions, from their covariance with the error state, `cross`
// (overwritten), and among themselves, `joint`
template <class S>
void split(Filter<S> &f, S cross[N][COMPANIONS], const S joint[COMPANIONS][COMPANIONS]) {
  Imu<S> &u = f.imu;
  const auto &P = f.belief.P;
  for (int i = 0; i < BIASES; i++)
    for (int j = 0; j < BIASES; j++) u.bias_covariance[i][j] = joint[i][j];
  for (int i = 0; i < N; i++) {  // a forgotten number is correlated with nothing
    int known = 0;
    for (int j = 0; j < N; j++) known += P[i][j] != S(0);
    for (int j = 0; known <= 1 && j < COMPANIONS; j++) cross[i][j] = S(0);
  }
  S lower[N][N], rest[COMPANIONS][COMPANIONS];
  root_of<N>(P, lower);
  divide<N, COMPANIONS>(lower, cross);
  for (int i = 0; i < COMPANIONS; i++)
    for (int j = 0; j < COMPANIONS; j++) rest[i][j] = S(0);
  add_products<N, COMPANIONS, COMPANIONS>(cross, cross, rest);  // what the state explains
  for (int i = 0; i < COMPANIONS; i++)
    for (int j = 0; j < COMPANIONS; j++) u.rest[i][j] = joint[i][j] - rest[i][j];
  root_of<COMPANIONS>(u.rest, rest);
  bool fits = true;
  for (int i = 0; i < COMPANIONS; i++)
    fits = fits && rest[i][i] * rest[i][i] > S(BLIND) * joint[i][i];
  if (fits) {
    divide_transposed<N, COMPANIONS>(lower, cross);
  } else {
    // the filter's covariance was bounded since (of an unknown attitude), and no longer belongs to
    // these cross covariances
    for (int i = 0; i < COMPANIONS; i++)
      for (int j = 0; j < COMPANIONS; j++) u.rest[i][j] = joint[i][j];
  }
  for (int i = 0; i < N; i++)
    for (int j = 0; j < COMPANIONS; j++) u.regression[i][j] = fits ? cross[i][j] : S(0);
}

// A step of dt s: the biases walk, and the step has a noise of its own, of inputs B. cross:
// covariance of the error state after the step with the biases before
template <class S>
void carry_companions(Filter<S> &f, S dt, const S B[6][N], const S cross[N][BIASES]) {
  Imu<S> &u = f.imu;
  S joint[COMPANIONS][COMPANIONS] = {}, all_cross[N][COMPANIONS];
  for (int i = 0; i < BIASES; i++) {
    for (int j = 0; j < BIASES; j++) joint[i][j] = u.bias_covariance[i][j];
    joint[i][i] += dt / f.settings.period * u.walk[i];
    joint[BIASES + i][BIASES + i] = u.sensitivity[i][i] = S(1);
    u.mean[BIASES + i] = S(0);
  }
  // the accelerations of the noise, in body axes: velocity is rows 9-11
  for (int i = 0; i < 3; i++)
    for (int n = 0; n < 6; n++) {
      S turned = S(0);
      for (int j = 0; j < 3; j++) turned += f.centre_rotation[j][i] * B[n][9 + j];
      u.sensitivity[3 + i][BIASES + n] = turned / dt;
    }
  for (int i = 0; i < N; i++)
    for (int j = 0; j < BIASES; j++)
      all_cross[i][j] = cross[i][j], all_cross[i][BIASES + j] = B[j][i];
  split(f, all_cross, joint);
  u.known = 1;
  for (int s = 0; s < 2; s++)
    if (u.doubt[s] >= S(0)) u.doubt[s] += dt;
}

// Begin to carry biases with a filter that had none so far. The correlation of the last step's
// noise with the error state is known if nothing was corrected since; else an accelerometer counts
// from the next step on
template <class S> void begin_imu(Filter<S> &f) {
  forget_biases(f.imu);
  f.imu.refused = 0;
  f.imu.used = 1;
  if (f.vehicle.time > S(0) && f.belief.x[NIS] != f.belief.x[NIS]) {
    S dt = f.vehicle.rotors.step, B[6][N], none[N][BIASES] = {};
    noise_inputs(f.vehicle.body, f.settings, f.centre_rotation, dt, B);
    carry_companions(f, dt, B, none);
  }
}

// out: covariance of the error state with the biases, `cross`, carried over a prediction of dt s. A
// constant beside the state is a further row of the root: in columns drawn as pairs of points its
// entries go with half the difference of the pair, the others with the linear part of the model
template <class S>
void carry_with_points(const Filter<S> &f, S dt, const Prediction<S> &w, S cross[N][BIASES],
                       S out[N][BIASES]) {
  int pairs = f.vehicle.wrench_count == 0 ? 6 : 12;
  S rows[12][BIASES];
  for (int j = 0; j < pairs; j++) {
    for (int m = 0; m < BIASES; m++) rows[j][m] = cross[j][m] / w.S[j][j];
    for (int i = j; i < N; i++)
      for (int m = 0; m < BIASES; m++) cross[i][m] -= w.S[j][i] * rows[j][m];
  }
  for (int i = 6; i < pairs; i++)
    for (int m = 0; m < BIASES; m++) cross[i][m] = S(0);
  carry_linear<BIASES, S>(
      f.vehicle.body, w.R, dt, w.walk, [&](int i, int j) { return cross[6 + i][j]; },
      [&](int i, int j) -> S & { return out[i][j]; });
  for (int j = 0; j < pairs; j++)
    for (int i = 0; i < N; i++)
      for (int m = 0; m < BIASES; m++) out[i][m] += w.H[j][i] * rows[j][m];
}

// Move the companions with a pose's correction of the error state; before (20): the state before it
template <class S> void correct_companions(Filter<S> &f, const S *before) {
  Imu<S> &u = f.imu;
  S error[N], cross[N][BIASES];
  difference(f.belief.x, before, error);
  for (int i = 0; i < N; i++)
    for (int j = 0; j < COMPANIONS; j++) u.mean[j] += u.regression[i][j] * error[i];
  bound_biases(u);
  cross_covariance<BIASES>(f, cross);
  for (int i = 0; i < BIASES; i++)
    for (int j = 0; j < BIASES; j++) u.bias_covariance[i][j] = u.rest[i][j];
  add_products<N, BIASES, BIASES>(u.regression, cross, u.bias_covariance);
}

}  // namespace windwrench
