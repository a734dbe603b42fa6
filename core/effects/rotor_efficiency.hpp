// Rotor efficiency: dynamics/effects/rotor_efficiency.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: e1, e2, e3, e4
template <class T, class C>
void rotor_efficiency(const C *c, const VehicleNumbers<C> &, Rotors<T> &rotors, T *) {
  for (int i = 0; i < 4; i++) rotors.speed[i] *= root(larger(Single<C>(1) + c[i], C{}));
}

}  // namespace windwrench
