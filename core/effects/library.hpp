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

template <class T> struct LibraryEffect {
  const char *name, *kind;
  EffectModel<T> model, advance;  // advance: null without a state of its own
};

// All effects with an equation
template <class T> struct Library {
#define CALLED(name) called<T, name<T, T>>
#define EFFECT(kind, name) {#name, kind, CALLED(name), nullptr}
  static constexpr LibraryEffect<T> all[] = {
      EFFECT("sensing", attitude_gain),
      EFFECT("rotor input", battery_sag),
      EFFECT("wrench", body_drag),
      EFFECT("wrench", ceiling_effect),
      EFFECT("sensing", clock_offset),
      EFFECT("wrench", constant_force),
      EFFECT("wrench", constant_torque),
      EFFECT("wrench", fan_jet),
      EFFECT("wrench", flapping_moment),
      EFFECT("wrench", ground_effect),
      EFFECT("wrench", inflow_drag),
      EFFECT("wrench", inflow_thrust),
      EFFECT("rotor input", latency),
      EFFECT("sensing", marker_offset),
      EFFECT("rotor input", motor_lag),
      EFFECT("wrench", rate_damping),
      EFFECT("wrench", rotor_drag),
      EFFECT("rotor input", rotor_efficiency),
      EFFECT("wrench", rotor_inertia),
      EFFECT("wrench", rotor_interaction),
      {"slung_payload", "wrench", CALLED(slung_payload), CALLED(advance_slung_payload)},
      EFFECT("wrench", thrust_axis_tilt),
      EFFECT("rotor input", thrust_curvature),
      EFFECT("rotor input", thrust_fade),
      EFFECT("rotor input", thrust_scale),
      EFFECT("wrench", translational_lift),
      EFFECT("wrench", wind),
      EFFECT("sensing", world_tilt),
  };
#undef EFFECT
#undef CALLED
};
constexpr int LIBRARY_EFFECTS = sizeof(Library<double>::all) / sizeof(LibraryEffect<double>);
template <class T> const LibraryEffect<T> *library() { return Library<T>::all; }

// The effect of a name, or null: none of the library, or one without an equation
template <class T> const LibraryEffect<T> *find_effect(const char *name) {
  for (int i = 0; i < LIBRARY_EFFECTS; i++)
    if (std::strcmp(library<T>()[i].name, name) == 0) return library<T>() + i;
  return nullptr;
}

}  // namespace windwrench
