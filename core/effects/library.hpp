// The library of effects by name, for numbers of any type T: a double, a float, or lanes.
#pragma once
#include "attitude_gain.hpp"
#include "battery_sag.hpp"
#include "body_drag.hpp"
#include "called.hpp"
#include "ceiling_effect.hpp"
#include "clock_offset.hpp"
#include "constant_force.hpp"
#include "constant_torque.hpp"
#include "fan_jet.hpp"
#include "flapping_moment.hpp"
#include "ground_effect.hpp"
#include "inflow_drag.hpp"
#include "inflow_thrust.hpp"
#include "latency.hpp"
#include "marker_offset.hpp"
#include "motor_lag.hpp"
#include "rate_damping.hpp"
#include "rotor_drag.hpp"
#include "rotor_efficiency.hpp"
#include "rotor_inertia.hpp"
#include "rotor_interaction.hpp"
#include "slung_payload.hpp"
#include "thrust_axis_tilt.hpp"
#include "thrust_curvature.hpp"
#include "thrust_fade.hpp"
#include "thrust_scale.hpp"
#include "translational_lift.hpp"
#include "wind.hpp"
#include "world_tilt.hpp"

namespace windwrench {

enum Kind { WRENCH, ROTOR_INPUT, SENSING };
template <class T> struct LibraryEffect {
  const char *name;
  Kind kind;
  EffectModel<T> model, advance;  // advance: null without a state of its own
};
constexpr int LIBRARY_EFFECTS = 28;

// All effects with an equation
template <class T> const LibraryEffect<T> *library() {
#define CALLED(name) called<T, name<T, T>>
#define EFFECT(kind, name) \
  { #name, kind, CALLED(name), nullptr }
  static constexpr LibraryEffect<T> all[LIBRARY_EFFECTS] = {
      EFFECT(SENSING, attitude_gain),
      EFFECT(ROTOR_INPUT, battery_sag),
      EFFECT(WRENCH, body_drag),
      EFFECT(WRENCH, ceiling_effect),
      EFFECT(SENSING, clock_offset),
      EFFECT(WRENCH, constant_force),
      EFFECT(WRENCH, constant_torque),
      EFFECT(WRENCH, fan_jet),
      EFFECT(WRENCH, flapping_moment),
      EFFECT(WRENCH, ground_effect),
      EFFECT(WRENCH, inflow_drag),
      EFFECT(WRENCH, inflow_thrust),
      EFFECT(ROTOR_INPUT, latency),
      EFFECT(SENSING, marker_offset),
      EFFECT(ROTOR_INPUT, motor_lag),
      EFFECT(WRENCH, rate_damping),
      EFFECT(WRENCH, rotor_drag),
      EFFECT(ROTOR_INPUT, rotor_efficiency),
      EFFECT(WRENCH, rotor_inertia),
      EFFECT(WRENCH, rotor_interaction),
      {"slung_payload", WRENCH, CALLED(slung_payload), CALLED(advance_slung_payload)},
      EFFECT(WRENCH, thrust_axis_tilt),
      EFFECT(ROTOR_INPUT, thrust_curvature),
      EFFECT(ROTOR_INPUT, thrust_fade),
      EFFECT(ROTOR_INPUT, thrust_scale),
      EFFECT(WRENCH, translational_lift),
      EFFECT(WRENCH, wind),
      EFFECT(SENSING, world_tilt),
  };
#undef EFFECT
#undef CALLED
  return all;
}

// The effect of a name, or null: none of the library, or one without an equation
template <class T> const LibraryEffect<T> *find_effect(const char *name) {
  for (int i = 0; i < LIBRARY_EFFECTS; i++)
    if (std::strcmp(library<T>()[i].name, name) == 0) return library<T>() + i;
  return nullptr;
}

}  // namespace windwrench
