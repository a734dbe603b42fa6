// Thrust fade: dynamics/effects/thrust_fade.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: rate 1/s
template <class T, class C>
void thrust_fade(const C *c, const VehicleNumbers<C> &, Rotors<T> &rotors, T *) {
  using S = Single<T>;
  T scale = root(larger(S(1) - c[0] * rotors.time, T{} + S(0.1)));
  for (int i = 0; i < 4; i++) rotors.speed[i] *= scale;
}

}  // namespace windwrench
