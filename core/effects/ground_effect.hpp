// Ground effect: dynamics/effects/ground_effect.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: rho, central
template <class T, class C>
void ground_effect(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w) {
  using S = Single<T>;
  lift_near_plane(c, v, s, w, v.floor, S(1), v.floor > C{} - Single<C>(1e6));
}

}  // namespace windwrench
