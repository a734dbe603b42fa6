// An effect's equation as a function of four arrays, which a model calls by its address.
#pragma once
#include "form.hpp"

namespace windwrench {

// An equation as a function of four arrays
template <class T, class Equation, Equation F> struct Called;

template <class T, class State,
          void (*F)(const T *, const VehicleNumbers<T> &, State &, Wrench<T> &)>
struct Called<T, void (*)(const T *, const VehicleNumbers<T> &, State &, Wrench<T> &), F> {
  static void call(T *c, T *vehicle, T *state, T *wrench) {
    F(c, *reinterpret_cast<VehicleNumbers<T> *>(vehicle), *reinterpret_cast<State *>(state),
      *reinterpret_cast<Wrench<T> *>(wrench));
  }
};
template <class T, class Values, void (*F)(const T *, const VehicleNumbers<T> &, Values &, T *)>
struct Called<T, void (*)(const T *, const VehicleNumbers<T> &, Values &, T *), F> {
  static void call(T *c, T *vehicle, T *values, T *memory) {
    F(c, *reinterpret_cast<VehicleNumbers<T> *>(vehicle), *reinterpret_cast<Values *>(values),
      memory);
  }
};
// with a state of its own behind the coefficients
template <class T, void (*F)(const T *, const T *, const VehicleNumbers<T> &,
                             const FlightState<T> &, Wrench<T> &)>
struct Called<T,
              void (*)(const T *, const T *, const VehicleNumbers<T> &, const FlightState<T> &,
                       Wrench<T> &),
              F> {
  static void call(T *c, T *vehicle, T *state, T *wrench) {
    F(c, c + HIDDEN, *reinterpret_cast<VehicleNumbers<T> *>(vehicle),
      *reinterpret_cast<FlightState<T> *>(state), *reinterpret_cast<Wrench<T> *>(wrench));
  }
};
template <class T, void (*F)(const T *, T *, const VehicleNumbers<T> &, const FlightState<T> &,
                             const Rotors<T> &)>
struct Called<T,
              void (*)(const T *, T *, const VehicleNumbers<T> &, const FlightState<T> &,
                       const Rotors<T> &),
              F> {
  static void call(T *c, T *vehicle, T *state, T *rotors) {
    F(c, c + HIDDEN, *reinterpret_cast<VehicleNumbers<T> *>(vehicle),
      *reinterpret_cast<FlightState<T> *>(state), *reinterpret_cast<Rotors<T> *>(rotors));
  }
};

template <class T, auto F> constexpr EffectModel<T> called = &Called<T, decltype(F), F>::call;

}  // namespace windwrench
