// The filter's prediction over a step: (18)-(27), exact to the paper's 61 sigma points and cheaper.
//
// The noise enters linearly, and so do the directions of the state that leave attitude and rate
// alone. Their pairs of sigma points average out and add exactly A S S' A' and B Q B' to the
// covariance. The 13 points of attitude and rate are left (25 where a declared effect depends on
// position or velocity). The root of P is lower triangular: only its first 6 (or 12) columns are
// needed, and the others enter through the Schur complement.
#pragma once
#include "effects.hpp"
#include "filter.hpp"
#include "linear_algebra.hpp"
#include "vehicle_uncertainty.hpp"

// 0: sigma points one after the other, for processors without vector registers; the same bits
#ifndef WINDWRENCH_REGISTERS
#define WINDWRENCH_REGISTERS 1
#endif

namespace windwrench {

// What a prediction leaves for the companions of an inertial measurement
template <class T> struct Prediction {
  T S[12][N];       // columns of the root of P, one a row
  T M[12][12];      // the Schur complement of the others
  T H[12][N];       // pairs of points after the step: their scaled half difference,
  T E[12][N];       // and their scaled half sum, from the central one
  T B[6][N];        // scaled noise inputs, one a row
  T mean[N];        // (26)
  T centre[STATE];  // where the central point is after the step
  T R[3][3];        // attitude before it
  WrenchWalk<Single<T>> walk;
};

// A state after the step: torque and force decay
template <class T, class W> void decay_wrench(const W &walk, T *x) {
  for (int i = 0; i < 6; i++) x[TORQUE + i] *= walk.decay[i];
}

// Six columns of the root, from `first` on, into S; rows (6) lack the columns before
template <class T> void six_columns(const T P[N][N], const T rows[6][N], int first, T S[6][N]) {
  T L[6][6], scales[6];
  for (int j = 0; j < 6; j++) {
    T pivot = rows[j][first + j];
    for (int k = 0; k < j; k++) pivot -= L[j][k] * L[j][k];
    T least = least_pivot(P[first + j][first + j]);
    scales[j] = Single<T>(1) / root(larger(pivot, least));
    for (int r = j + 1; r < 6; r++) {
      T total = rows[j][first + r];
      for (int k = 0; k < j; k++) total -= L[j][k] * L[r][k];
      L[r][j] = total * scales[j];
    }
  }
  substitute<N>(L, scales, rows, S);
  for (int j = 0; j < 6; j++)
    for (int i = 0; i < first + j; i++) S[j][i] = T{};
}

// Take the squares of six columns off the Schur complement of the others
template <class T> void take_off(const T S[6][N], T M[12][12]) {
  for (int i = 0; i < 12; i++) {
    const T a[6] = {S[0][6 + i], S[1][6 + i], S[2][6 + i], S[3][6 + i], S[4][6 + i], S[5][6 + i]};
    for (int j = is_single<T> ? 0 : i; j < 12; j++)
      M[i][j] -= paired(a, S[0] + 6, S[1] + 6, S[2] + 6, S[3] + 6, S[4] + 6, S[5] + 6, j);
    for (int j = 0; !is_single<T> && j < i; j++) M[i][j] = M[j][i];
  }
}

// The first columns of P's root, and the Schur complement of the others: (19)
template <class T> void root_of_six(const T P[N][N], Prediction<T> &w) {
  six_columns(P, P, 0, w.S);
  for (int i = 0; i < 12; i++)
    for (int j = 0; j < 12; j++) w.M[i][j] = P[6 + i][6 + j];
  take_off(w.S, w.M);
}
template <class T> void root_of_twelve(const T P[N][N], Prediction<T> &w) {
  root_of_six(P, w);
  for (int r = 6; r < 12; r++)
    for (int i = 0; i < N; i++) {
      T total = P[r][i];
      for (int k = 0; k < 6; k++) total -= w.S[k][r] * w.S[k][i];
      w.S[r][i] = total;
    }
  T rows[6][N];
  for (int r = 0; r < 6; r++)
    for (int i = 0; i < N; i++) rows[r][i] = w.S[6 + r][i];
  six_columns(P, rows, 6, w.S + 6);
  take_off(w.S + 6, w.M);
  for (int i = 0; i < 6; i++)
    for (int j = 0; j < 12; j++) w.M[i][j] = w.M[j][i] = T{};
}

// The linear part A of the model (2)-(5), (12): rows (x, v, torque, force) of `in` to rows (rho,
// omega, x, v, torque, force) of `out`, column by column
template <int COLUMNS, class T, class In, class Out>
void carry_linear(const Body<Single<T>> &body, const T R[3][3], Single<T> dt,
                  const WrenchWalk<Single<T>> &walk, In in, Out out) {
  using S = Single<T>;
  T A[3][3];  // rate from torque
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++)
      A[i][j] = row_times(body.inverse_inertia[i], R[j][0], R[j][1], R[j][2]);
  const S *c = body.com;
  S gain = dt / body.mass;
  bool offset = c[0] != S(0) || c[1] != S(0) || c[2] != S(0);
  for (int j = 0; j < COLUMNS; j++) {
    T t0 = in(6, j), t1 = in(7, j), t2 = in(8, j), v[3], w[3];
    for (int i = 0; i < 3; i++) w[i] = dt * (A[i][0] * t0 + A[i][1] * t1 + A[i][2] * t2);
    for (int i = 0; i < 3; i++) v[i] = gain * in(9 + i, j);
    if (offset) {  // the geometric centre also moves with the angular acceleration: com x alpha
      T px = c[1] * w[2] - c[2] * w[1], py = c[2] * w[0] - c[0] * w[2],
        pz = c[0] * w[1] - c[1] * w[0];
      for (int i = 0; i < 3; i++) v[i] += row_times(R[i], px, py, pz);
    }
    for (int i = 0; i < 3; i++) {
      out(i, j) = T{};
      out(3 + i, j) = w[i];
      out(6 + i, j) = in(i, j) + dt * (in(3 + i, j) + S(0.5) * v[i]);
      out(9 + i, j) = in(3 + i, j) + v[i];
    }
    for (int i = 0; i < 6; i++) out(12 + i, j) = walk.decay[i] * in(6 + i, j);
  }
}

// A M A' into P. The attitude's columns are zero
template <class T>
void carry_covariance(const Body<Single<T>> &body, const Prediction<T> &w, Single<T> dt,
                      T P[N][N]) {
  T Z[12][N], Y[N][12];
  carry_linear<12, T>(
      body, w.R, dt, w.walk, [&](int i, int j) { return w.M[i][j]; },
      [&](int i, int j) -> T & { return Y[i][j]; });
  for (int i = 0; i < N; i++)
    for (int j = 0; j < 12; j++) Z[j][i] = Y[i][j];
  for (int i = 0; i < N; i++)
    for (int j = 0; j < 3; j++) P[i][j] = T{};
  carry_linear<N - 3, T>(
      body, w.R, dt, w.walk, [&](int i, int j) { return Z[i][3 + j]; },
      [&](int i, int j) -> T & { return P[i][3 + j]; });
}

// The noise inputs B of motor torque and thrust, one standard deviation a row: (22), (27)
template <class T>
void noise_inputs(const Body<Single<T>> &body, const Settings<Single<T>> &s, const T R[3][3],
                  Single<T> dt, T B[6][N]) {
  using S = Single<T>;
  const S *c = body.com;
  S white = s.period / dt;  // stated per period: white noise averages over a longer step
  for (int n = 0; n < 3; n++) {
    for (int i = 0; i < N; i++) B[n][i] = B[3 + n][i] = T{};
    S torque = dt * root(white * s.motor_torque[n]);
    S thrust = dt * root(white * s.thrust[n]) / body.mass;
    const S a[3] = {body.inverse_inertia[0][n], body.inverse_inertia[1][n],
                    body.inverse_inertia[2][n]};
    for (int i = 0; i < 3; i++) {
      B[n][3 + i] = T{} + torque * a[i];
      B[3 + n][9 + i] = thrust * R[i][n];
      B[3 + n][6 + i] = S(0.5) * dt * B[3 + n][9 + i];
    }
    if (c[0] != S(0) || c[1] != S(0) || c[2] != S(0)) {
      S px = c[1] * a[2] - c[2] * a[1], py = c[2] * a[0] - c[0] * a[2],
        pz = c[0] * a[1] - c[1] * a[0];
      for (int i = 0; i < 3; i++) {
        B[n][9 + i] = torque * (R[i][0] * px + R[i][1] * py + R[i][2] * pz);
        B[n][6 + i] = S(0.5) * dt * B[n][9 + i];
      }
    }
  }
}

// P += B Q B': the sum of 24 of the 61 sigma points, (27)
template <class T>
void add_noise(const Body<Single<T>> &body, const WrenchWalk<Single<T>> &walk, const T B[6][N],
               T P[N][N]) {
  using S = Single<T>;
  for (int n = 0; n < 6; n++) P[12 + n][12 + n] += walk.variance[n];
  if (body.com[0] != S(0) || body.com[1] != S(0) || body.com[2] != S(0)) {
    add_squares<N>(P, B, S(1));
    return;
  }
  // else torque and thrust have nothing to do with each other: two blocks
  for (int i = 3; i < 6; i++)
    for (int j = 3; j < 6; j++)
      P[i][j] += B[0][i] * B[0][j] + B[1][i] * B[1][j] + B[2][i] * B[2][j];
  for (int i = 6; i < 12; i++)
    for (int j = 6; j < 12; j++)
      P[i][j] += B[3][i] * B[3][j] + (B[4][i] * B[4][j] + B[5][i] * B[5][j]);
}

// How far out sigma points lie, the factor of a pair's mean, and that of its differences: (28).
// With a pair of errors e and d, ee' + dd' = ((e - d)(e - d)' + (e + d)(e + d)') / 2; the second
// half is only there where the model is nonlinear, in the first 12 rows
template <class S> struct Spread {
  S spread, weight, scale;
  explicit Spread(S kappa)
      : spread(root(S(N + NOISE) + kappa)),
        weight(S(0.5) / (S(N + NOISE) + kappa)),
        scale(root(S(0.5) * weight)) {}
};

// Errors e (18) of the point `spread` along column j of the root, after the step
template <class T, class Move>
void error_of_point(const T *x, const T *column, Single<T> spread, const T *centre, Move move_point,
                    T *error) {
  T along[N], point[STATE], after[STATE];
  for (int i = 0; i < N; i++) along[i] = spread * column[i];
  displace(x, along, point);
  move_point(point, after);
  difference(after, centre, error);
}

// What a pair of points of column j adds: half difference, half sum and mean, (26)
template <class T>
void halve_pair(const T *plus, const T *minus, const Spread<Single<T>> &s, int j,
                Prediction<T> &w) {
  for (int i = 0; i < N; i++) w.H[j][i] = s.scale * (plus[i] - minus[i]);
  for (int i = 0; i < 12; i++) {
    T total = plus[i] + minus[i];
    w.E[j][i] = s.scale * total;
    w.mean[i] += s.weight * total;
  }
}

// Pairs of sigma points one after the other; `move_point` carries a state ahead: (24), (25)
template <int PAIRS, class T, class Move>
void pairs_in_turn(const T *x, const Spread<Single<T>> &s, Move move_point, Prediction<T> &w) {
  for (int i = 0; i < N; i++) w.mean[i] = T{};
  for (int j = 0; j < PAIRS; j++) {
    T plus[N], minus[N];
    error_of_point(x, w.S[j], s.spread, w.centre, move_point, plus);
    error_of_point(x, w.S[j], -s.spread, w.centre, move_point, minus);
    halve_pair(plus, minus, s, j, w);
  }
}

// The same of a single filter's six pairs, all points side by side in lanes: four forwards and
// backwards three times
template <class S>
void pairs_together(const Body<S> &body, const S *x, const Spread<S> &s, const S *rotors, S dt,
                    Prediction<S> &w) {
  using V = Lanes<S, 4>;
  static const S none[6] = {};
  S errors[12][N];
  for (int k = 0; k < 3; k++) {
    V along[N], point[STATE], after[STATE], error[N], R[3][3];
    for (int i = 0; i < N; i++)
      for (int n = 0; n < 4; n++)
        along[i][n] = (4 * k + n < 6 ? s.spread : -s.spread) * w.S[(4 * k + n) % 6][i];
    displace(x, along, point);
    matrix_of(point + QUATERNION, R);
    move(body, point, R, rotors, none, dt, after);
    decay_wrench(w.walk, after);
    difference(after, w.centre, error);
    for (int i = 0; i < N; i++)
      for (int n = 0; n < 4; n++) errors[4 * k + n][i] = error[i][n];
  }
  for (int i = 0; i < N; i++) w.mean[i] = S(0);
  for (int j = 0; j < 6; j++) halve_pair(errors[j], errors[6 + j], s, j, w);
}

// P += H' H + E' E - mean mean', x = centre + mean: (26), (27)
template <int PAIRS, class T> void gather(Belief<T> &f, Prediction<T> &w) {
  for (int first = 0; first < PAIRS; first += 6) {
    add_squares<N>(f.P, w.H + first, Single<T>(1));
    add_squares<12>(f.P, w.E + first, Single<T>(1));
  }
  for (int i = 0; i < 12; i++)
    for (int j = 0; j < 12; j++) f.P[i][j] -= w.mean[i] * w.mean[j];
  fold(w.centre, w.mean, f.x);
  symmetrise<N>(f.P);
  for (int i = 0; i < 3; i++) bound_variance<N>(f.P, i, Single<T>(LARGEST_MRP_VARIANCE));
  f.x[NIS] = T{} + Single<T>(NAN);
}

// Carry the part of P that is linear in the state, and the noise
template <class T, class E6>
void carry_linear_part(const Body<Single<T>> &body, const Settings<Single<T>> &s, const T *rotors,
                       const E6 *effects, Single<T> dt, Belief<T> &f, Prediction<T> &w) {
  follow_loads(s, w.walk, w.R, rotors, effects, f);
  carry_covariance(body, w, dt, f.P);
  noise_inputs(body, s, w.R, dt, w.B);
  add_noise(body, w.walk, w.B, f.P);
}

// Carry a filter, or lanes of filters, without wrench effects dt s ahead, at the rotors' wrench (4)
template <class T>
void carry(const Body<Single<T>> &body, const Settings<Single<T>> &s, const T *rotors, Single<T> dt,
           Belief<T> &f, Prediction<T> &w) {
  static const Single<T> none[6] = {};
  w.walk = WrenchWalk<Single<T>>(s, dt);
  matrix_of(f.x + QUATERNION, w.R);
  root_of_six(f.P, w);
  move(body, f.x, w.R, rotors, none, dt, w.centre);
  decay_wrench(w.walk, w.centre);
  carry_linear_part(body, s, rotors, none, dt, f, w);
  const Spread<Single<T>> spread(s.kappa);
  if constexpr (is_single<T> && WINDWRENCH_REGISTERS) {
    pairs_together(body, f.x, spread, rotors, dt, w);
  } else {
    pairs_in_turn<6>(
        f.x, spread,
        [&](const T *x, T *out) {
          T R[3][3];
          matrix_of(x + QUATERNION, R);
          move(body, x, R, rotors, none, dt, out);
          decay_wrench(w.walk, out);
        },
        w);
  }
  gather<6>(f, w);
}

// The same with wrench effects, which may depend on any of the state
template <class T>
void carry_with_effects(const Body<Single<T>> &body, Model<T> &model, const Settings<Single<T>> &s,
                        Single<T> dt, Belief<T> &f, Prediction<T> &w) {
  auto propagate = [&](const T *x, T *out) {
    T R[3][3];
    matrix_of(x + QUATERNION, R);
    apply_effects(model, x, R);
    move(body, x, R, model.rotor_wrench, model.effect_wrench, dt, out);
    decay_wrench(w.walk, out);
  };
  w.walk = WrenchWalk<Single<T>>(s, dt);
  root_of_twelve(f.P, w);
  matrix_of(f.x + QUATERNION, w.R);
  propagate(f.x, w.centre);
  carry_linear_part(body, s, model.rotor_wrench, model.effect_wrench, dt, f, w);
  pairs_in_turn<12>(f.x, Spread<Single<T>>(s.kappa), propagate, w);
  gather<12>(f, w);
}

}  // namespace windwrench
