// Body drag: dynamics/effects/body_drag.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: dx, dy, dz N/(m/s), cx, cy, cz N/(m/s)2
template <class T, class C>
void body_drag(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w) {
  C centre[3] = {};
  T u[3], f[3];
  air_velocity(s, centre, u);
  T speed = root(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
  for (int i = 0; i < 3; i++) f[i] = -(c[i] + c[3 + i] * speed) * u[i];
  add_force_at(v, s, centre, f, w);
}

}  // namespace windwrench
