// Ceiling effect: a rotor near the ceiling delivers more thrust at the same rotor speed.
//
// Thrust of a rotor at distance d below ceiling_z is multiplied by 1 / (1 - rho (R / (4 d))^2), the
// mirror image of the ground_effect. Applied rotor by rotor, so a tilted vehicle feels a torque.
// The distance is taken as no less than where the factor reaches 2. Nothing changes where the
// vehicle states no ceiling.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: rho, central
template <class T, class C>
void ceiling_effect(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w) {
  using S = Single<T>;
  lift_near_plane(c, v, s, w, v.ceiling, S(-1), v.ceiling < C{} + Single<C>(1e6));
}

}  // namespace windwrench
