// The nonlinear force and torque observer on a low-pass-filtered pose: reproduction/observer.py
// states its equations. `Observer` is what Python sees as a NumPy record: the same fields in the
// same order.
#pragma once
#include <algorithm>

#include "../ukf.hpp"

namespace windwrench {

constexpr double BUTTERWORTH = 0.7071067811865476;  // damping
constexpr double FORGOTTEN = 4;  // delays of a filter after which exp(-4) of its past is left

struct LowPass {
  double frequency, delay;   // rad/s; s, of a slow signal
  double transition[2][2];   // of output and its rate over a step
  double old[2], latest[2];  // what the last sample adds, and the present one: a straight line
};

struct Observer {
  LowPass translation, rotation;
  double force_decay[3], torque_decay[3];
  double p[3], v[3], q[4], dq[4];  // the filtered pose: centre of mass, quaternion, their rates
  double force[3], force_rate[3], torque[3], torque_rate[3];  // of the model, world, filtered
  double R[3][3], omega[3];                         // of the filtered attitude; rad/s, body
  double angular_momentum[3];                       // of the filtered pose, world axes
  double sample_p[3], sample_q[4], sample_R[3][3];  // the last sample, or the expected one
  double position_gap, attitude_gap;                // s since the last sample
};

inline void times(const double M[3][3], const double *x, double *out) {
  for (int i = 0; i < 3; i++) out[i] = row_times(M[i], x[0], x[1], x[2]);
}
inline void times_transposed(const double M[3][3], const double *x, double *out) {
  for (int i = 0; i < 3; i++) out[i] = M[0][i] * x[0] + M[1][i] * x[1] + M[2][i] * x[2];
}
inline void cross(const double *a, const double *b, double *out) {
  for (int i = 0; i < 3; i++) {
    int u = (i + 1) % 3, v = (i + 2) % 3;
    out[i] = a[u] * b[v] - a[v] * b[u];
  }
}

// Move a filter's output y (SIZE) and its rate on by a step, its input from `old` to `latest`
template <int SIZE>
void follow(const LowPass &g, double *y, double *dy, const double *old, const double *latest) {
  for (int i = 0; i < SIZE; i++) {
    const double value = y[i], rate = dy[i];
    y[i] = g.transition[0][0] * value + g.transition[0][1] * rate + g.old[0] * old[i] +
           g.latest[0] * latest[i];
    dy[i] = g.transition[1][0] * value + g.transition[1][1] * rate + g.old[1] * old[i] +
            g.latest[1] * latest[i];
  }
}

// Filter a force or torque u (3) that is constant over the step; u becomes the integral of the
// filtered one over the step, by the filter's own equation
inline void follow_model(const LowPass &g, double *y, double *dy, double dt, double *u) {
  double value[3], rate[3];
  std::copy_n(y, 3, value);
  std::copy_n(dy, 3, rate);
  follow<3>(g, y, dy, u, u);
  for (int i = 0; i < 3; i++) {
    double lag = (dy[i] - rate[i]) / g.frequency + 2 * BUTTERWORTH * (y[i] - value[i]);
    u[i] = u[i] * dt - lag / g.frequency;
  }
}

// Rotation, body rate and angular momentum (world axes) of the filtered attitude
inline void find_twist(const Body<double> &body, Observer &o) {
  const double *q = o.q, *d = o.dq;
  double square = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3], scale = 2 / square;
  double unit[4], h[3];
  // 2 q* q' / |q|^2: the norm, which a filter does not keep, drops out
  o.omega[0] = scale * (q[0] * d[1] - q[1] * d[0] - q[2] * d[3] + q[3] * d[2]);
  o.omega[1] = scale * (q[0] * d[2] - q[2] * d[0] - q[3] * d[1] + q[1] * d[3]);
  o.omega[2] = scale * (q[0] * d[3] - q[3] * d[0] - q[1] * d[2] + q[2] * d[1]);
  for (int i = 0; i < 4; i++) unit[i] = q[i] / root(square);
  matrix_of(unit, o.R);
  times(body.inertia, o.omega, h);
  times(o.R, h, o.angular_momentum);
}

// The rate of the filtered quaternion is that of a turn at omega: (11), (13)
inline void find_spin(Observer &o) {
  const double *q = o.q, *w = o.omega;
  o.dq[0] = 0.5 * (-q[1] * w[0] - q[2] * w[1] - q[3] * w[2]);
  o.dq[1] = 0.5 * (q[0] * w[0] + q[2] * w[2] - q[3] * w[1]);
  o.dq[2] = 0.5 * (q[0] * w[1] + q[3] * w[0] - q[1] * w[2]);
  o.dq[3] = 0.5 * (q[0] * w[2] + q[1] * w[1] - q[2] * w[0]);
}

// The attitude's filter stands where it is for a vehicle that turns at omega and is at q
inline void seat_attitude(const Body<double> &body, Observer &o, const double *q) {
  turn_body(q, o.omega, -o.rotation.delay, o.q);
  find_spin(o);
  find_twist(body, o);
}

// Start at the pose and twist of the filter's state
inline void start(const Filter<double> &f, Observer &o) {
  const double *x = f.belief.x, *com = f.vehicle.body.com;
  double lever[3], swing[3];
  std::copy_n(x + QUATERNION, 4, o.sample_q);
  std::copy_n(x + RATE, 3, o.omega);
  matrix_of(o.sample_q, o.sample_R);
  times(o.sample_R, com, lever);
  cross(x + RATE, com, swing);
  times(o.sample_R, swing, o.v);
  for (int i = 0; i < 3; i++) {
    o.sample_p[i] = x[i] + lever[i];
    o.v[i] += x[VELOCITY + i];
    o.force[i] = o.force_rate[i] = o.torque[i] = o.torque_rate[i] = 0;
    o.p[i] = o.sample_p[i] - o.translation.delay * o.v[i];
  }
  o.position_gap = o.attitude_gap = 0;
  seat_attitude(f.vehicle.body, o, o.sample_q);
}

inline void observe_force(Filter<double> &f, Observer &o, const double *impulse, const double *old,
                          bool measured, double dt) {
  double *force = f.belief.x + FORCE, mass = f.vehicle.body.mass, before[3];
  std::copy_n(o.v, 3, before);
  if (measured) follow<3>(o.translation, o.p, o.v, old, o.sample_p);
  for (int i = 0; i < 3; i++) {
    if (measured) {
      double keep = o.force_decay[i];
      force[i] = keep * force[i] + (1 - keep) / dt * (mass * (o.v[i] - before[i]) - impulse[i]);
    } else {
      double change = (impulse[i] + force[i] * dt) / mass;
      o.p[i] += dt * (o.v[i] + 0.5 * change);
      o.v[i] += change;
    }
  }
}

inline void observe_torque(Filter<double> &f, Observer &o, const double *impulse, const double *old,
                           bool measured, double dt) {
  double *torque = f.belief.x + TORQUE, *h = o.angular_momentum, before[4];
  const Body<double> &body = f.vehicle.body;
  if (measured) {
    std::copy_n(h, 3, before);
    follow<4>(o.rotation, o.q, o.dq, old, o.sample_q);
    find_twist(body, o);
    for (int i = 0; i < 3; i++) {
      double keep = o.torque_decay[i];
      torque[i] = keep * torque[i] + (1 - keep) / dt * (h[i] - before[i] - impulse[i]);
    }
    return;
  }
  std::copy_n(o.q, 4, before);
  turn_body(before, o.omega, dt, o.q);
  normalise(o.q);
  matrix_of(o.q, o.R);
  for (int i = 0; i < 3; i++) h[i] += impulse[i] + torque[i] * dt;
  times_transposed(o.R, h, before);
  times(body.inverse_inertia, before, o.omega);
  find_spin(o);
}

// Pose and twist as they are now: the filtered ones, ahead by the filters' delay. The inverse of
// the filter is y + 2 d / w y' + y'' / w^2, with derivatives of v and omega from the model
inline void look_ahead(Filter<double> &f, Observer &o) {
  const Body<double> &body = f.vehicle.body;
  double *x = f.belief.x, R[3][3], a[3], b[3], alpha[3], quick[3], turn[3];
  for (int i = 0; i < 3; i++) a[i] = o.torque[i] + x[TORQUE + i];
  times_transposed(o.R, a, alpha);
  times(body.inertia, o.omega, a);
  cross(o.omega, a, b);
  for (int i = 0; i < 3; i++) b[i] = alpha[i] - b[i];
  times(body.inverse_inertia, b, alpha);
  times_transposed(o.R, o.torque_rate, a);
  times(body.inverse_inertia, a, quick);
  double delay = o.rotation.delay, square = o.rotation.frequency * o.rotation.frequency;
  for (int i = 0; i < 3; i++) {
    x[RATE + i] = o.omega[i] + delay * alpha[i] + quick[i] / square;
    turn[i] = delay * o.omega[i] + alpha[i] / square;
  }
  turn_body(o.q, turn, 1.0, x + QUATERNION);
  normalise(x + QUATERNION);
  delay = o.translation.delay, square = o.translation.frequency * o.translation.frequency;
  // from the centre of mass to the geometric centre
  matrix_of(x + QUATERNION, R);
  cross(x + RATE, body.com, a);
  times(R, a, b);
  times(R, body.com, a);
  for (int i = 0; i < 3; i++) {
    double acceleration = (o.force[i] + x[FORCE + i]) / body.mass;
    x[VELOCITY + i] = o.v[i] + delay * acceleration + o.force_rate[i] / (body.mass * square) - b[i];
    x[i] = o.p[i] + delay * o.v[i] + acceleration / square - a[i];
  }
}

// Go dt s on, the period for which the observer was made, with the parts of f.z that were
// measured; returns the usable ones, or -1 if the quaternion is no rotation
inline int step(Filter<double> &f, Observer &o, int parts, double dt, double voltage) {
  parts = check_sample(f.settings, f.belief, f.z, parts);
  if (parts < 0) return parts;
  const double *z = true_sample(f, parts, dt);
  Model<double> &m = f.vehicle;
  double *x = f.belief.x, old_p[3], old_q[4], R[3][3], lever[3], force[3], torque[3], own[3];
  const bool position = parts & POSITION_PART, attitude = parts & ATTITUDE_PART;
  f.belief.status = parts ? TRACKING : COASTING;
  x[NIS] = NAN;
  drive(m, z, dt, voltage);
  // the samples: those measured, else the expected ones
  std::copy_n(o.sample_p, 3, old_p);
  std::copy_n(o.sample_q, 4, old_q);
  std::copy_n(o.sample_R[0], 9, R[0]);
  apply_effects(m, x, R);
  turn_body(old_q, x + RATE, dt, o.sample_q);
  normalise(o.sample_q);
  if (attitude) {
    // a quaternion and its negative are one attitude: take the one near the expected
    double along = 0;
    for (int i = 0; i < 4; i++) along += o.sample_q[i] * z[7 + i];
    for (int i = 0; i < 4; i++) o.sample_q[i] = along >= 0 ? z[7 + i] : -z[7 + i];
  }
  matrix_of(o.sample_q, o.sample_R);
  times(o.sample_R, m.body.com, lever);
  for (int i = 0; position && i < 3; i++) o.sample_p[i] = z[4 + i] + lever[i];
  // the model at the mean attitude of the step
  for (int i = 0; i < 3; i++) {
    own[i] = m.rotor_wrench[1 + i] + m.effect_wrench[3 + i];
    for (int j = 0; j < 3; j++) R[i][j] = 0.5 * R[i][j] + 0.5 * o.sample_R[i][j];
    force[i] = R[i][2] * m.rotor_wrench[0] + m.effect_wrench[i];
  }
  force[2] -= m.body.mass * m.body.gravity;
  times(R, own, torque);
  follow_model(o.translation, o.force, o.force_rate, dt, force);
  follow_model(o.rotation, o.torque, o.torque_rate, dt, torque);
  // after a gap that the filter has forgotten, the error of the dead reckoning is no motion: start
  // from the new sample
  if (attitude && o.attitude_gap > FORGOTTEN * o.rotation.delay) {
    turn_body(o.sample_q, o.omega, -dt, old_q);
    seat_attitude(m.body, o, old_q);
  }
  for (int i = 0; position && o.position_gap > FORGOTTEN * o.translation.delay && i < 3; i++) {
    old_p[i] = o.sample_p[i] - dt * o.v[i];
    o.p[i] = old_p[i] - o.translation.delay * o.v[i];
  }
  o.position_gap = position ? 0 : o.position_gap + dt;
  o.attitude_gap = attitude ? 0 : o.attitude_gap + dt;
  observe_torque(f, o, torque, old_q, attitude, dt);
  observe_force(f, o, force, old_p, position, dt);
  look_ahead(f, o);
  for (int i = 0; !position && i < 3; i++) o.sample_p[i] = x[i] + lever[i];
  m.time += dt;
  return parts;
}

}  // namespace windwrench
