// Constant torque: dynamics/effects/constant_torque.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: tx, ty, tz Nm
template <class T, class C>
void constant_torque(const C *c, const VehicleNumbers<C> &, const FlightState<T> &, Wrench<T> &w) {
  for (int i = 0; i < 3; i++) w.torque[i] += c[i];
}

}  // namespace windwrench
