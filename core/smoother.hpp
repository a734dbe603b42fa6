// One step back in time: the link between two estimates of a filter, and the smoother's use of it.
// estimator/smoother.py has the equations: Rauch, Tung and Striebel, AIAA Journal 3(8), 1965; for
// sigma points Sarkka, IEEE TAC 53(3), 2008.
#pragma once
#include "ukf.hpp"

namespace windwrench {

constexpr double ROUNDING = 1e-13;  // of a variance: the smallest that is left of it
// of a variance: covariances that leave less than minus this have no joint distribution; rounding
// stays four orders below
constexpr double NO_JOINT = 1e-8;

// An estimate of the filter, and what leads from it back to the one before
template <class S> struct Link {
  S x[STATE];          // the estimate
  S predicted[STATE];  // the same before its measurement
  S G[N][N];           // gain, transposed: row j is what an error in number j afterwards says
  S K[N][N];           // covariance of the estimate before, given this one
  S load[7][3];        // as of the filter
  S passed[6];         // of torque and force, share of a change that the one before makes
  S decay[6];          // of torque and force, over the step
};

// Make a link across which nothing passes, from an estimate of covariance P
template <class S> void cut(const S P[N][N], S G[N][N], S K[N][N]) {
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) G[i][j] = S(0), K[i][j] = P[i][j];
}

// Transposed cross covariance C' of the errors before (columns) and after (rows) a prediction
template <class S>
void cross_covariance(const Model<S> &m, const Prediction<S> &w, S dt, S C[N][N]) {
  int pairs = m.wrench_count == 0 ? 6 : 12;
  S carried[N][12];
  carry_linear<12, S>(
      m.body, w.R, dt, w.walk, [&](int i, int j) { return w.M[i][j]; },
      [&](int i, int j) -> S & { return carried[i][j]; });
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) {
      C[i][j] = S(0);
      for (int k = 0; k < pairs; k++) C[i][j] += w.H[k][i] * w.S[k][j];
      if (j >= 6) C[i][j] += carried[i][j - 6];
    }
}

// Restore on the diagonal of K the loss by rounding, for a root; false if far more is missing. P
// gives the scale of rounding
template <class S> bool hold_positive(S K[N][N], const S P[N][N]) {
  S L[N][N];
  for (int i = 0; i < N; i++)
    for (int j = 0; j <= i; j++) {
      S total = K[i][j];
      for (int k = 0; k < j; k++) total -= L[i][k] * L[j][k];
      if (j < i) {
        L[i][j] = total / L[j][j];
        continue;
      }
      S floor = S(ROUNDING) * P[i][i] + S(1e-300);
      if (!(total > S(-NO_JOINT) * P[i][i])) return false;
      if (total < floor) {
        K[i][i] += floor - total;
        total = floor;
      }
      L[i][i] = root(total);
    }
  return true;
}

// Write the gain, transposed, into G, and the conditional covariance into K, from the covariance P
// before a prediction, `after` it, and their cross covariance C, transposed
template <class S>
void link_back(const S P[N][N], const S C[N][N], const S after[N][N], S G[N][N], S K[N][N]) {
  S L[N][N], trace = S(0);
  root_of<N>(after, L);
  for (int i = 0; i < N; i++) {
    trace += L[i][i];
    for (int j = 0; j < N; j++) G[i][j] = C[i][j], K[i][j] = P[i][j];
  }
  divide<N, N>(L, G);
  for (int k = 0; k < N; k++)
    for (int i = 0; i < N; i++)
      for (int j = 0; j < N; j++) K[i][j] -= G[k][i] * G[k][j];
  symmetrise<N>(K);
  divide_transposed<N, N>(L, G);
  if (!(finite(trace) && hold_positive(K, P))) cut(P, G, K);
}

// The link that a flight begins with: an estimate alone
template <class S> void begin_links(const Belief<S> &f, Link<S> &link) {
  for (int i = 0; i < STATE; i++) link.x[i] = f.x[i];
  for (int i = 0; i < 21; i++) link.load[i / 3][i % 3] = f.load[i / 3][i % 3];
}

// Do what `step` of a filter does, and write the link back to the estimate before it
template <class S> void step_with_link(Filter<S> &f, int parts, S dt, S voltage, Link<S> &link) {
  Belief<S> &b = f.belief;
  int usable = check_sample(f.settings, b, f.z, parts);
  if (usable < 0) return;
  const S *sample = true_sample(f, usable, dt);
  S before[N][N], restarts = b.restarts;
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) {
      before[i][j] = b.P[i][j];
      link.G[i][j] = S(i == j), link.K[i][j] = S(0);  // without a prediction: both of one state
    }
  for (int i = 0; i < 6; i++) link.passed[i] = link.decay[i] = S(1);
  if (dt > S(0)) {
    Prediction<S> w;
    S C[N][N];
    predict(f, sample, dt, voltage, w);
    for (int i = 0; i < 6; i++) {
      link.decay[i] = w.walk.decay[i];
      link.passed[i] = link.decay[i] * (before[12 + i][12 + i] / b.P[12 + i][12 + i]);
    }
    cross_covariance(f.vehicle, w, dt, C);
    link_back(before, C, b.P, link.G, link.K);
    if (lost_position(f.settings, b) || lost_attitude(f.settings, b))  // held, not predicted
      cut(before, link.G, link.K);
  }
  for (int i = 0; i < STATE; i++) link.predicted[i] = b.x[i];
  Innovation<S> n;
  correct_parts(f, sample, usable, n);
  if (b.restarts > restarts) {
    cut(before, link.G, link.K);
    for (int i = 0; i < 6; i++) link.passed[i] = S(0);
  }
  begin_links(b, link);
}

// Replace the smoothed state x (20) and its covariance P by those one link earlier, where the
// filter had the state `earlier` (20): x_s = x + G (x_s' - x-'), P_s = K + G P_s' G'
template <class S> void step_back(const Link<S> &link, const S *earlier, S *x, S P[N][N]) {
  S error[N], moved[N] = {}, half[N][N] = {};
  difference(x, link.predicted, error);
  for (int k = 0; k < N; k++)
    for (int i = 0; i < N; i++) {
      moved[i] += error[k] * link.G[k][i];
      for (int j = 0; j < N; j++) half[i][j] += P[i][k] * link.G[k][j];
    }
  fold(earlier, moved, x);
  x[NIS] = earlier[NIS];
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) P[i][j] = S(0);
  for (int k = 0; k < N; k++)
    for (int i = 0; i < N; i++)
      for (int j = 0; j < N; j++) P[i][j] += link.G[k][i] * half[k][j];
  for (int i = 0; i < N; i++)
    for (int j = 0; j < N; j++) P[i][j] += link.K[i][j];
  symmetrise<N>(P);
}

// Replace smoothed loads by those one link earlier, where the filter had the loads `earlier`
template <class S> void loads_back(const Link<S> &link, const S earlier[7][3], S load[7][3]) {
  for (int row = 0; row < 7; row++)
    for (int i = 0; i < 3; i++) {
      int of = (row == 2 || row == 3 ? 3 : 0) + i;
      S before = earlier[row][i];
      load[row][i] = before + link.passed[of] * (load[row][i] - link.decay[of] * before);
    }
}

// Replace a smoothed estimate `f` by that one link of dt s earlier. Unlikely poses taken in widen
// smoothed estimates before and after them alike: the strain falls backwards at the filter's rate
template <class S>
void go_back(const Settings<S> &s, const Link<S> &earlier, const Link<S> &link, S dt,
             Belief<S> &f) {
  loads_back(link, earlier.load, f.load);
  step_back(link, earlier.x, f.x, f.P);
  f.poses.strain -= smaller(dt / s.patience, S(1)) * f.poses.strain;
}

}  // namespace windwrench
