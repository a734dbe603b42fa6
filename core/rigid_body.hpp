// How a quadrotor moves: the prediction model of McKinnon and Schoellig, (1)-(5) and (8)-(14).
//
// Zero-order hold: attitude, thrust, torque and wrench are taken at the start of the step.
#pragma once
#include "rotation.hpp"

namespace windwrench {

// the state: position m, quaternion, velocity m/s (world), rate rad/s (body), external torque Nm
// and force N (world), and the NIS of the last measurement behind it
constexpr int QUATERNION = 3, VELOCITY = 7, RATE = 10, TORQUE = 13, FORCE = 16, NIS = 19;
constexpr int STATE = 20, N = 18;              // N: error state (rho, omega, x, v, torque, force)
constexpr double LARGEST_MRP_VARIANCE = 0.25;  // a standard deviation of about 115 degrees

template <class S> struct Body {
  S mass;                   // kg
  S gravity;                // m/s2
  S com[3];                 // m, centre of mass from the geometric centre
  S inertia[3][3];          // kg m2
  S inverse_inertia[3][3];  // 1/(kg m2)
  S k[4];                   // N/(rad/s)2, thrust of each rotor
  S mixing[4][4];           // squared rotor speeds to thrust N and torques Nm
};

// total thrust N and body torques about the centre of mass Nm, out (4), at rotor speeds (4) rad/s:
// (1), (8)-(10)
template <class T, class B> void rotor_wrench(const Body<B> &body, const T *speeds, T *out) {
  for (int i = 0; i < 4; i++) {
    out[i] = T{};
    for (int j = 0; j < 4; j++) out[i] += body.mixing[i][j] * speeds[j] * speeds[j];
  }
  out[1] -= body.com[1] * out[0];
  out[2] += body.com[0] * out[0];
}

template <class T, class S> T row_times(const S *row, T x, T y, T z) {
  return row[0] * x + row[1] * y + row[2] * z;
}

// angular acceleration out (3) rad/s2, body, at the rate w (3) and an external torque (3), world:
// (12). rotors (4): thrust and torques; effects (6): declared effects' force, world, and torque,
// body
template <class T, class B, class R4, class E6>
void angular_acceleration(const Body<B> &b, const T R[3][3], const T *w, const T *torque,
                          const R4 *rotors, const E6 *effects, T *out) {
  T wx = w[0], wy = w[1], wz = w[2];
  T hx = row_times(b.inertia[0], wx, wy, wz), hy = row_times(b.inertia[1], wx, wy, wz),
    hz = row_times(b.inertia[2], wx, wy, wz);
  T turned[3];  // the external torque in the body frame, R' tau, beside the others
  for (int i = 0; i < 3; i++)
    turned[i] = rotors[1 + i] + effects[3 + i] + R[0][i] * torque[0] + R[1][i] * torque[1] +
                R[2][i] * torque[2];
  T tx = turned[0] - (wy * hz - wz * hy), ty = turned[1] - (wz * hx - wx * hz),
    tz = turned[2] - (wx * hy - wy * hx);
  for (int i = 0; i < 3; i++) out[i] = row_times(b.inverse_inertia[i], tx, ty, tz);
}

// acceleration out (3) of the geometric centre, m/s2, world, at an angular acceleration a (3) and
// an external force (3): (4), and about the centre of mass alpha x c + omega x (omega x c)
template <class T, class B, class R4, class E6>
void centre_acceleration(const Body<B> &b, const T R[3][3], const T *w, const T *a, const T *force,
                         const R4 *rotors, const E6 *effects, T *out) {
  T wx = w[0], wy = w[1], wz = w[2];
  B cx = -b.com[0], cy = -b.com[1], cz = -b.com[2], inverse = Single<T>(1) / b.mass;
  T nx = wy * cz - wz * cy, ny = wz * cx - wx * cz, nz = wx * cy - wy * cx;
  T px = a[1] * cz - a[2] * cy + wy * nz - wz * ny, py = a[2] * cx - a[0] * cz + wz * nx - wx * nz,
    pz = a[0] * cy - a[1] * cx + wx * ny - wy * nx;
  for (int i = 0; i < 3; i++)
    out[i] = (R[i][2] * rotors[0] + force[i] + effects[i]) * inverse + row_times(R[i], px, py, pz);
  out[2] -= b.gravity;
}

// both, out (6), at a state x
template <class T, class B, class R4, class E6>
void accelerations(const Body<B> &b, const T R[3][3], const T *x, const R4 *rotors,
                   const E6 *effects, T *out) {
  angular_acceleration(b, R, x + RATE, x + TORQUE, rotors, effects, out + 3);
  centre_acceleration(b, R, x + RATE, out + 3, x + FORCE, rotors, effects, out);
}

// angular acceleration rad/s2, body, that (12) lacks of the exact turn of the angular momentum;
// square: that of the step's angle. (12) takes -omega x J omega at the step's start for all of it,
// explicit Euler, which adds energy without bound in long turns. The momentum of a free body turns
// by exp(-[omega dt]x), at a constant length
template <class T>
void gyroscopic_rest(const Body<Single<T>> &b, const T *rate, T square, Single<T> dt, T *out) {
  using S = Single<T>;
  T wx = rate[0], wy = rate[1], wz = rate[2];
  T hx = row_times(b.inertia[0], wx, wy, wz), hy = row_times(b.inertia[1], wx, wy, wz),
    hz = row_times(b.inertia[2], wx, wy, wz);
  T gx = wy * hz - wz * hy, gy = wz * hx - wx * hz, gz = wx * hy - wy * hx, angle = root(square);
  T first = S(1) - sine(angle) / angle, second = dt * (S(1) - cosine(angle)) / square;
  T tx = first * gx + second * (wy * gz - wz * gy), ty = first * gy + second * (wz * gx - wx * gz),
    tz = first * gz + second * (wx * gy - wy * gx);
  for (int i = 0; i < 3; i++) out[i] = row_times(b.inverse_inertia[i], tx, ty, tz);
}

// the same over a step of dt s, whose turn may be long
template <class T, class R4, class E6>
void step_accelerations(const Body<Single<T>> &body, const T *x, const T R[3][3], const R4 *rotors,
                        const E6 *effects, Single<T> dt, T *a) {
  using S = Single<T>;
  accelerations(body, R, x, rotors, effects, a);
  const T *w = x + RATE;
  T square = dt * dt * (w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
  auto far = square > T{} + S(0.25) * S(0.25);  // rad: (12) stands as printed below
  if (any(far)) {
    T rest[3];
    gyroscopic_rest(body, w, square, dt, rest);
    for (int i = 0; i < 3; i++) a[3 + i] += choose(far, rest[i], T{});
  }
}

// the state that follows x after dt s, out, R being the matrix of its attitude: (2)-(5), (11)-(14)
template <class T, class R4, class E6>
void move(const Body<Single<T>> &body, const T *x, const T R[3][3], const R4 *rotors,
          const E6 *effects, Single<T> dt, T *out) {
  using S = Single<T>;
  T a[6];
  const T *w = x + RATE;
  step_accelerations(body, x, R, rotors, effects, dt, a);
  for (int i = 0; i < 3; i++) {
    out[i] = x[i] + dt * (x[VELOCITY + i] + S(0.5) * dt * a[i]);
    out[VELOCITY + i] = x[VELOCITY + i] + dt * a[i];
    out[RATE + i] = w[i] + dt * a[3 + i];
    out[TORQUE + i] = x[TORQUE + i];
    out[FORCE + i] = x[FORCE + i];
  }
  turn_body(x + QUATERNION, w, dt, out + QUATERNION);
}

// the sigma point `error` (18) away from x: (24), (35)
template <class T, class X> void displace(const X *x, const T *error, T *out) {
  T turn[4], q[4];
  quaternion_of(error, turn);
  for (int i = 0; i < 4; i++) q[i] = T{} + x[QUATERNION + i];
  multiply(turn, q, out + QUATERNION);
  for (int i = 0; i < 3; i++) {
    out[RATE + i] = x[RATE + i] + error[3 + i];
    out[i] = x[i] + error[6 + i];
    out[VELOCITY + i] = x[VELOCITY + i] + error[9 + i];
    out[TORQUE + i] = x[TORQUE + i] + error[12 + i];
    out[FORCE + i] = x[FORCE + i] + error[15 + i];
  }
}

// error state (18) of a sigma point seen from the central one: (25)
template <class T, class X> void difference(const T *after, const X *centre, T *error) {
  T q[4];
  for (int i = 0; i < 4; i++) q[i] = T{} + centre[QUATERNION + i];
  attitude_error(after + QUATERNION, q, error);
  for (int i = 0; i < 3; i++) {
    error[3 + i] = after[RATE + i] - centre[RATE + i];
    error[6 + i] = after[i] - centre[i];
    error[9 + i] = after[VELOCITY + i] - centre[VELOCITY + i];
    error[12 + i] = after[TORQUE + i] - centre[TORQUE + i];
    error[15 + i] = after[FORCE + i] - centre[FORCE + i];
  }
}

// x = base plus an error state (18); the mean MRP folds into the quaternion: (26), (35), (37)
template <class T> void fold(const T *base, const T *error, T *x) {
  displace(base, error, x);
  normalise(x + QUATERNION);
}

}  // namespace windwrench
