// Rotor efficiency: single rotors deliver more or less than declared at the same rotor speed.
//
// Thrust and reaction torque of rotor i scale by 1 + e_i: the delivered rotor speed is W_i sqrt(1 +
// e_i).
#pragma once
#include "form.hpp"

namespace windwrench {

// c: e1, e2, e3, e4
template <class T, class C>
void rotor_efficiency(const C *c, const VehicleNumbers<C> &, Rotors<T> &rotors, T *) {
  for (int i = 0; i < 4; i++) rotors.speed[i] *= root(larger(Single<C>(1) + c[i], C{}));
}

}  // namespace windwrench
