// The inner loop of the trackers: how likely an estimate is, were the fan where a particle says.
#pragma once
#include "numbers.hpp"

namespace windwrench {

// over the offset from the fan's axis, m; axes: torque z Nm, force x and y N
constexpr double MAP_FIRST = -3.0, MAP_STEP = 0.02;
constexpr int MAP_COUNT = 301, AXES = 3, ORDER = 3;  // ORDER: of the autoregression

// What a tracker knows of its own sensing: tables (controllers/sensor_model.py)
template <class S> struct SensorModel {
  // over the offset: mean, slopes with velocity and yaw rate, standard deviation
  const S (*tables)[4][AXES];
  const S (*keep)[3][3];  // of the filter's error; and what of a change enters it
  const S (*enter)[3];
  // of the residual, in standard deviations, on those before: of the first decisions, and of all
  // others; and what they leave
  const S (*regression)[AXES][ORDER];
  const S (*variance)[AXES];
};

// A particle's memory: the jet's mean that it felt last, the filter's error, residuals, newest
// first
template <class S> struct ParticleMemory {
  S felt[AXES], error[AXES][3], past[AXES][ORDER];
};

// The vehicle's own motion along y, m and m/s, and its yaw rate, rad/s
template <class S> struct OwnMotion {
  S place, velocity, yaw_rate;
};

// Log-likelihood of the estimated torque and forces (3) for a fan at a place along y, m, and a
// level of the noise, 1: as expected. Carries the memory on. decision: of the episode; at the
// first, 0, the filter has settled on the jet where it is
template <class S>
S weigh(const SensorModel<S> &model, S place, S level, const OwnMotion<S> &own, const S *seen,
        int64_t decision, ParticleMemory<S> &m) {
  int order = decision < ORDER ? int(decision) : ORDER;
  S column = (own.place - place - S(MAP_FIRST)) / S(MAP_STEP);
  column = within(column, S(0), S(MAP_COUNT - 1.001));
  int j = int(column);
  S b = column - S(j), total = S(0);
  const auto &left = model.tables[j], &right = model.tables[j + 1];
  for (int a = 0; a < AXES; a++) {
    S at[4], *e = m.error[a], *past = m.past[a];
    for (int k = 0; k < 4; k++) at[k] = (S(1) - b) * left[k][a] + b * right[k][a];
    S mean = at[0] + own.velocity * at[1], turning = own.yaw_rate * at[2];
    S deviation = level * at[3], change = mean - m.felt[a], e0 = e[0], e1 = e[1], e2 = e[2];
    for (int k = 0; k < 3; k++) {
      const S *keep = model.keep[a][k];
      S error = keep[0] * e0 + keep[1] * e1 + keep[2] * e2 + model.enter[a][k] * change;
      e[k] = decision == 0 ? S(0) : error;
    }
    m.felt[a] = mean;
    S residual = (seen[a] - turning - mean + e[2]) / deviation, innovation = residual;
    for (int k = 0; k < ORDER; k++) innovation -= model.regression[order][a][k] * past[k];
    for (int k = ORDER - 1; k > 0; k--) past[k] = past[k - 1];
    past[0] = residual;
    S square = S(0.5) * innovation * innovation;
    total -= square / model.variance[order][a] + std::log(deviation);
  }
  return total;
}

}  // namespace windwrench
