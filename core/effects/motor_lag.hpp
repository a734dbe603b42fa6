// Motor lag: dynamics/effects/motor_lag.py has the equation in words.
#pragma once
#include "form.hpp"

namespace windwrench {

// c: tau s; memory: whether the rotors have started, and their speeds (4)
template <class T, class C>
void motor_lag(const C *c, const VehicleNumbers<C> &, Rotors<T> &rotors, T *memory) {
  using S = Single<T>;
  T tau = T{} + c[0], one = T{} + S(1);
  T blend = choose((tau > T{}) & (memory[0] > T{}), one - exponential(-rotors.step / tau), one);
  memory[0] = one;
  for (int i = 0; i < 4; i++) {
    memory[1 + i] += blend * (rotors.speed[i] - memory[1 + i]);
    rotors.speed[i] = memory[1 + i];
  }
}

}  // namespace windwrench
