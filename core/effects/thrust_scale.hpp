// Thrust scale: all rotors deliver more or less than declared at the same rotor speed.
//
// Thrust and reaction torque scale by 1 + s: the delivered rotor speed is W sqrt(1 + s).
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
