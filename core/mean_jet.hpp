// The mean jet of a fan: a table of axial and radial speed over distance and radius, worked out in
// dynamics/mean_jet.py.
#pragma once
#include "numbers.hpp"

namespace windwrench {

constexpr double AIR_DENSITY = 1.2;  // kg/m3
// the table's distances and radii, m
constexpr double FIRST_X = 0.2, STEP_X = 0.05, STEP_R = 0.02;
constexpr int COUNT_X = 137, COUNT_R = 151;

// a table (COUNT_X, COUNT_R) at shares a and b beyond its row i and column j, whole numbers inside
template <class T> T between(const Single<T> *table, T i, T j, T a, T b) {
  T near, far, near_after, far_after;
  if constexpr (is_single<T>) {
    const T *at = table + COUNT_R * int(i) + int(j);
    near = at[0], far = at[1], near_after = at[COUNT_R], far_after = at[COUNT_R + 1];
  } else {
    for (int lane = 0; lane < lanes_of<T>; lane++) {
      const Single<T> *at = table + COUNT_R * int(i[lane]) + int(j[lane]);
      near[lane] = at[0], far[lane] = at[1];
      near_after[lane] = at[COUNT_R], far_after[lane] = at[COUNT_R + 1];
    }
  }
  T one = T{} + Single<T>(1);
  return (one - a) * ((one - b) * near + b * far) + a * ((one - b) * near_after + b * far_after);
}

}  // namespace windwrench
