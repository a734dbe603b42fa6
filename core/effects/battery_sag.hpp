// Battery sag: dynamics/effects/battery_sag.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: n
template <class T, class C>
void battery_sag(const C *c, const VehicleNumbers<C> &v, Rotors<T> &rotors, T *) {
  T n = T{} + Single<T>(0.5) * c[0], ratio = rotors.voltage / v.voltage_ref;
  auto known = (rotors.voltage > T{}) & (T{} + v.voltage_ref > T{});
  for (int i = 0; i < 4; i++)
    rotors.speed[i] = choose(known, rotors.speed[i] * power(ratio, n), rotors.speed[i]);
}

}  // namespace windwrench
