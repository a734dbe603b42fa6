// Wind: a steady wind, fixed in the world frame.
//
// Every declared effect that asks for the wind (rotor_drag, body_drag, inflow_thrust ...) feels it.
// cd is a drag of its own, for a vehicle that declares none: with w the wind and u = w - v, F = cd
// |u| u + cd |v| v at the centre of mass, that is the change against the same drag in still air. So
// nothing happens without wind, and what differs from a constant force is how the force changes
// with the velocity.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: wx, wy, wz m/s, cd N/(m/s)2
template <class T, class C>
void wind(const C *c, const VehicleNumbers<C> &, FlightState<T> &s, Wrench<T> &w) {
  T air = {}, ground = {};
  for (int i = 0; i < 3; i++) {
    T u = c[i] - s.velocity[i];
    s.wind[i] += c[i];
    air += u * u;
    ground += s.velocity[i] * s.velocity[i];
  }
  air = c[3] * root(air);
  ground = c[3] * root(ground);
  for (int i = 0; i < 3; i++) w.force[i] += air * (c[i] - s.velocity[i]) + ground * s.velocity[i];
}

}  // namespace windwrench
