// Rotations: unit quaternions (scalar first, Hamilton, body to world) and modified Rodrigues
// parameters (MRP), rho = axis * tan(angle / 4). Equation numbers: McKinnon and Schoellig, IROS
// 2016.
#pragma once
#include "numbers.hpp"

namespace windwrench {

// out = a * b, Hamilton's product; out is neither of them
template <class T> void multiply(const T *a, const T *b, T *out) {
  out[0] = a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3];
  out[1] = a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2];
  out[2] = a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1];
  out[3] = a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0];
}

// R from body to world: (7) with +2 q0 [qv]x
template <class T> void matrix_of(const T *q, T R[3][3]) {
  using S = Single<T>;
  T w = q[0], x = q[1], y = q[2], z = q[3];
  R[0][0] = S(1) - S(2) * (y * y + z * z);
  R[0][1] = S(2) * (x * y - w * z);
  R[0][2] = S(2) * (x * z + w * y);
  R[1][0] = S(2) * (x * y + w * z);
  R[1][1] = S(1) - S(2) * (x * x + z * z);
  R[1][2] = S(2) * (y * z - w * x);
  R[2][0] = S(2) * (x * z - w * y);
  R[2][1] = S(2) * (y * z + w * x);
  R[2][2] = S(1) - S(2) * (x * x + y * y);
}

// quaternion of an MRP: (17)
template <class T> void quaternion_of(const T *rho, T *q) {
  using S = Single<T>;
  T square = rho[0] * rho[0] + rho[1] * rho[1] + rho[2] * rho[2], scale = S(1) / (S(1) + square);
  q[0] = (S(1) - square) * scale;
  for (int i = 0; i < 3; i++) q[1 + i] = S(2) * rho[i] * scale;
}

// MRP, world, that takes attitude b to a: a * conj(b), (16), (25). At most 1 long: half a turn
template <class T> void attitude_error(const T *a, const T *b, T *rho) {
  using S = Single<T>;
  T w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3], one = T{} + S(1);
  T sign = choose(w >= T{}, one, -one), scale = sign / (S(1) + sign * w);
  rho[0] = (-a[0] * b[1] + a[1] * b[0] - a[2] * b[3] + a[3] * b[2]) * scale;
  rho[1] = (-a[0] * b[2] + a[1] * b[3] + a[2] * b[0] - a[3] * b[1]) * scale;
  rho[2] = (-a[0] * b[3] - a[1] * b[2] + a[2] * b[1] + a[3] * b[0]) * scale;
}

template <class T> void normalise(T *q) {
  T scale = Single<T>(1) / root(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (int i = 0; i < 4; i++) q[i] *= scale;
}

// out = q turned at the body rate (3) rad/s for dt s: (11), (13), -[psi]x
template <class T> void turn_body(const T *q, const T *rate, Single<T> dt, T *out) {
  using S = Single<T>;
  S half = S(0.5) * dt;
  T square = half * half * (rate[0] * rate[0] + rate[1] * rate[1] + rate[2] * rate[2]);
  // cosine of half the turn, and its sine over the rate: series to the last digit of a double
  T c = S(1) -
        square / S(2) * (S(1) - square / S(12) * (S(1) - square / S(30) * (S(1) - square / S(56))));
  T s = half *
        (S(1) - square / S(6) *
                    (S(1) - square / S(20) * (S(1) - square / S(42) * (S(1) - square / S(72)))));
  auto large = square >= T{} + S(0.01);
  if (any(large)) {
    T angle = root(square);
    c = choose(large, cosine(angle), c);
    s = choose(large, half * sine(angle) / angle, s);
  }
  T x = rate[0] * s, y = rate[1] * s, z = rate[2] * s;
  T q0 = q[0], q1 = q[1], q2 = q[2], q3 = q[3];
  out[0] = q0 * c - q1 * x - q2 * y - q3 * z;
  out[1] = q1 * c + q0 * x + q2 * z - q3 * y;
  out[2] = q2 * c + q0 * y + q3 * x - q1 * z;
  out[3] = q3 * c + q0 * z + q1 * y - q2 * x;
}

}  // namespace windwrench
