// Thrust axis tilt: dynamics/effects/thrust_axis_tilt.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: ax, ay rad
template <class T, class C>
void thrust_axis_tilt(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s,
                      Wrench<T> &w) {
  using S = Single<C>;
  C centre[3] = {}, angle = root(c[0] * c[0] + c[1] * c[1]);
  auto turns = angle >= C{} + S(1e-12);
  T thrust = {}, tx = {}, ty = {}, tz = {};
  for (int i = 0; i < 4; i++) {
    T lift = s.thrust[i], speed = s.rotor_speed[i];
    thrust += lift;
    tx += v.rotor[i][1] * lift;
    ty -= v.rotor[i][0] * lift;
    tz -= v.spin[i] * v.reaction[i] * speed * speed;
  }
  // Rodrigues' formula about the axis (x, y, 0)
  C x = choose(turns, c[0] / angle, C{}), y = choose(turns, c[1] / angle, C{});
  C sin_angle = choose(turns, sine(angle), C{}), rest = choose(turns, S(1) - cosine(angle), C{});
  T f[3] = {thrust * sin_angle * y, -thrust * sin_angle * x, -thrust * rest};
  add_force_at(v, s, centre, f, w);
  T along = rest * (x * tx + y * ty);
  w.torque[0] += sin_angle * y * tz + along * x - rest * tx;
  w.torque[1] += -sin_angle * x * tz + along * y - rest * ty;
  w.torque[2] += sin_angle * (x * ty - y * tx) - rest * tz;
}

}  // namespace windwrench
