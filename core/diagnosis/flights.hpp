// A model along a logged flight of n rows: its wrench, its predictions, and poses without its
// sensing effects. What Python says of each stands in identification/.
#pragma once
#include <algorithm>
#include <cstdint>

#include "../effects.hpp"

namespace windwrench {

// The rotors at each row of a log
struct LoggedRotors {
  int64_t n;
  const double (*speeds)[4];  // rad/s
  const double *voltage;      // V; 0: not known
};

// The motion at each row; its angular acceleration is measured
struct LoggedMotion {
  const double (*position)[3], (*rotation)[3][3], (*velocity)[3], (*rate)[3], (*turning)[3];
};

// Force N, world, and torque Nm, body, out (n, 6), of a model's accelerations, for a body of this
// mass and inertia. The measured angular acceleration moves the pose's point about a centre of mass
// off this point
inline void acting_wrench(Model<double> &m, double period, const LoggedRotors &rotors,
                          const LoggedMotion &flown, double mass, const double J[3][3],
                          double (*out)[6]) {
  const double none[3] = {};
  for (int64_t k = 0; k < rotors.n; k++) {
    double x[STATE] = {}, a[3], alpha[3];
    for (int i = 0; i < 3; i++) {
      x[i] = flown.position[k][i];
      x[VELOCITY + i] = flown.velocity[k][i];
      x[RATE + i] = flown.rate[k][i];
    }
    const double (*R)[3] = flown.rotation[k];
    drive(m, rotors.speeds[k], period, rotors.voltage[k]);
    apply_effects(m, x, R);
    m.time += period;
    const double *w = x + RATE;
    centre_acceleration(m.body, R, w, flown.turning[k], none, m.rotor_wrench, m.effect_wrench, a);
    angular_acceleration(m.body, R, w, none, m.rotor_wrench, m.effect_wrench, alpha);
    a[2] += m.body.gravity;
    for (int i = 0; i < 3; i++) {
      out[k][i] = mass * a[i];
      out[k][3 + i] = row_times(J[i], alpha[0], alpha[1], alpha[2]);
    }
  }
}

// Bring samples (n, 11), rotor speeds and pose, back to the truth in place; `seen` marks rows with
// a pose
inline void undo_log_sensing(Model<double> &m, int64_t n, const double *t, const bool *seen,
                             double (*samples)[11]) {
  if (m.sensing_count == 0) return;
  double *sample = numbers_of<double>(m.sample);
  m.sample.quaternion[0] = 1;
  for (int64_t k = 0; k < n; k++) {
    int given = seen[k] ? 11 : 4;
    std::copy_n(samples[k], given, sample);
    undo_sensing(m, seen[k] ? 7 : 4, k > 0 ? t[k] - t[k - 1] : 0.0);
    std::copy_n(sample, given, samples[k]);
  }
}

constexpr double LONGEST_ROTOR_STEP = 0.005;  // s, over which rotors are held
constexpr double STEP_TOLERANCE = 0.1;  // of a period: a step so little too long is still one step
// of the motion in one of those: one step alone, at its zero-order hold, adds 5 mm in a second
constexpr int MOTION_STEPS = 4;
constexpr int FLOWN = 13;        // numbers of a state: position, quaternion, velocity, rate
constexpr double TINY = 1e-300;  // no share of nothing
// s in the air, after which half of a constant moment is known. On 16 Crazyflie flights constant
// moments of 1 to 15 rad/s2 stand against others of some 20; 0.2 to 2 s predict alike
constexpr double TRIMMED = 1;

inline int rotor_steps(double length) {
  return std::max(1, int(std::ceil(length / LONGEST_ROTOR_STEP - STEP_TOLERANCE)));
}

// How a flight loop answers moments that nothing measures: angular accelerations for each unit of
// velocity, tilt and rate. The reaction stands in for those moments, too, and is no part of a plant
struct LoopReaction {
  double gain[3];         // of the model's angular acceleration
  double unmeasured;      // rad/s2, standard deviation of what nothing measures, about x or y
  double damping;         // 1/s, of roll and pitch, where nothing is measured
  double stiffness;       // 1/s2, to level, where all is measured
  double flapping;        // rad/s2/(m/s), measured as the rotors' torque is
  double never_answered;  // rad/s2/(m/s)
  double yaw_damping;     // 1/s
};
constexpr int REACTIONS = sizeof(LoopReaction) / sizeof(double);

// What a row measures of moments: a model's angular acceleration, and the moment of velocity about
// x and y for each unit of its coefficient
constexpr int MEASURED = 5;
inline void measured_turning(const Model<double> &m, const double *x, const double R[3][3],
                             double *out) {
  const double none[3] = {}, *v = x + VELOCITY;
  angular_acceleration(m.body, R, x + RATE, none, m.rotor_wrench, m.effect_wrench, out);
  out[3] = R[0][1] * v[0] + R[1][1] * v[1] + R[2][1] * v[2];
  out[4] = -(R[0][0] * v[0] + R[1][0] * v[1] + R[2][0] * v[2]);
}

// Put the torque of the loop's reaction into the model's effects; `shares` (2) of the moments about
// x and y are measured. What was measured on average so far, `usual`, turned nothing
inline void react(Model<double> &m, const LoopReaction &loop, const double *shares,
                  const double *usual, const double *x, const double R[3][3]) {
  const double *w = x + RATE, tilt[2] = {R[2][1], -R[2][0]};
  double seen[MEASURED], more[3], *across = seen + 3;
  measured_turning(m, x, R, seen);
  for (int i = 0; i < 2; i++) {
    double measured = loop.gain[i] * (seen[i] - usual[i]) +
                      loop.flapping * (across[i] - usual[3 + i]) - loop.stiffness * tilt[i];
    more[i] = shares[i] * measured + loop.never_answered * across[i] -
              (1 - shares[i]) * loop.damping * w[i] - seen[i];
  }
  more[2] = loop.gain[2] * (seen[2] - usual[2]) - loop.yaw_damping * w[2] - seen[2];
  for (int i = 0; i < 3; i++)
    m.effect_wrench[3 + i] += row_times(m.body.inertia[i], more[0], more[1], more[2]);
}

// The thrust that a flight shows along body axes, over the model's along z: Kalman filters of three
// constants with slow drift, on the velocity of the rows so far. One command's thrust differs from
// day to day, and markers lean against the rotors' axis
struct ShownThrust {
  static constexpr double PUSHES = 0.1;  // m2/s3, density of other accelerations
  static constexpr double DRIFT = 200;   // s, in which the variance grows by the prior's
  static constexpr double LEAN = 0.02;   // rad, standard deviation

  double prior[3], along[3] = {0, 0, 1}, variance[3];

  explicit ShownThrust(double spread) {
    for (int i = 0; i < 3; i++) {
      double size = spread > 0 ? i == 2 ? spread : LEAN : 0;
      prior[i] = variance[i] = size * size;
    }
  }

  // Take in a change of velocity without the other forces' part, body axes, and the model's
  // `thrust` over the mass, both over dt s
  void see(const double *change, double thrust, double dt) {
    for (int i = 0; i < 3; i++) {
      double &sure = variance[i];
      sure = std::min(prior[i], sure + prior[i] * dt / DRIFT);
      double gain = sure * thrust / (thrust * thrust * sure + PUSHES * dt + TINY);
      along[i] += gain * (change[i] - along[i] * thrust);
      sure *= 1 - gain * thrust;
    }
  }
};

// Move a state on by dt s; where `keeps_velocity`, no force acts
inline void fly(Model<double> &m, double *x, double dt, bool keeps_velocity,
                const LoopReaction *loop, const double *shares, const double *usual,
                const double *thrust) {
  double R[3][3], after[STATE], effects[6];
  matrix_of(x + QUATERNION, R);
  apply_effects(m, x, R);
  std::copy_n(m.effect_wrench, 6, effects);
  for (int i = 0; i < 3; i++)
    m.effect_wrench[i] +=
        (R[i][0] * thrust[0] + R[i][1] * thrust[1]) / thrust[2] * m.rotor_wrench[0];
  if (loop) react(m, *loop, shares, usual, x, R);
  move(m.body, x, R, m.rotor_wrench, m.effect_wrench, dt, after);
  std::copy_n(effects, 6, m.effect_wrench);
  for (int i = 0; keeps_velocity && i < 3; i++) {
    after[VELOCITY + i] = x[VELOCITY + i];
    after[i] = x[i] + x[VELOCITY + i] * dt;
  }
  std::copy_n(after, NIS, x);
}

// Drive a model's rotors over the periods after row k, each in `steps` steps of dt s; after each
// step call `moved` with the period's number
template <class Moved>
void drive_ahead(Model<double> &m, const LoggedRotors &rotors, const double *t, int64_t k,
                 double period, int64_t ahead, int steps, double thrust, Moved moved) {
  double between[4];
  int64_t row = k;
  for (int64_t i = 0; i < ahead; i++) {
    double time = t[k] + double(i + 1) * period;
    while (row < rotors.n - 2 && t[row + 1] < time) row++;
    double share = std::min((time - t[row]) / (t[row + 1] - t[row]), 1.0);
    for (int j = 0; j < 4; j++)
      between[j] = (1 - share) * rotors.speeds[row][j] + share * rotors.speeds[row + 1][j];
    double volts = (1 - share) * rotors.voltage[row] + share * rotors.voltage[row + 1];
    for (int j = 0; j < steps; j++) {
      drive(m, between, period / steps, volts);
      for (double &wrench : m.rotor_wrench) wrench *= thrust;
      moved(i);
      m.time += period / steps;
    }
  }
}

// Run a model along a flight, for the memory of rotors and effects; let a copy of it go at each
// start, a row, and write the copy's states path (starts, ahead, 13), a period apart. The shares of
// measured moments are of mean squares over the horizon, at the start's state. Their means and the
// thrust are as the rows `aloft` so far show, the thrust from a share's standard deviation `spread`
// on; 0: the model's
inline void predict_flight(Model<double> &along, const LoggedRotors &rotors, const double *t,
                           const double (*states)[FLOWN], const int64_t *starts, int64_t count,
                           double period, const bool *aloft, double spread, bool keeps_velocity,
                           const LoopReaction *loop, int64_t ahead, double (*path)[FLOWN]) {
  const int steps = rotor_steps(period);
  ShownThrust thrust(spread);
  double usual[MEASURED] = {}, seen = TRIMMED;
  int64_t at = 0;
  for (int64_t k = 0; k < rotors.n && at < count; k++) {
    double R[3][3];
    if (k > 0) {
      double length = t[k] - t[k - 1];
      int parts = rotor_steps(length);
      double lift = 0, dt = length / parts, change[3], shown[3], turning[MEASURED];
      for (int i = 0; i < 3; i++) change[i] = states[k][VELOCITY + i] - states[k - 1][VELOCITY + i];
      matrix_of(states[k - 1] + QUATERNION, R);
      for (int i = 0; i < parts; i++) {
        drive(along, rotors.speeds[k], dt, rotors.voltage[k]);
        apply_effects(along, states[k - 1], R);
        lift += along.rotor_wrench[0] / along.body.mass * dt;
        for (int i = 0; i < 3; i++) change[i] -= along.effect_wrench[i] / along.body.mass * dt;
        change[2] += along.body.gravity * dt;
        along.time += dt;
      }
      for (int i = 0; i < 3; i++)
        shown[i] = R[0][i] * change[0] + R[1][i] * change[1] + R[2][i] * change[2];
      if (aloft[k]) {
        thrust.see(shown, lift, length);
        measured_turning(along, states[k - 1], R, turning);
        seen += length;
        for (int i = 0; i < MEASURED; i++) usual[i] += (turning[i] - usual[i]) * length / seen;
      }
    }
    if (starts[at] != k) continue;
    double x[STATE] = {}, shares[2] = {};
    std::copy_n(states[k], FLOWN, x);
    if (loop) {
      Model<double> m = along;
      double squares[2] = {}, least = double(ahead * steps) * std::pow(loop->unmeasured, 2) + TINY;
      matrix_of(x + QUATERNION, R);
      drive_ahead(m, rotors, t, k, period, ahead, steps, thrust.along[2], [&](int64_t) {
        double turns[MEASURED];
        apply_effects(m, x, R);
        measured_turning(m, x, R, turns);
        for (int i = 0; i < MEASURED; i++) turns[i] -= usual[i];
        for (int i = 0; i < 2; i++)
          squares[i] += std::pow(turns[i] + loop->flapping * turns[3 + i], 2);
      });
      for (int i = 0; i < 2; i++) shares[i] = squares[i] / (squares[i] + least);
    }
    Model<double> m = along;
    drive_ahead(m, rotors, t, k, period, ahead, steps, thrust.along[2], [&](int64_t i) {
      for (int part = 0; part < MOTION_STEPS; part++)
        fly(m, x, period / steps / MOTION_STEPS, keeps_velocity, loop, shares, usual, thrust.along);
      std::copy_n(x, FLOWN, path[at * ahead + i]);
    });
    at++;
  }
}

// The scale of a filter's innovations, of translation and of rotation, is estimated as well, since
// noise is not as declared: the declared one counts as much as so many poses
constexpr double DECLARED = 20;
constexpr double TAIL = 4;  // degrees of freedom of Student's t, which a jump of a pose follows

// Write the state after the `last` call of each row, and the log-likelihood of the poses so far,
// where this is larger than of the filters before. `posed` marks calls with a pose
inline void choose_likeliest(int64_t n, const int64_t *last, const bool *posed,
                             const double *numbers, int64_t width, const double (*innovations)[12],
                             double (*states)[FLOWN], double *best) {
  double total = 0, seen = 0, scales[2] = {1, 1}, squares[2] = {};
  for (int64_t k = 0; k < n; k++) {
    const double *white = innovations[last[k]], *root_of_variance = white + 6;
    if (posed[last[k]]) {
      seen += 3;
      for (int part = 0; part < 2; part++) {
        double nis = 0, spread = 1.5 * std::log(scales[part]);
        for (int i = 3 * part; i < 3 * part + 3; i++) {
          nis += white[i] * white[i];
          spread += std::log(root_of_variance[i]);
        }
        double far = nis / (TAIL * scales[part]);
        total -= spread + 0.5 * (TAIL + 3) * std::log1p(far);
        squares[part] += nis * (TAIL + 3) / (TAIL * (1 + far));
        scales[part] = (3 * DECLARED + squares[part]) / (3 * DECLARED + seen);
      }
    }
    if (total > best[k]) {
      best[k] = total;
      std::copy_n(numbers + last[k] * width, FLOWN, states[k]);
    }
  }
}

}  // namespace windwrench
