// Constant force: dynamics/effects/constant_force.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: fx, fy, fz N
template <class T, class C>
void constant_force(const C *c, const VehicleNumbers<C> &, const FlightState<T> &, Wrench<T> &w) {
  for (int i = 0; i < 3; i++) w.force[i] += c[i];
}

}  // namespace windwrench
