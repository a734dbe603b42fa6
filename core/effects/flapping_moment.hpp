// Flapping moment: the blades of a moving rotor flap, and their hub turns the vehicle away from the
// motion.
//
// At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: the torque -kflap W_i (u_i x e_z)
// in body axes. It is the k_flap of RotorPy. The force that goes with flapping is rotor_drag.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: kflap Nm/(rad/s m/s)
template <class T, class C>
void flapping_moment(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s,
                     Wrench<T> &w) {
  C r[3];
  T u[3];
  for (int i = 0; i < 4; i++) {
    rotor_place(v, i, C{}, r);
    air_velocity(s, r, u);
    w.torque[0] -= c[0] * s.rotor_speed[i] * u[1];
    w.torque[1] += c[0] * s.rotor_speed[i] * u[0];
  }
}

}  // namespace windwrench
