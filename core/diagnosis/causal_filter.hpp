// The causal filter of a flight, of fixed gains, and the derivative of its innovations by a
// coefficient: identification/diagnosis/causal_filter.py says what its numbers are.
//
// The state of each of six axes is a pose, its rate and a disturbance. Rolls and pitches, axes 3
// and 4, are about the world's x and y, turned with the heading.
#pragma once
#include <algorithm>
#include <cstring>
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
  template <class T> void to_body(T x, T y, T &out_x, T &out_y) const {
    out_x = cosine * x + sine * y, out_y = cosine * y - sine * x;
  }
  template <class T> void to_level(T x, T y, T &out_x, T &out_y) const {
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

// A column of accelerations, or of shifts of a pose: scale x y at each row, in `width` channels
// from `first` on, and zero in the others; arrays with their strides
struct ProductColumn {
  double scale;
  const double *x, *y;
  int64_t x_step, y_step, y_across;
  int width, first;

  // write rows `begin` to `end` into one lane
  template <class T> void put(int64_t begin, int64_t end, T (*out)[6], int lane) const {
    double *to = reinterpret_cast<double *>(out[0] + first) + lane;
    if (width == 6) put_some<6>(begin, end, to, 6 * lanes_of<T>);
    else if (width == 3) put_some<3>(begin, end, to, 6 * lanes_of<T>);
    else
      for (int i = 0; i < width; i++)
        ProductColumn{scale, x, y + i * y_across, x_step, y_step, 0, 1, 0}.put_some<1>(
            begin, end, to + i * lanes_of<T>, 6 * lanes_of<T>);
  }

 private:
  template <int WIDTH> void put_some(int64_t begin, int64_t end, double *to, int step) const {
    const int across = step / 6;
    for (int64_t k = begin; k < end; k++, to += step) {
      const double by = scale * x[k * x_step], *row = y + k * y_step;
      for (int i = 0; i < WIDTH; i++) to[i * across] = by * row[i * y_across];
    }
  }
};

// What sensitivities are asked of, c = acting + jumping + sloping columns. Row k of the flight:
// heading; rotation; rotors, the accelerations by their thrust and torques; rate. twist (3, 3, 3):
// derivative of the angular acceleration by the rate, for a rate of one about each axis. Of the
// first columns, acting: the model's acceleration by a unit; of the last of these, moved: the shift
// of the measured pose. jumps (6, 3) by each of three causes; the next columns have shares
// (6, 3, jumping) of them, of the state `jump_state` of each axis, before the pose is read. slopes
// (6, 7, sloping): change of gains and `keep` of each axis by a unit of the last columns.
// Innovations and disturbances are the filter's; whiten (6, 6) is the inverse of the root of their
// covariance: no axis is linked but with its partner. Rows of the answer are counted ones alone
struct SensitivityInput {
  int64_t n;
  int jumping, sloping;
  const double (*heading)[2], (*rotation)[3][3], (*rotors)[4], (*rate)[3], (*twist)[3][3];
  std::vector<ProductColumn> acting, moved;
  const double (*jumps)[6][3], *shares;
  const int64_t *jump_state;
  const double *slopes, (*innovations)[6], (*disturbance)[6], (*whiten)[6];
  const bool *counted;

  int columns() const { return int(acting.size()) + jumping + sloping; }
};

// What a row says to all columns: the derivatives of the acceleration (world) by an error of the
// attitude about body x and y, and of the angular acceleration by the rate; the disturbance
struct SensitivityRow {
  double pull[3][2], gyration[3][3], disturbance[6];

  SensitivityRow(const SensitivityInput &in, int64_t k) {
    const double thrust = in.rotors[k][0], *w = in.rate[k], *d = in.disturbance[k];
    for (int i = 0; i < 3; i++) {
      pull[i][0] = -thrust * in.rotation[k][i][1], pull[i][1] = thrust * in.rotation[k][i][0];
      for (int j = 0; j < 3; j++)
        gyration[i][j] =
            w[0] * in.twist[0][i][j] + w[1] * in.twist[1][i][j] + w[2] * in.twist[2][i][j];
    }
    std::copy_n(d, 6, disturbance);
    LevelAxes(in.heading[k]).to_level(d[3], d[4], disturbance[3], disturbance[4]);
  }
};

// Some columns side by side: columns are independent, so their state stays in registers
class SideBySide {
 public:
  static constexpr int LANES = 8, TILE = 32;  // columns, and rows that are read at once
  using T = Lanes<double, LANES>;

  SideBySide(const SteadyGains &steady, const SensitivityInput &in, int first)
      : steady_(steady), in_(in), first_(first), c_(in.columns()) {
    const int acting = int(in.acting.size()), moved = acting - int(in.moved.size());
    for (int j = 0; j < LANES; j++) {
      const int at = first + j, jump = at - acting, slope = jump - in.jumping;
      acts_ |= at < acting, moves_ |= at < acting && at >= moved;
      if (jump >= 0 && jump < in.jumping) {
        jumps_ = true;
        state_[in.jump_state[jump]][j] = 1;
        for (int i = 0; i < 18; i++) share_[i / 3][i % 3][j] = in.shares[i * in.jumping + jump];
      } else if (slope >= 0 && slope < in.sloping) {
        slopes_ = true;
        for (int i = 0; i < 42; i++) slope_[i / 7][i % 7][j] = in.slopes[i * in.sloping + slope];
      }
    }
  }

  // Write these columns of the counted rows out (m, 6, c + 1), and carry their state (6, 3, c)
  void run(const SensitivityRow *rows, double *state, double *out) {
    const int last = std::min(LANES, c_ - first_);
    for (int i = 0; i < 18; i++)
      for (int j = 0; j < last; j++) x_[i / 3][i % 3][j] = state[i * c_ + first_ + j];
    out += first_;
    for (int64_t begin = 0; begin < in_.n; begin += TILE) {
      const int64_t end = std::min(in_.n, begin + TILE);
      if (acts_) read(in_.acting, first_, begin, end, acting_);
      if (moves_)
        read(in_.moved, first_ - int(in_.acting.size() - in_.moved.size()), begin, end, moved_);
      for (int64_t k = begin; k < end; k++) {
        step(k, rows[k], acting_[k - begin], moved_[k - begin], out);
        if (in_.counted[k]) out += 6 * (c_ + 1);
      }
    }
    for (int i = 0; i < 18; i++)
      for (int j = 0; j < last; j++) state[i * c_ + first_ + j] = x_[i / 3][i % 3][j];
  }

 private:
  const SteadyGains steady_;
  const SensitivityInput &in_;
  const int first_, c_;
  bool acts_ = false, moves_ = false, jumps_ = false, slopes_ = false;
  T slope_[6][7] = {}, share_[6][3] = {}, state_[3] = {}, x_[6][3] = {};
  T acting_[TILE][6] = {}, moved_[TILE][6] = {};

  static void read(const std::vector<ProductColumn> &from, int first, int64_t begin, int64_t end,
                   T (*out)[6]) {
    for (int j = std::max(0, -first); j < LANES && first + j < int(from.size()); j++)
      from[first + j].put(begin, end, out, j);
  }

  void jump(const double by[6][3], const LevelAxes &heading) {
    T now[6];
    for (int i = 0; i < 6; i++)
      now[i] = share_[i][0] * by[i][0] + share_[i][1] * by[i][1] + share_[i][2] * by[i][2];
    heading.to_body(now[3], now[4], now[3], now[4]);
    for (int i = 0; i < 6; i++)
      for (int s = 0; s < 3; s++) x_[i][s] += state_[s] * now[i];
  }

  void store(const T *seen, double *out) const {
    for (int i = 0; i < 6; i++) {
      T white = in_.whiten[i][i] * seen[i];
      if (PARTNER[i] < i) white += in_.whiten[i][PARTNER[i]] * seen[PARTNER[i]];
      double *row = out + (c_ + 1) * i;
      if (first_ + LANES <= c_) std::memcpy(row, &white, sizeof(white));
      else
        for (int j = 0; first_ + j < c_; j++) row[j] = white[j];
    }
  }

  void step(int64_t k, const SensitivityRow &at, const T *acting, const T *moved, double *out) {
    const double period = steady_.period, half = 0.5 * period * period, *keep = steady_.keep;
    const LevelAxes heading(in_.heading[k]);
    T seen[6], said[6][3], mid[3], turned[3], x, y;
    if (jumps_) jump(in_.jumps[k], heading);
    for (int i = 0; i < 6; i++) {
      seen[i] = x_[i][0];
      if (moves_) seen[i] -= moved[i];
    }
    heading.to_level(seen[3], seen[4], seen[3], seen[4]);
    if (in_.counted[k]) store(seen, out);
    for (int i = 0; i < 6; i++) {
      const int other = PARTNER[i];
      const double own = in_.innovations[k][i], partner = in_.innovations[k][other];
      for (int s = 0; s < 3; s++) {
        const double *gain = steady_.gain[i][s];
        said[i][s] = -gain[0] * seen[i] - gain[1] * seen[other];
        if (slopes_) said[i][s] += slope_[i][2 * s] * own + slope_[i][2 * s + 1] * partner;
      }
    }
    for (int s = 0; s < 3; s++) {
      heading.to_body(said[3][s], said[4][s], said[3][s], said[4][s]);
      for (int i = 0; i < 6; i++) x_[i][s] += said[i][s];
    }
    for (int i = 0; i < 3; i++) mid[i] = x_[3 + i][0] + 0.5 * period * x_[3 + i][1];
    for (int i = 0; i < 3; i++) {
      T g = x_[i][2] + at.pull[i][0] * mid[0] + at.pull[i][1] * mid[1];
      if (acts_) g += acting[i];
      x_[i][0] += period * x_[i][1] + half * g;
      x_[i][1] += period * g;
    }
    for (int i = 0; i < 3; i++) {
      const double *by = at.gyration[i];
      turned[i] = x_[3 + i][2] + by[0] * x_[3][1] + by[1] * x_[4][1] + by[2] * x_[5][1];
      if (acts_) turned[i] += acting[3 + i];
    }
    for (int i = 0; i < 3; i++) {
      int u = (i + 1) % 3, v = (i + 2) % 3;
      double wu = in_.rate[k][u], wv = in_.rate[k][v];
      // an error in body axes turns back as these turn on
      x_[3 + i][0] +=
          period * x_[3 + i][1] + half * turned[i] - period * (wu * mid[v] - wv * mid[u]);
      x_[3 + i][1] += period * turned[i];
    }
    heading.to_level(x_[3][2], x_[4][2], x, y);
    x_[3][2] = x, x_[4][2] = y;
    for (int i = 0; i < 6; i++) {
      x_[i][2] *= keep[i];
      if (slopes_) x_[i][2] += slope_[i][6] * at.disturbance[i];
    }
    heading.to_body(x_[3][2], x_[4][2], x_[3][2], x_[4][2]);
  }
};

// Whitened change of the innovations' predictions out (m, 6, c + 1) with a unit of each column, and
// the innovations last, in the m counted rows; state (6, 3, c) is carried from one call to the next
inline void sensitivities(const SteadyGains &steady, const SensitivityInput &in, double *state,
                          double *out) {
  const int c = in.columns();
  std::vector<SensitivityRow> rows;
  rows.reserve(in.n);
  for (int64_t k = 0; k < in.n; k++) rows.emplace_back(in, k);
  for (int first = 0; first < c; first += SideBySide::LANES)
    SideBySide(steady, in, first).run(rows.data(), state, out);
  for (int64_t k = 0; k < in.n; k++)
    for (int i = 0; i < 6 && in.counted[k]; i++, out += c + 1) {
      const double *e = in.innovations[k];
      out[c] = in.whiten[i][i] * e[i];
      if (PARTNER[i] < i) out[c] += in.whiten[i][PARTNER[i]] * e[PARTNER[i]];
    }
}

}  // namespace windwrench
