// An effect's equation as a function of four arrays, which a model calls by its address.
#pragma once
#include "form.hpp"

namespace windwrench {

// a wrench
template <class T, class State>
void call(void (*f)(const T *, const VehicleNumbers<T> &, State &, Wrench<T> &), T *c,
          VehicleNumbers<T> &v, T *state, T *wrench) {
  f(c, v, *reinterpret_cast<State *>(state), *reinterpret_cast<Wrench<T> *>(wrench));
}
// rotor speeds, or a sample, with the effect's memory
template <class T, class Values>
void call(void (*f)(const T *, const VehicleNumbers<T> &, Values &, T *), T *c,
          VehicleNumbers<T> &v, T *values, T *memory) {
  f(c, v, *reinterpret_cast<Values *>(values), memory);
}
// a wrench with a state of its own behind the coefficients, or what carries the state on
template <class T, class Own, class Last>
void call(void (*f)(const T *, Own *, const VehicleNumbers<T> &, const FlightState<T> &, Last &),
          T *c, VehicleNumbers<T> &v, T *state, T *last) {
  f(c, c + HIDDEN, v, *reinterpret_cast<FlightState<T> *>(state), *reinterpret_cast<Last *>(last));
}

template <class T, auto EQUATION> void called(T *c, T *vehicle, T *third, T *fourth) {
  call(EQUATION, c, *reinterpret_cast<VehicleNumbers<T> *>(vehicle), third, fourth);
}

}  // namespace windwrench
