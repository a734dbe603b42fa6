// World tilt: dynamics/effects/world_tilt.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: ax, ay rad
template <class T, class C>
void world_tilt(const C *c, const VehicleNumbers<C> &, Sample<T> &sample, T *) {
  using S = Single<T>;
  T ax = sample.direction * c[0], ay = sample.direction * c[1], angle = root(ax * ax + ay * ay);
  auto turns = (sample.has_position > T{}) & (angle > T{} + S(1e-12));
  T nx = ax / angle, ny = ay / angle, sin_angle = sine(angle), t = S(1) - cosine(angle);
  T *p = sample.position, x = p[0], y = p[1], z = p[2], along = nx * x + ny * y;
  p[0] = choose(turns, x + sin_angle * ny * z + t * (nx * along - x), x);
  p[1] = choose(turns, y - sin_angle * nx * z + t * (ny * along - y), y);
  p[2] = choose(turns, z + sin_angle * (nx * y - ny * x) - t * z, z);
  auto given = sample.has_quaternion > T{};
  turn_attitude(sample.quaternion, choose(given, ax, T{}), choose(given, ay, T{}), T{});
}

}  // namespace windwrench
