// Latency: dynamics/effects/latency.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

constexpr int KEPT_ROTORS = 22;  // samples, 0.105 s at 200 Hz

// c: d s; memory: the delay line
template <class T, class C>
void latency(const C *c, const VehicleNumbers<C> &, Rotors<T> &rotors, T *memory) {
  memory[1] += rotors.step;
  for (int i = 0; i < lanes_of<T>; i++)
    delay(lane_of(memory, i), 4, KEPT_ROTORS, number_of(c[0], i), lane_of(rotors.speed, i));
}

}  // namespace windwrench
