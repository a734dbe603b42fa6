// Thrust fade: thrust at a given rotor speed falls steadily with flight time, as motors and battery
// warm up.
//
// Thrust and reaction torque scale by 1 - rate * t, no less than a tenth: the delivered rotor speed
// is W times the root of that. The time t runs from the start of the flight; in an estimator from
// its reset.
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
