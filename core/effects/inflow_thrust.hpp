// Inflow thrust: a rotor that climbs into its own inflow delivers less thrust, one that sinks
// delivers more.
//
// At rotor i, at body velocity u_i = R'(v - wind) + omega x r_i: F_i = -kz W_i u_iz along body z,
// applied at the rotor. Roll and pitch so feel a damping torque. It is the k_z of RotorPy.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: kz N/(rad/s m/s), central
template <class T, class C>
void inflow_thrust(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w) {
  C r[3];
  T u[3];
  for (int i = 0; i < 4; i++) {
    rotor_place(v, i, c[1], r);
    air_velocity(s, r, u);
    T f[3] = {T{}, T{}, -c[0] * s.rotor_speed[i] * u[2]};
    add_force_at(v, s, r, f, w);
  }
}

}  // namespace windwrench
