// Rotor inertia: dynamics/effects/rotor_inertia.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: jr kg m2
template <class T, class C>
void rotor_inertia(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w) {
  T momentum = {};
  for (int i = 0; i < 4; i++) {
    momentum += c[0] * v.spin[i] * s.rotor_speed[i];
    w.torque[2] -= c[0] * v.spin[i] * s.rotor_acceleration[i];
  }
  w.torque[0] -= s.rate[1] * momentum;
  w.torque[1] += s.rate[0] * momentum;
}

}  // namespace windwrench
