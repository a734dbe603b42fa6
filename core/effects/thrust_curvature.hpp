// Thrust curvature: thrust does not grow exactly with the square of the rotor speed.
//
// Thrust and reaction torque are those declared times 1 + a (W^2 / W_hover^2 - 1), no less than
// zero, so that nothing changes at the rotor speed of hover. The delivered rotor speed is W times
// the root of that.
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
