// Slung payload: dynamics/effects/slung_payload.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// c: m kg, l m, damping 1/s; own: whether the load has started, n (3), n' (3) 1/s
template <class T, class C>
void slung_payload(const C *c, const T *own, const VehicleNumbers<C> &v, const FlightState<T> &s,
                   Wrench<T> &w) {
  C centre[3] = {};
  T n[3], f[3], specific = {}, pull = {};
  for (int i = 0; i < 4; i++) specific += s.thrust[i] / v.mass;
  for (int i = 0; i < 3; i++) {
    n[i] = choose(own[0] > T{}, own[1 + i], T{} - Single<T>(i == 2));
    T rate = own[4 + i], drag = c[2] * (s.velocity[i] + c[1] * rate - s.wind[i]);
    pull += c[1] * rate * rate - n[i] * (s.rotation[i][2] * specific + drag);
  }
  T tension = larger(pull / (Single<C>(1) / c[0] + Single<C>(1) / v.mass), T{});
  auto there = (c[0] > C{}) & (c[1] > C{});
  // the cable's pull in body axes
  for (int i = 0; i < 3; i++)
    f[i] = choose(
        there,
        tension * (s.rotation[0][i] * n[0] + s.rotation[1][i] * n[1] + s.rotation[2][i] * n[2]),
        T{});
  add_force_at(v, s, centre, f, w);
}

// carry the load on by a step
template <class T, class C>
void advance_slung_payload(const C *c, T *own, const VehicleNumbers<C> &v, const FlightState<T> &s,
                           const Rotors<T> &rotors) {
  auto there = (c[0] > C{}) & (c[1] > C{});
  T one = T{} + Single<T>(1), dt = rotors.step, specific = {}, pull = {}, square = {}, turning = {};
  T n[3], rate[3], swing[3];
  for (int i = 0; i < 4; i++) specific += s.thrust[i] / v.mass;
  for (int i = 0; i < 3; i++) {
    n[i] = i < 2 ? own[1 + i] : choose(own[0] == T{}, -one, own[3]);
    rate[i] = own[4 + i];
    T drag = c[2] * (s.velocity[i] + c[1] * rate[i] - s.wind[i]);
    swing[i] = s.rotation[i][2] * specific + drag;
    pull += c[1] * (rate[i] * rate[i]) - n[i] * swing[i];
  }
  pull = larger(pull, T{});
  for (int i = 0; i < 3; i++) {
    rate[i] -= dt * (swing[i] + pull * n[i]) / c[1];
    n[i] += dt * rate[i];
    square += n[i] * n[i];
  }
  T length = root(square);
  for (int i = 0; i < 3; i++) {
    n[i] /= length;
    turning += n[i] * rate[i];
  }
  own[0] = choose(there, one, own[0]);
  for (int i = 0; i < 3; i++) {
    own[1 + i] = choose(there, n[i], own[1 + i]);
    own[4 + i] = choose(there, rate[i] - turning * n[i], own[4 + i]);
  }
}

}  // namespace windwrench
