// Rotor inertia: the torque that it takes to spin rotors up and to turn them with the body.
//
// With the angular momentum h = jr sum spin_i W_i along body z: tau = -dh/dt e_z - omega x h e_z in
// body axes, W being delivered rotor speeds and dW/dt their mean over the step.
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
