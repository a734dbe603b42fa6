// Rotor drag: dynamics/effects/rotor_drag.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: kdx, kdy N/(rad/s m/s), central
template <class T, class C>
void rotor_drag(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w) {
  T u[3], total_x = {}, total_y = {};
  C centre[3] = {}, r[3];
  air_velocity(s, centre, u);
  for (int i = 0; i < 4; i++) {
    rotor_place(v, i, c[2], r);
    T fx = -c[0] * s.rotor_speed[i] * (u[0] + s.rate[1] * r[2] - s.rate[2] * r[1]);
    T fy = -c[1] * s.rotor_speed[i] * (u[1] + s.rate[2] * r[0] - s.rate[0] * r[2]);
    C x = r[0] - v.com[0], y = r[1] - v.com[1], z = r[2] - v.com[2];
    w.torque[0] -= z * fy;
    w.torque[1] += z * fx;
    w.torque[2] += x * fy - y * fx;
    total_x += fx;
    total_y += fy;
  }
  for (int i = 0; i < 3; i++) w.force[i] += s.rotation[i][0] * total_x + s.rotation[i][1] * total_y;
}

}  // namespace windwrench
