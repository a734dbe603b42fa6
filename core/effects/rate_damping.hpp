// Rate damping: dynamics/effects/rate_damping.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: dx, dy, dz Nm/(rad/s)
template <class T, class C>
void rate_damping(const C *c, const VehicleNumbers<C> &, const FlightState<T> &s, Wrench<T> &w) {
  for (int i = 0; i < 3; i++) w.torque[i] -= c[i] * s.rate[i];
}

}  // namespace windwrench
