// Inflow drag: dynamics/effects/inflow_drag.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: kl N/(m/s)2
template <class T, class C>
void inflow_drag(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w) {
  C r[3];
  T u[3];
  for (int i = 0; i < 4; i++) {
    rotor_place(v, i, C{}, r);
    air_velocity(s, r, u);
    T kl = c[0] * u[2], f[3] = {-kl * u[0], -kl * u[1], T{}};
    add_force_at(v, s, r, f, w);
  }
}

}  // namespace windwrench
