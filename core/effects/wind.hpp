// Wind: dynamics/effects/wind.py has the equation in words.
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
