// Ground effect: a rotor near the floor delivers more thrust at the same rotor speed.
//
// Thrust of a rotor at height z above the floor is multiplied by 1 / (1 - rho (R / (4 z))^2),
// Cheeseman and Bennett's equation for rho = 1; rho of about 3 was measured for whole quadrotors.
// Applied rotor by rotor, so a tilted vehicle feels a torque. The height is taken as no less than
// where the factor reaches 2, as the equation has a pole below it.
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
