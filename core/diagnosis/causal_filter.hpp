// The causal filter of a flight, of fixed gains, and the derivative of its innovations by a
// coefficient: identification/diagnosis/causal_filter.py says what its numbers are.
//
// The state of each of six axes is a pose, its rate and a disturbance. Rolls and pitches, axes 3
// and 4, are about the world's x and y, turned with the heading.
#pragma once
#include <algorithm>
#include <vector>

#include "flights.hpp"

namespace windwrench {

constexpr int PARTNER[6] = {4, 3, 5, 1, 0, 2};  // the axis that an axis is filtered with

// Gains (6, 3, 2) of pose, rate and disturbance of each axis, for its own innovation and that of
// its partner, and the share (6) of a disturbance left after a period, s
struct SteadyGains {
  double period;
  const double (*gain)[3][2], *keep;
};

struct LevelAxes {
  double cosine = 1, sine = 0;

  explicit LevelAxes(const double *both) : cosine(both[0]), sine(both[1]) {}
  LevelAxes() = default;
  void follow(const double R[3][3]) {
    double size = std::hypot(R[0][0], R[1][0]);
    if (size > 0) cosine = R[0][0] / size, sine = R[1][0] / size;
  }
  // x and y in body axes of a vector about the world's axes, turned with the heading; and back
  void to_body(double x, double y, double &out_x, double &out_y) const {
    out_x = cosine * x + sine * y, out_y = cosine * y - sine * x;
  }
  void to_level(double x, double y, double &out_x, double &out_y) const {
    out_x = cosine * x - sine * y, out_y = cosine * y + sine * x;
  }
};

// What a filter makes of a flight; row k is half a step on from sample k, predictions are of it
struct Track {
  double (*position)[3], (*rotation)[3][3], (*velocity)[3], (*rate)[3], (*acceleration)[6];
  double (*rotors)[4], (*model)[6], (*predicted)[7], (*heading)[2], (*innovations)[6];
  double (*disturbance)[6];
};

// q turned by a rotation vector in the body frame
inline void turn_by(const double *q, const double *vector, double *out) {
  turn_body(q, vector, 1.0, out);
  normalise(out);
}

class CausalFilter {
 public:
  CausalFilter(const SteadyGains &steady, const double *position, const double *quaternion,
               const double *begun)
      : steady_(steady) {
    std::copy_n(position, 3, moving_[0]);
    std::copy_n(quaternion, 4, q_);
    std::copy_n(begun, 3, moving_[1]);
    std::copy_n(begun + 3, 3, turning_[0]);
    matrix_of(q_, R_);
  }

  // Go from sample k to the next. known (6, 3): corrections before the pose is read
  void step(Model<double> &m, const LoggedRotors &rotors, int64_t k, const double *position,
            const double *quaternion, const double known[6][3], const Track &out) {
    const double half = 0.5 * steady_.period;
    double turn[3], q[4], e[6], said[6][3];
    heading_.follow(R_);
    out.heading[k][0] = heading_.cosine, out.heading[k][1] = heading_.sine;
    add(known, turn);
    turn_by(q_, turn, q);
    std::copy_n(moving_[0], 3, out.predicted[k]);
    std::copy_n(q, 4, out.predicted[k] + 3);
    innovation(q, position, quaternion, e);
    std::copy_n(e, 6, out.innovations[k]);
    for (int i = 0; i < 6; i++)
      for (int s = 0; s < 3; s++)
        said[i][s] = steady_.gain[i][s][0] * e[i] + steady_.gain[i][s][1] * e[PARTNER[i]];
    add(said, turn);
    double corrected[4];
    turn_by(q, turn, corrected);
    // half a step on, for the model; the acceleration is the last step's
    double x[STATE] = {}, *w = turning_[0], *torque = turning_[1], both[4];
    for (int i = 0; i < 3; i++) {
      x[i] = moving_[0][i] + half * moving_[1][i];
      x[VELOCITY + i] = moving_[1][i] + half * before_[i];
      x[RATE + i] = w[i] + half * before_[3 + i];
      turn[i] = half * w[i];
    }
    turn_by(corrected, turn, x + QUATERNION);
    matrix_of(x + QUATERNION, R_);
    const double *now = rotors.speeds[k], *next = rotors.speeds[std::min(k + 1, rotors.n - 1)];
    for (int i = 0; i < 4; i++) both[i] = 0.5 * (now[i] + next[i]);
    drive(m, both, steady_.period, rotors.voltage[k]);
    apply_effects(m, x, R_);
    m.time += steady_.period;
    accelerate(m, out.model[k], out.rate[k]);
    for (int i = 0; i < 3; i++) {
      out.disturbance[k][i] = moving_[2][i], out.disturbance[k][3 + i] = torque[i];
      before_[i] = out.model[k][i] + moving_[2][i];
      before_[3 + i] = out.model[k][3 + i] + torque[i];
    }
    std::copy_n(before_, 6, out.acceleration[k]);
    std::copy_n(x, 3, out.position[k]);
    std::copy_n(x + VELOCITY, 3, out.velocity[k]);
    std::copy_n(R_[0], 9, out.rotation[k][0]);
    std::copy_n(m.rotor_wrench, 4, out.rotors[k]);
    carry(corrected);
  }

 private:
  const SteadyGains steady_;
  double moving_[3][3] = {};   // position m, velocity m/s, disturbance m/s2, world
  double turning_[2][3] = {};  // rate rad/s, disturbance rad/s2, body
  double q_[4], R_[3][3], before_[6] = {};
  LevelAxes heading_;

  // Add corrections of pose, rate and disturbance; the attitude's is a turn, body
  void add(const double said[6][3], double *turn) {
    for (int s = 0; s < 3; s++) {
      double x, y;
      for (int i = 0; i < 3; i++) moving_[s][i] += said[i][s];
      heading_.to_body(said[3][s], said[4][s], x, y);
      if (s == 0) {
        turn[0] = x, turn[1] = y, turn[2] = said[5][s];
      } else {
        turning_[s - 1][0] += x, turning_[s - 1][1] += y, turning_[s - 1][2] += said[5][s];
      }
    }
  }

  void innovation(const double *o, const double *position, const double *m, double *e) const {
    double sign = o[0] * m[0] + o[1] * m[1] + o[2] * m[2] + o[3] * m[3] > 0 ? 1 : -1;
    double x = sign * (o[0] * m[1] - o[1] * m[0] - o[2] * m[3] + o[3] * m[2]);
    double y = sign * (o[0] * m[2] + o[1] * m[3] - o[2] * m[0] - o[3] * m[1]);
    double z = sign * (o[0] * m[3] - o[1] * m[2] + o[2] * m[1] - o[3] * m[0]);
    heading_.to_level(x, y, e[3], e[4]);
    e[3] = 2 * e[3], e[4] = 2 * e[4], e[5] = 2 * z;
    for (int i = 0; i < 3; i++) e[i] = position[i] - moving_[0][i];
  }

  // The model's accelerations; its gyroscopic torque is by the rate half a step on, with this
  // step's own acceleration
  void accelerate(const Model<double> &m, double *out, double *rate) const {
    const double none[3] = {}, *torque = turning_[1];
    double spin[3];
    auto spins = [&](const double *w) {
      angular_acceleration(m.body, R_, w, none, m.rotor_wrench, m.effect_wrench, out + 3);
      for (int i = 0; i < 3; i++) spin[i] = out[3 + i] + torque[i];
    };
    spins(turning_[0]);
    for (int i = 0; i < 3; i++) rate[i] = turning_[0][i] + 0.5 * steady_.period * spin[i];
    spins(rate);
    centre_acceleration(m.body, R_, rate, spin, none, m.rotor_wrench, m.effect_wrench, out);
  }

  // On to the next sample from the corrected attitude
  void carry(const double *corrected) {
    const double period = steady_.period, half = 0.5 * period, *keep = steady_.keep;
    double turn[3], *w = turning_[0], *torque = turning_[1], x, y;
    for (int i = 0; i < 3; i++) {
      moving_[0][i] += period * (moving_[1][i] + half * before_[i]);
      moving_[1][i] += period * before_[i];
      turn[i] = period * (w[i] + half * before_[3 + i]);
      w[i] += period * before_[3 + i];
      moving_[2][i] *= keep[i];
    }
    heading_.to_level(torque[0], torque[1], x, y);
    heading_.to_body(keep[3] * x, keep[4] * y, torque[0], torque[1]);
    torque[2] *= keep[5];
    turn_by(corrected, turn, q_);
  }
};

// What sensitivities are asked of, c = acting + jumping + sloping columns. Row k of the flight:
// heading; pull (3, 2), the derivative of the acceleration (world) by an error of the attitude
// about body x and y; rate; gyration (3, 3), of the angular acceleration by the rate; acting (6,
// acting), the model's acceleration by a unit of the first columns; moved (6, moving), the shift of
// the measured pose by a unit of the last of these; jumps (6, jumping) of the state `jump_state` of
// each axis by a unit of the next columns, before the pose is read. slopes (6, 7, sloping): change
// of gains and `keep` of each axis by a unit of the last columns. Innovations and disturbances are
// the filter's
struct SensitivityInput {
  int64_t n;
  int acting_count, moving, jumping, sloping;
  const double (*heading)[2], (*pull)[3][2], (*rate)[3], (*gyration)[3][3];
  const double *acting, *moved, *jumps;
  const int64_t *jump_state;
  const double *slopes, (*innovations)[6], (*disturbance)[6];
};

// Change of the innovations' predictions out (n, 6, c) with a unit of each column; state (6, 3, c)
// is carried from one call to the next
inline void sensitivities(const SteadyGains &steady, const SensitivityInput &in, double *state,
                          double *out) {
  const int a = in.acting_count, b = in.moving, e = in.jumping, m = in.sloping, c = a + e + m,
            f = a + e;
  const double period = steady.period, half = 0.5 * period * period, *keep = steady.keep;
  std::vector<double> memory(std::size_t(24 * c));
  double *mid = memory.data(), *turned = mid + 3 * c, *said = turned + 3 * c;
  auto of = [&](int i, int s) { return state + (3 * i + s) * c; };  // the columns of a state
  constexpr int STRAIGHT[4] = {0, 1, 2, 5};                         // not turned by the heading
  for (int64_t k = 0; k < in.n; k++) {
    const LevelAxes heading(in.heading[k]);
    double *seen = out + 6 * c * k, x, y;
    const double *jumps = in.jumps + 6 * e * k, *moved = in.moved + 6 * b * k,
                 *acting = in.acting + 6 * a * k;
    for (int j = 0; j < e; j++) {
      int s = int(in.jump_state[j]);
      for (int i : STRAIGHT) of(i, s)[a + j] += jumps[e * i + j];
      heading.to_body(jumps[3 * e + j], jumps[4 * e + j], x, y);
      of(3, s)[a + j] += x;
      of(4, s)[a + j] += y;
    }
    for (int i = 0; i < 6; i++) {
      std::copy_n(of(i, 0), c, seen + c * i);
      for (int j = 0; j < b; j++) seen[c * i + a - b + j] -= moved[b * i + j];
    }
    for (int j = 0; j < c; j++) {
      heading.to_level(seen[3 * c + j], seen[4 * c + j], x, y);
      seen[3 * c + j] = x, seen[4 * c + j] = y;
    }
    for (int i = 0; i < 6; i++) {
      const double *own = seen + c * i, *other = seen + c * PARTNER[i];
      x = in.innovations[k][i], y = in.innovations[k][PARTNER[i]];
      for (int s = 0; s < 3; s++) {
        double *to = said + (3 * i + s) * c;
        const double *gain = steady.gain[i][s], *slope = in.slopes + (7 * i + 2 * s) * m;
        for (int j = 0; j < c; j++) to[j] = -gain[0] * own[j] - gain[1] * other[j];
        for (int j = 0; j < m; j++) to[f + j] += slope[j] * x + slope[m + j] * y;
      }
    }
    for (int s = 0; s < 3; s++) {
      for (int i : STRAIGHT)
        for (int j = 0; j < c; j++) of(i, s)[j] += said[(3 * i + s) * c + j];
      const double *roll = said + (9 + s) * c, *pitch = said + (12 + s) * c;
      double *about_x = of(3, s), *about_y = of(4, s);
      for (int j = 0; j < c; j++) {
        double to_x, to_y;
        heading.to_body(roll[j], pitch[j], to_x, to_y);
        about_x[j] += to_x;
        about_y[j] += to_y;
      }
    }
    for (int i = 0; i < 3; i++) {
      const double *pose = of(3 + i, 0), *rate = of(3 + i, 1);
      for (int j = 0; j < c; j++) mid[c * i + j] = pose[j] + 0.5 * period * rate[j];
    }
    for (int i = 0; i < 3; i++) {
      double px = in.pull[k][i][0], py = in.pull[k][i][1], *pose = of(i, 0), *rate = of(i, 1);
      const double *disturbance = of(i, 2);
      for (int j = 0; j < c; j++) {
        double g = disturbance[j] + px * mid[j] + py * mid[c + j];
        if (j < a) g += acting[a * i + j];
        pose[j] += period * rate[j] + half * g;
        rate[j] += period * g;
      }
    }
    for (int i = 0; i < 3; i++) {
      const double *by = in.gyration[k][i], *g = of(3 + i, 2);
      const double *wx = of(3, 1), *wy = of(4, 1), *wz = of(5, 1);
      for (int j = 0; j < c; j++)
        turned[c * i + j] = g[j] + by[0] * wx[j] + by[1] * wy[j] + by[2] * wz[j];
    }
    for (int i = 0; i < 3; i++) {
      int u = (i + 1) % 3, v = (i + 2) % 3;
      double wu = in.rate[k][u], wv = in.rate[k][v], *pose = of(3 + i, 0), *rate = of(3 + i, 1);
      for (int j = 0; j < c; j++) {
        double g = turned[c * i + j];
        if (j < a) g += acting[a * (3 + i) + j];
        // an error in body axes turns back as these turn on
        pose[j] +=
            period * rate[j] + half * g - period * (wu * mid[c * v + j] - wv * mid[c * u + j]);
        rate[j] += period * g;
      }
    }
    double *roll = of(3, 2), *pitch = of(4, 2);
    for (int j = 0; j < c; j++) {
      heading.to_level(roll[j], pitch[j], x, y);
      roll[j] = keep[3] * x, pitch[j] = keep[4] * y;
    }
    for (int j = 0; j < m; j++) {
      roll[f + j] += in.slopes[(7 * 3 + 6) * m + j] * in.disturbance[k][3];
      pitch[f + j] += in.slopes[(7 * 4 + 6) * m + j] * in.disturbance[k][4];
    }
    for (int j = 0; j < c; j++) {
      heading.to_body(roll[j], pitch[j], x, y);
      roll[j] = x, pitch[j] = y;
    }
    for (int i : STRAIGHT) {
      double *disturbance = of(i, 2);
      for (int j = 0; j < c; j++) disturbance[j] *= keep[i];
      for (int j = 0; j < m; j++)
        disturbance[f + j] += in.slopes[(7 * i + 6) * m + j] * in.disturbance[k][i];
    }
  }
}

}  // namespace windwrench
