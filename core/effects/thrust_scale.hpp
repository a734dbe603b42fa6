// Thrust scale: dynamics/effects/thrust_scale.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: s
template <class T, class C>
void thrust_scale(const C *c, const VehicleNumbers<C> &, Rotors<T> &rotors, T *) {
  C scale = root(larger(Single<C>(1) + c[0], C{}));
  for (int i = 0; i < 4; i++) rotors.speed[i] *= scale;
}

}  // namespace windwrench
