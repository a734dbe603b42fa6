// The filter's correction with a measured pose: (29)-(37). The measurement is linear in the error
// state: the correction by 49 redrawn points is the Kalman update.
#pragma once
#include "recovery.hpp"

namespace windwrench {

// row of number i of a measured pose (rho, x) in the error state
constexpr int row_of(int i) { return i < 3 ? i : i + 3; }

// An innovation (rho, x)
template <class T> struct Innovation {
  T y[6];       // whitened; zero where nothing was measured
  T change[6];  // of the innovation itself since the last measurement taken in
  T raw[6];     // the innovation itself
  T unsure[6];  // variances of the expected pose
  T L[6][6];    // root of its covariance
  T scales[6];  // inverse diagonal of L; zero where nothing was measured
  T nis;
};

// The innovation of what was measured of a pose (7): (29)-(33)
template <class T, class A>
void innovate(const Settings<Single<T>> &s, const Belief<T> &f, const T *pose, A with_position,
              A with_attitude, Innovation<T> &n) {
  using S = Single<T>;
  T zero{};
  attitude_error(pose + 3, f.x + QUATERNION, n.raw);
  for (int i = 0; i < 3; i++) n.raw[3 + i] = pose[i] - f.x[i];
  n.nis = zero;
  for (int i = 0; i < 6; i++) {
    A measured = i < 3 ? with_attitude : with_position;
    int row = row_of(i);
    n.change[i] = n.raw[i] - f.poses.residual[i];
    n.y[i] = n.raw[i];
    for (int j = 0; j < i; j++) {
      T total = f.P[row][row_of(j)];
      for (int k = 0; k < j; k++) total -= n.L[i][k] * n.L[j][k];
      A both = measured & (j < 3 ? with_attitude : with_position);
      n.L[i][j] = choose(both, total / n.L[j][j], zero);
      n.y[i] -= n.L[i][j] * n.y[j];
    }
    T noise = pose_noise(s, f, i), total = f.P[row][row] + noise;
    n.unsure[i] = f.P[row][row];
    for (int k = 0; k < i; k++) total -= n.L[i][k] * n.L[i][k];
    // never below the measurement's own variance, whatever rounding does
    n.L[i][i] = root(larger(total, noise));
    n.scales[i] = choose(measured, S(1) / n.L[i][i], zero);
    n.y[i] = choose(measured, n.y[i] / n.L[i][i], zero);
    n.nis += n.y[i] * n.y[i];
  }
}

// Correct with an innovation, whatever its size; mean (18): what it adds to the error state
template <class T>
void take_in(const Settings<Single<T>> &s, const Innovation<T> &n, Belief<T> &f, T *mean) {
  T W[6][N], R[6][N];
  for (int i = 0; i < 6; i++)
    for (int j = 0; j < N; j++) W[i][j] = f.P[row_of(i)][j];
  substitute<N>(n.L, n.scales, W, W);
  for (int i = 0; i < N; i++) {
    mean[i] = W[0][i] * n.y[0];
    for (int k = 1; k < 6; k++) mean[i] += W[k][i] * n.y[k];
  }
  add_squares<N>(f.P, W, Single<T>(-1));
  // Of measured rows R S^-1 remains and is written as such: with a noise R of 1e-16 of them the
  // difference would be rounding alone
  for (int i = 0; i < N; i++)
    for (int k = 5; k >= 0; k--) {
      T total = k == 5 ? W[k][i] * n.scales[k] : W[k][i];
      for (int j = k + 1; j < 6; j++) total -= n.L[j][k] * R[j][i];
      R[k][i] = k == 5 ? total : total * n.scales[k];
    }
  for (int k = 0; k < 6; k++) {
    int row = row_of(k);
    auto measured = n.scales[k] > T{};
    T noise = pose_noise(s, f, k);
    for (int j = 0; j < N; j++)
      f.P[row][j] = f.P[j][row] = choose(measured, noise * R[k][j], f.P[row][j]);
  }
  T before[STATE];
  for (int i = 0; i < NIS; i++) before[i] = f.x[i];
  fold(before, mean, f.x);
}

// Take in what was measured of a pose (7): position m, quaternion; unless it is not to be believed.
// Leaves its innovation in n
template <class T, class A>
void correct(const Settings<Single<T>> &s, Belief<T> &f, const T *pose, A with_position,
             A with_attitude, Innovation<T> &n) {
  using S = Single<T>;
  Poses<T> &m = f.poses;
  innovate(s, f, pose, with_position, with_attitude, n);
  A measured = with_position | with_attitude, both = with_position & with_attitude;
  const Poses<T> poses = m;  // as they were: what a lane is judged from
  const T excess[2] = {f.excess[0], f.excess[1]}, status = f.status;
  for (int i = 0; i < 6; i++)
    m.residual[i] = choose(i < 3 ? with_attitude : with_position, n.raw[i], m.residual[i]);
  learn_noise(s, n.change, n.unsure, with_position, with_attitude, f);
  f.x[NIS] = choose(measured, n.nis, T{} + S(NAN));
  // the likeliest noise judges, of which the filter takes only what is proved
  T one = T{} + S(1), patience = T{} + s.patience;
  T largest = choose(both, T{} + s.alarm[1], T{} + s.alarm[0]) *
              larger(choose(with_attitude, likeliest_scale(f, 0) / (S(1) + m.widened[0]), one),
                     choose(with_position, likeliest_scale(f, 3) / (S(1) + m.widened[1]), one));
  A unlikely = measured & opposite(n.nis <= largest);  // so is what is no number
  A late =
      (with_position & (m.position_age > patience)) | (with_attitude & (m.attitude_age > patience));
  A odd = measured & (unlikely | late | (m.phase > T{} + S(BELIEVING)));
  A believed = measured, taken = measured;
  Status verdict = TRACKING;
  [[maybe_unused]] Belief<S> aside[is_single<T> ? 1 : lanes_of<T>];
  if constexpr (is_single<T>) {
    if (odd) {
      verdict = judge(s, f, pose, with_position, with_attitude, n.nis, unlikely);
      taken = verdict == TRACKING;
      believed = verdict != REJECTED;
    }
  } else {
    for (int i = 0; i < lanes_of<T>; i++)
      if (odd[i]) {
        take_lane<T>(f, i, aside[i]);
        take_lane<T>(poses, i, aside[i].poses);
        aside[i].excess[0] = excess[0][i], aside[i].excess[1] = excess[1][i];
        aside[i].status = status[i];
        S its[7];
        Innovation<S> own;
        for (int k = 0; k < 7; k++) its[k] = pose[k][i];
        correct(s, aside[i], its, with_position[i] != 0, with_attitude[i] != 0, own);
      }
  }
  f.status = choose(measured, T{} + S(verdict), f.status);
  remember(s, pose, A(believed & with_position), A(believed & with_attitude), f);
  T strain = n.nis / choose(both, T{} + S(6), T{} + S(3));
  m.strain = choose(A(taken & unlikely), larger(m.strain, strain), m.strain);
  if (!any(taken)) return;
  T mean[N], before[4];
  for (int i = 0; i < 4; i++) before[i] = f.x[QUATERNION + i];
  take_in(s, n, f, mean);
  for (int i = 0; i < 6; i++) m.residual[i] -= choose(taken, mean[row_of(i)], T{});
  // a quaternion brought to length 1 once more may change in its last digit
  for (int i = 0; i < 4; i++) f.x[QUATERNION + i] = choose(taken, f.x[QUATERNION + i], before[i]);
  if constexpr (!is_single<T>) {
    for (int i = 0; i < lanes_of<T>; i++)
      if (odd[i]) put_lane<T>(f, i, aside[i]);
  }
}

}  // namespace windwrench
