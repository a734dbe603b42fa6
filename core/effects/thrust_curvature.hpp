// Thrust curvature: dynamics/effects/thrust_curvature.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: a
template <class T, class C>
void thrust_curvature(const C *c, const VehicleNumbers<C> &v, Rotors<T> &rotors, T *) {
  using S = Single<T>;
  for (int i = 0; i < 4; i++) {
    T ratio = rotors.speed[i] / v.hover_rate;
    rotors.speed[i] *= root(larger(S(1) + c[0] * (ratio * ratio - S(1)), T{}));
  }
}

}  // namespace windwrench
