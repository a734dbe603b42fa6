// Attitude gain: dynamics/effects/attitude_gain.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: g
template <class T, class C>
void attitude_gain(const C *c, const VehicleNumbers<C> &, Sample<T> &sample, T *) {
  using S = Single<T>;
  const T *q = sample.quaternion;
  // body z in the world; the tilt turns e_z into it about (-by, bx, 0)
  T bx = S(2) * (q[1] * q[3] + q[0] * q[2]), by = S(2) * (q[2] * q[3] - q[0] * q[1]);
  T bz = S(1) - S(2) * (q[1] * q[1] + q[2] * q[2]), across = root(bx * bx + by * by);
  T there = T{} + c[0], back = S(1) / (S(1) + there) - S(1);
  T gain = choose(sample.direction > T{}, there, back), angle = angle_of(across, bz);
  auto turns = (sample.has_quaternion > T{}) & (across > T{} + S(1e-12));
  T rx = choose(turns, -by / across * gain * angle, T{}),
    ry = choose(turns, bx / across * gain * angle, T{});
  turn_attitude(sample.quaternion, rx, ry, T{});
}

}  // namespace windwrench
