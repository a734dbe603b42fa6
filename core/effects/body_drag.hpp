// Body drag: the air's force on hull and frame, linear and quadratic in the airspeed, at the
// geometric centre.
//
// With u = R'(v - wind) the airspeed in body axes, F = -diag(dx, dy, dz) u - |u| diag(cx, cy, cz) u
// in body axes. The quadratic part is the parasitic drag of RotorPy, c_Dx, c_Dy, c_Dz.
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
