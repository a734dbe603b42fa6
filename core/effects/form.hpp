// What an effect's equation reads and writes. Memory as the records of dynamics/effects/base.py:
// numbers of one type in this order, so that a C function of four arrays may be an effect.
//
// T is the number of a flight, and C that of coefficients and vehicle: the same, or single numbers
// beside lanes.
#pragma once
#include "../numbers.hpp"

namespace windwrench {

// An effect by its address: (coefficients and own state, the vehicle's numbers, the flight's state
// or the rotors or the sample, the wrench or the effect's memory)
template <class T> using EffectModel = void (*)(T *, T *, T *, T *);

constexpr int PARAMETERS = 8;  // most coefficients of an effect
constexpr int HIDDEN = 8;      // place of a wrench effect's own state behind its coefficients
constexpr int ROW = 16;        // numbers of a wrench effect: coefficients and own state

template <class C> struct VehicleNumbers {
  C mass, gravity;                 // kg, m/s2
  C rotor_radius, floor, ceiling;  // m
  C voltage_ref, hover_rate;       // V, rad/s
  C com[3], rotor[4][3];           // m, from the geometric centre
  C spin[4], reaction[4];          // turning sense about body +z; Nm/(rad/s)2
};

template <class T> struct FlightState {
  T position[3];                // m, world, of the geometric centre
  T rotation[3][3];             // body to world
  T velocity[3], rate[3];       // m/s, world; rad/s, body
  T rotor_speed[4], thrust[4];  // rad/s and N, delivered
  T wind[3];                    // m/s, world
  T voltage, time;              // V, 0: not known; s
  T rotor_acceleration[4];      // rad/s2, mean over the step
};

template <class T> struct Rotors {
  T speed[4];             // rad/s
  T step, voltage, time;  // s; V, 0: not known; s since the start
};

template <class T> struct Sample {
  T speed[4], position[3], quaternion[4];     // rad/s, m, body to world
  T step;                                     // s, since the effect was last called
  T has_speed, has_position, has_quaternion;  // 1 where the part is given
  T direction;                                // +1: from truth to report, -1: back
};

template <class T> struct Wrench {
  T force[3], torque[3];  // N, world; Nm, body, about the centre of mass
};

static_assert(sizeof(VehicleNumbers<double>) == 30 * sizeof(double), "VEHICLE_SIZE");
static_assert(sizeof(FlightState<double>) == 35 * sizeof(double), "STATE_SIZE");
static_assert(sizeof(Rotors<double>) == 7 * sizeof(double), "ROTORS_SIZE");
static_assert(sizeof(Sample<double>) == 16 * sizeof(double), "SAMPLE_SIZE");
static_assert(sizeof(Wrench<double>) == 6 * sizeof(double), "a force and a torque");

// any of these as an array of its numbers
template <class T, class Struct> T *numbers_of(Struct &all) { return reinterpret_cast<T *>(&all); }

}  // namespace windwrench
