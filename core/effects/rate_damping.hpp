// Rate damping: a torque against the body rate, tau = -diag(dx, dy, dz) omega in body axes.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: dx, dy, dz Nm/(rad/s)
template <class T, class C>
void rate_damping(const C *c, const VehicleNumbers<C> &, const FlightState<T> &s, Wrench<T> &w) {
  for (int i = 0; i < 3; i++) w.torque[i] -= c[i] * s.rate[i];
}

}  // namespace windwrench
