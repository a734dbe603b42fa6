// Battery sag: at a given logged rotor speed the rotors deliver less as the battery voltage falls.
//
// Thrust and reaction torque scale by (V / voltage_ref)^n: the delivered rotor speed is W (V /
// voltage_ref)^(n/2). It applies where the rotor speeds are commands, or worked out from commands
// at the reference voltage. Nothing changes where the voltage is not known.
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
