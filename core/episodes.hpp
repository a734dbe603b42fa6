// Episodes side by side: what agents command, and what is told of vehicles, a row an environment.
#pragma once
#include "effects/parts.hpp"
#include "tick.hpp"

namespace windwrench {

constexpr double FASTEST = 200.0;  // m/s and rad/s, beyond any vehicle
constexpr double UPRIGHT = 0.34;   // cosine of 70 degrees

// Arrays of n episodes (envs/state.py)
struct Episodes {
  std::int64_t count, actions;
  std::int64_t *ticks, *decisions;  // (n): since the start; ticks are below zero while it settles
  const double *paths, *heights;    // (n, path_rows), (n, height_rows) m, of the fan's axis
  std::int64_t path_rows, height_rows;
  const double *references;  // (n, reference_rows, REFERENCE)
  std::int64_t reference_rows;
  double *commands, *taken, *last_taken;  // (n, actions)
  bool *broken;                           // (n) whether the physics started over on its own
};

inline std::int64_t row_at(std::int64_t tick, std::int64_t rows) {
  return tick < 0 ? 0 : tick < rows ? tick : rows - 1;
}

// A vehicle's motion
struct Motion {
  double pose[7], velocity[6];  // m, quaternion; m/s, world, and rad/s, body
  double wrench[6];             // N and Nm, world, the true external one
  double state[STATE];          // as the filter estimates it
  double deviation[6];          // standard deviations of its torque and force
  double rest[9];  // m/s2: specific force and thrust as of `Loop`; m/s: wind, mean of the stations
};

// The motion of a loop in a lane
template <class T>
Motion motion_of(const Loop<T> &loop, const Belief<T> &belief, const T *qpos, const T *qvel,
                 int lane) {
  Motion m;
  auto copy = [lane](const T *from, int count, double *to) {
    for (int i = 0; i < count; i++) to[i] = double(number_of(from[i], lane));
  };
  copy(qpos, 7, m.pose);
  copy(qvel, 6, m.velocity);
  copy(loop.plant.external, 6, m.wrench);
  copy(belief.x, STATE, m.state);
  copy(loop.specific, 3, m.rest);
  copy(loop.thrust, 3, m.rest + 3);
  for (int i = 0; i < 6; i++)
    m.deviation[i] = std::sqrt(double(number_of(belief.P[12 + i][12 + i], lane)));
  for (int a = 0; a < 3; a++) {
    double wind = 0.0;
    for (int i = 0; i < STATIONS; i++) wind += double(number_of(loop.fan.air[i][a], lane));
    m.rest[6 + a] = wind / STATIONS;
  }
  return m;
}

// Whether a vehicle's estimate is finite and each velocity a vehicle's
inline bool is_healthy(const double *state, const double *velocity) {
  double sum = 0.0;
  for (int i = 0; i < NIS; i++) sum += state[i];
  bool healthy = finite(sum);
  for (int i = 0; i < 6; i++) healthy = healthy && absolute(velocity[i]) < FASTEST;
  return healthy;
}

// columns of a row, in the order of envs/state.py
enum {
  ROW_TRUE = 0,
  ROW_ESTIMATE = 19,
  ROW_DEVIATION = ROW_ESTIMATE + STATE,
  ROW_TURN = ROW_DEVIATION + 6,
  ROW_REST = ROW_TURN + 3,
  ROW_REFERENCE = ROW_REST + 9,
  ROW_FAN = ROW_REFERENCE + REFERENCE,
  ROW_DISTANCE = ROW_FAN + 4,
  ROW_TIME,
  ROW_CHANGE,
  ROW_SIZE
};

// Write the row of episode n; return whether its vehicle flies: upright and with finite numbers
inline bool write_row(const Motion &m, const Episodes &e, std::int64_t n, double *row) {
  std::memcpy(row, &m, sizeof(double) * ROW_TURN);
  std::memcpy(row + ROW_REST, m.rest, sizeof(m.rest));
  const double *reference =
      e.references + REFERENCE * (e.reference_rows * n + row_at(e.ticks[n], e.reference_rows));
  std::memcpy(row + ROW_REFERENCE, reference, sizeof(double) * REFERENCE);
  // twice the vector part of the quaternion from upright at the reference's yaw to the estimate
  const double *w = m.state + QUATERNION;
  double c = std::cos(0.5 * reference[9]), s = std::sin(0.5 * reference[9]);
  double turned = c * w[0] + s * w[3] >= 0.0 ? 2.0 : -2.0;
  row[ROW_TURN] = turned * (c * w[1] + s * w[2]);
  row[ROW_TURN + 1] = turned * (c * w[2] - s * w[1]);
  row[ROW_TURN + 2] = turned * (c * w[3] - s * w[0]);
  const double *paths[2] = {e.paths + e.path_rows * n, e.heights + e.height_rows * n};
  const std::int64_t rows[2] = {e.path_rows, e.height_rows};
  for (int i = 0; i < 2; i++) {
    std::int64_t k = row_at(e.ticks[n], rows[i]), before = k > 0 ? k - 1 : 0;
    row[ROW_FAN + i] = paths[i][before];
    row[ROW_FAN + 2 + i] = (paths[i][k] - paths[i][before]) / TICK;
  }
  double square = 0.0, change = 0.0;
  for (int i = 0; i < 3; i++) square += (m.pose[i] - reference[i]) * (m.pose[i] - reference[i]);
  for (std::int64_t i = e.actions * n; i < e.actions * (n + 1); i++) {
    double more = e.taken[i] - e.last_taken[i];
    change += more * more;
  }
  row[ROW_DISTANCE] = std::sqrt(square);
  row[ROW_TIME] = double(e.ticks[n]) * TICK;
  row[ROW_CHANGE] = change;
  // in this form a number that is not finite counts as lost
  bool upright = 1.0 - 2.0 * (m.pose[4] * m.pose[4] + m.pose[5] * m.pose[5]) >= UPRIGHT;
  return !e.broken[n] && upright && is_healthy(m.state, m.velocity);
}

// What an action's numbers (actions) from -1 to 1 command: `hover` at 0, `hover + below * a` below
// 0, `hover + above * a` above
struct Commanded {
  double scale;  // of the numbers that an agent gives
  const double *hover, *below, *above;
};

// Write the actions (n, actions) of the episodes `which` (n), within -1 to 1, and their commands.
// Returns whether all numbers are finite; nothing is written otherwise
inline bool take(const double *wanted, const bool *which, const Commanded &c, Episodes &e) {
  for (std::int64_t i = 0; i < e.count * e.actions; i++)
    if (!finite(wanted[i])) return false;
  for (std::int64_t n = 0; n < e.count; n++) {
    if (!which[n]) continue;
    e.decisions[n] += 1;
    for (std::int64_t i = 0; i < e.actions; i++) {
      std::int64_t at = e.actions * n + i;
      double action = smaller(larger(wanted[at] / c.scale, -1.0), 1.0);
      e.last_taken[at] = e.taken[at];
      e.taken[at] = action;
      e.commands[at] = c.hover[i] + (action < 0.0 ? c.below[i] : c.above[i]) * action;
    }
  }
  return true;
}

// A frame (count) within `limits` as it is into `si`, and over `scales` into `out`; 0 where a
// number is not finite
inline void limit(const double *seen, std::int64_t count, const float *limits, const float *scales,
                  float *si, float *out) {
  for (std::int64_t i = 0; i < count; i++) {
    float value = float(seen[i]);
    if (!finite(value)) value = 0.0f;
    si[i] = smaller(larger(value, -limits[i]), limits[i]);
    out[i] = si[i] / scales[i];
  }
}

}  // namespace windwrench
