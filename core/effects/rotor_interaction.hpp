// Rotor interaction: dynamics/effects/rotor_interaction.py has the equation in words.
#pragma once
#include "../mean_jet.hpp"
#include "parts.hpp"

namespace windwrench {

// c: kp, kw N/(rad/s m/s)
template <class T, class C>
void rotor_interaction(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s,
                       Wrench<T> &w) {
  using S = Single<T>;
  const S four_rotors =
      S(8.0 * AIR_DENSITY * 3.141592653589793);  // 4 x 2 rho A over the square of R
  C centre[3] = {}, r[3];
  T u[3], thrust = {}, force[3] = {};
  air_velocity(s, centre, u);
  T along = u[0] * u[0] + u[1] * u[1];
  for (int i = 0; i < 4; i++) thrust += s.thrust[i];
  T hover = root(thrust / four_rotors) / v.rotor_radius, induced = hover;  // m/s
  for (int step = 0; step < 6; step++) {
    // Newton; bounds keep it out of the vortex ring, where no v solves
    T through = u[2] + induced;
    T flow = larger(root(along + through * through), S(0.1) * hover);
    T slope = larger(flow + induced * through / flow, S(0.5) * hover);
    induced -= (induced * flow - hover * hover) / slope;
    induced = smaller(larger(induced, S(0.05) * hover), S(2.5) * hover);
  }
  T through = u[2] + induced;
  T lean = S(2) * induced / larger(root(along + through * through) + through, hover);
  lean = choose(thrust > T{}, lean, T{} + S(1));
  for (int i = 0; i < 4; i++) {
    rotor_place(v, i, C{}, r);
    C arm = root(r[0] * r[0] + r[1] * r[1]);
    T leads = choose(arm > C{}, (r[0] * u[0] + r[1] * u[1]) / arm, T{});
    force[2] -= s.rotor_speed[i] * (c[0] * lean * leads + c[1] * larger(-leads, T{}));
  }
  add_force_at(v, s, centre, force, w);
}

}  // namespace windwrench
