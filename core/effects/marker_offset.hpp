// Marker offset: dynamics/effects/marker_offset.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: mx, my, mz m
template <class T, class C>
void marker_offset(const C *c, const VehicleNumbers<C> &, Sample<T> &sample, T *) {
  using S = Single<T>;
  const T *q = sample.quaternion;
  for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    // m + 2 w (v x m) + 2 v x (v x m)
    T across = q[1 + j] * c[k] - q[1 + k] * c[j];
    T along_j = q[1 + k] * c[i] - q[1 + i] * c[k], along_k = q[1 + i] * c[j] - q[1 + j] * c[i];
    T moved = sample.direction *
              (c[i] + S(2) * (q[0] * across + q[1 + j] * along_k - q[1 + k] * along_j));
    sample.position[i] += choose(sample.has_position > T{}, moved, T{});
  }
}

}  // namespace windwrench
