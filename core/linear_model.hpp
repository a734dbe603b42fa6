// The model (2)-(5), (11)-(14), linearised at an estimate: F, the derivative of the error state
// after a step by the one before.
#pragma once
#include "effects.hpp"
#include "linear_algebra.hpp"
#include "wrench_walk.hpp"

namespace windwrench {

// out += scale [(x, y, z)]x, in the block that starts at a row and a column
template <class S> void add_cross(S out[][N], int row, int column, S x, S y, S z, S scale) {
  out[row][column + 1] -= scale * z;
  out[row][column + 2] += scale * y;
  out[row + 1][column] += scale * z;
  out[row + 1][column + 2] -= scale * x;
  out[row + 2][column] -= scale * y;
  out[row + 2][column + 1] += scale * x;
}

// Add the derivatives of the declared effects' wrench by (rho, omega, x, v) to those of the force,
// rows 9-11 of A, and of the torque, B, at a state x of attitude R. Central differences: an effect
// model is a black box. Overwrites m.effect_wrench
template <class S>
void add_effect_jacobian(Model<S> &m, const S *x, const S R[3][3], S A[12][N], S B[3][N]) {
  constexpr bool fine = sizeof(S) == 8;
  for (int n = 0; n < 12; n++) {
    int kind = n / 3, axis = n % 3, a = (axis + 1) % 3, b = (axis + 2) % 3;
    S size = kind == 0 ? S(fine ? 1e-6 : 4e-3) : S(fine ? 1e-5 : 1e-2);  // rad; m, m/s, rad/s
    S change[6];
    for (int side = 0; side < 2; side++) {
      S step = side == 0 ? size : -size, point[STATE], turned[3][3];
      for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) turned[i][j] = R[i][j];
      for (int i = 0; i < NIS; i++) point[i] = x[i];
      if (kind == 0) {
        S c = cosine(size), s = sine(step);
        for (int j = 0; j < 3; j++) {
          turned[a][j] = c * R[a][j] - s * R[b][j];
          turned[b][j] = s * R[a][j] + c * R[b][j];
        }
      } else {
        point[axis + (kind == 1 ? RATE : kind == 2 ? 0 : VELOCITY)] += step;
      }
      apply_effects(m, point, turned);
      for (int i = 0; i < 6; i++)
        change[i] = side == 0 ? m.effect_wrench[i] : change[i] - m.effect_wrench[i];
    }
    S scale = S(kind == 0 ? 4 : 1);  // an MRP is a quarter of an angle
    for (int i = 0; i < 3; i++) {
      A[9 + i][n] += scale * (change[i] / (S(2) * size));
      B[i][n] += scale * (change[3 + i] / (S(2) * size));
    }
  }
}

// Add to rows 9-11 of A what the geometric centre's acceleration has beyond that of the centre of
// mass, at c from it: R (alpha x c + omega x (omega x c)), here s in the body frame
template <class S>
void add_offset_jacobian(const Body<S> &body, const S *w, const S R[3][3], const S *alpha,
                         S A[12][N]) {
  S B[3][N];
  S c0 = -body.com[0], c1 = -body.com[1], c2 = -body.com[2];
  S n0 = w[1] * c2 - w[2] * c1, n1 = w[2] * c0 - w[0] * c2, n2 = w[0] * c1 - w[1] * c0;
  S s0 = alpha[1] * c2 - alpha[2] * c1 + w[1] * n2 - w[2] * n1;
  S s1 = alpha[2] * c0 - alpha[0] * c2 + w[2] * n0 - w[0] * n2;
  S s2 = alpha[0] * c1 - alpha[1] * c0 + w[0] * n1 - w[1] * n0;
  for (int j = 0; j < N; j++) {
    B[0][j] = A[4][j] * c2 - A[5][j] * c1;
    B[1][j] = A[5][j] * c0 - A[3][j] * c2;
    B[2][j] = A[3][j] * c1 - A[4][j] * c0;
  }
  // omega x (omega x c) = omega (omega' c) - c omega' omega
  S dot = w[0] * c0 + w[1] * c1 + w[2] * c2;
  for (int i = 0; i < 3; i++) {
    S c = -body.com[i];
    B[i][3] += w[i] * c0 - S(2) * c * w[0];
    B[i][4] += w[i] * c1 - S(2) * c * w[1];
    B[i][5] += w[i] * c2 - S(2) * c * w[2];
    B[i][3 + i] += dot;
  }
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < N; j++) A[9 + i][j] += row_times(R[i], B[0][j], B[1][j], B[2][j]);
  add_cross(A, 9, 0, row_times(R[0], s0, s1, s2), row_times(R[1], s0, s1, s2),
            row_times(R[2], s0, s1, s2), S(-4));
}

// Derivatives by the error state of the angular acceleration (body), rows 3-5 of A, and of the
// geometric centre's acceleration (world), rows 9-11, at a state x of attitude R and angular
// acceleration alpha: (4), (12). Those of declared effects, if wanted, overwrite m.effect_wrench
template <class S>
void acceleration_jacobian(Model<S> &m, const S *x, const S R[3][3], const S *alpha, bool effects,
                           S A[12][N]) {
  const Body<S> &body = m.body;
  const S *tau = x + TORQUE, *w = x + RATE;
  const auto &J = body.inertia;
  S B[3][N] = {};  // of the torque in the body frame; rows 9-11: of the force in the world frame
  for (int i = 0; i < 3; i++) {
    for (int j = 0; j < N; j++) A[9 + i][j] = S(0);
    // R' tau at an attitude turned by 4 rho: R' (tau + tau x 4 rho)
    S t0 = R[0][i], t1 = R[1][i], t2 = R[2][i];
    B[i][0] = S(4) * (t1 * tau[2] - t2 * tau[1]);
    B[i][1] = S(4) * (t2 * tau[0] - t0 * tau[2]);
    B[i][2] = S(4) * (t0 * tau[1] - t1 * tau[0]);
    for (int j = 0; j < 3; j++) B[i][12 + j] = R[j][i];
    A[9 + i][15 + i] = S(1);
  }
  // - omega x J omega
  add_cross(B, 0, 3, row_times(J[0], w[0], w[1], w[2]), row_times(J[1], w[0], w[1], w[2]),
            row_times(J[2], w[0], w[1], w[2]), S(1));
  for (int j = 0; j < 3; j++) {
    B[0][3 + j] -= w[1] * J[2][j] - w[2] * J[1][j];
    B[1][3 + j] -= w[2] * J[0][j] - w[0] * J[2][j];
    B[2][3 + j] -= w[0] * J[1][j] - w[1] * J[0][j];
  }
  S thrust = m.rotor_wrench[0];  // along the body's z axis
  add_cross(A, 9, 0, R[0][2] * thrust, R[1][2] * thrust, R[2][2] * thrust, S(-4));
  if (effects && m.wrench_count > 0) add_effect_jacobian(m, x, R, A, B);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < N; j++) {
      A[3 + i][j] = row_times(body.inverse_inertia[i], B[0][j], B[1][j], B[2][j]);
      A[9 + i][j] /= body.mass;
    }
  if (body.com[0] != S(0) || body.com[1] != S(0) || body.com[2] != S(0))
    add_offset_jacobian(body, w, R, alpha, A);
}

// The first 12 rows of F - 1, A, of a step of dt s; the rows of torque and force are zero
template <class S>
void model_jacobian(Model<S> &m, const S *x, const S R[3][3], const S *alpha, S dt, bool effects,
                    S A[12][N]) {
  for (int i = 0; i < 12; i++)
    for (int j = 0; j < N; j++) A[i][j] = S(0);
  acceleration_jacobian(m, x, R, alpha, effects, A);
  // the turn of this step is at the old rate: 4 d(rho) = R Jl(omega dt) dt d(omega), Jl the left
  // Jacobian of SO(3)
  S px = x[RATE] * dt, py = x[RATE + 1] * dt, pz = x[RATE + 2] * dt,
    q = px * px + py * py + pz * pz;
  // the series, to 1e-9
  S half = S(0.5) - q / S(24) * (S(1) - q / S(30) * (S(1) - q / S(56)));
  S third = (S(1) - q / S(20) * (S(1) - q / S(42) * (S(1) - q / S(72)))) / S(6);
  if (q > S(0.25)) {
    S angle = root(q);
    half = (S(1) - cosine(angle)) / q;
    third = (angle - sine(angle)) / (q * angle);
  }
  for (int i = 0; i < 3; i++) {
    S r0 = R[i][0], r1 = R[i][1], r2 = R[i][2];
    S along = third * (r0 * px + r1 * py + r2 * pz), straight = S(1) - third * q;
    A[i][3] = S(0.25) * dt * (straight * r0 + along * px + half * (r1 * pz - r2 * py));
    A[i][4] = S(0.25) * dt * (straight * r1 + along * py + half * (r2 * px - r0 * pz));
    A[i][5] = S(0.25) * dt * (straight * r2 + along * pz + half * (r0 * py - r1 * px));
    for (int j = 0; j < N; j++) {
      A[3 + i][j] *= dt;
      A[9 + i][j] *= dt;
      A[6 + i][j] = S(0.5) * dt * A[9 + i][j];
    }
    A[6 + i][9 + i] += dt;
  }
}

// P = F P F' = P + A P + (A P)' + A P A', A (12 rows) being sparse; torque and force then decay
template <class S> void carry_by_jacobian(const WrenchWalk<S> &walk, const S A[12][N], S P[N][N]) {
  S G[12][N] = {};
  for (int i = 0; i < 12; i++)
    for (int k = 0; k < N; k++)
      if (A[i][k] != S(0))
        for (int j = 0; j < N; j++) G[i][j] += A[i][k] * P[k][j];
  for (int i = 0; i < 12; i++) {
    for (int j = 0; j < N; j++) {
      P[i][j] += G[i][j];
      P[j][i] += G[i][j];
    }
    for (int k = 0; k < N; k++)
      if (A[i][k] != S(0))
        for (int j = 0; j < 12; j++) P[j][i] += A[i][k] * G[j][k];
  }
  for (int i = 0; i < 6; i++)
    for (int j = 0; j < N; j++) {
      P[12 + i][j] *= walk.decay[i];
      P[j][12 + i] *= walk.decay[i];
    }
}

}  // namespace windwrench
