// Clock offset: dynamics/effects/clock_offset.py has the equation in words.
#pragma once
#include "parts.hpp"

namespace windwrench {

// kept, 0.06 s at 200 Hz
constexpr int KEPT_POSES = 13, KEPT_SPEEDS = 22;

// of one lane; sample: the numbers of a Sample
template <class S> void offset_clock(S offset, Strided<S> sample, Strided<S> memory) {
  Strided<S> position = sample.from(4), quaternion = sample.from(7);
  S step = sample[11], has_speed = sample[12], has_position = sample[13];
  S has_quaternion = sample[14], wanted = offset * sample[15];
  memory[1] += step;
  if (wanted > S(0)) {
    if (!(has_position > S(0) && has_quaternion > S(0))) return;
    // a quaternion and its negative are one attitude: keep to the side of the last one
    S dot = S(0), square = S(0);
    for (int i = 0; i < 4; i++) dot += memory[6 + i] * quaternion[i];
    if (memory[0] > S(0) && dot < S(0))
      for (int i = 0; i < 4; i++) quaternion[i] *= S(-1);
    delay(memory, 7, KEPT_POSES, wanted, position);
    for (int i = 0; i < 4; i++) square += quaternion[i] * quaternion[i];
    S length = std::sqrt(square);
    for (int i = 0; i < 4; i++) quaternion[i] /= length;
  } else if (wanted < S(0) && has_speed > S(0)) {
    delay(memory, 4, KEPT_SPEEDS, -wanted, sample);
  }
}

// c: dt s; memory: the delay line of poses, or of rotor speeds
template <class T, class C>
void clock_offset(const C *c, const VehicleNumbers<C> &, Sample<T> &sample, T *memory) {
  for (int i = 0; i < lanes_of<T>; i++)
    offset_clock(number_of(c[0], i), lane_of(numbers_of<T>(sample), i), lane_of(memory, i));
}

}  // namespace windwrench
