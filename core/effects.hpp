// A vehicle's declared effects at work: what rotors deliver, what wrench effects add, what sensing
// effects changed. The equations are functions of their own (effects/NAME.hpp, `EffectModel`).
#pragma once
#include "filter.hpp"

namespace windwrench {

// What the rotors deliver over a step of dt s at the logged rotor speeds (4) rad/s
template <class S> void drive(Model<S> &m, const S *speeds, S dt, S voltage) {
  m.voltage = voltage;
  for (int i = 0; i < 4; i++) m.rotors.speed[i] = speeds[i];
  m.rotors.step = dt;
  m.rotors.time = m.time;
  if (m.rotor_count > 0) m.rotors.voltage = voltage;
  for (int i = 0; i < m.rotor_count; i++)
    m.rotor_models[i](m.rotor_coefficients[i], numbers_of<S>(m.constants), numbers_of<S>(m.rotors),
                      m.memory[i]);
  if (m.wrench_count > 0) {
    S *last = m.memory[ROTORS + SENSORS];  // are there delivered rotor speeds, and their values
    S share = dt > S(0) ? last[0] / dt : S(0);
    last[0] = S(1);
    for (int i = 0; i < 4; i++) {
      m.effect_state.rotor_acceleration[i] = share * (m.rotors.speed[i] - last[1 + i]);
      last[1 + i] = m.rotors.speed[i];
    }
    m.waiting = m.hooked;
  }
  rotor_wrench(m.body, m.rotors.speed, m.rotor_wrench);
}

// The flight's state for the wrench effects, all but the rotors' acceleration: position (3),
// attitude R and velocity (3) in the world, rate (3), body, and delivered rotor speeds (4)
template <class S>
void fill_state(const Model<S> &m, const S *position, const S R[3][3], const S *velocity,
                const S *rate, const S *speeds, FlightState<S> &state) {
  for (int i = 0; i < 3; i++) {
    state.position[i] = position[i];
    state.velocity[i] = velocity[i];
    state.rate[i] = rate[i];
    state.wind[i] = m.wind[i];
    for (int j = 0; j < 3; j++) state.rotation[i][j] = R[i][j];
  }
  for (int i = 0; i < 4; i++) {
    state.rotor_speed[i] = speeds[i];
    state.thrust[i] = m.body.k[i] * speeds[i] * speeds[i];
  }
  state.voltage = m.voltage;
  state.time = m.time;
}

// What the wrench effects say at a state, out (6)
template <class S> void add_wrenches(Model<S> &m, FlightState<S> &state, S *out) {
  for (int i = 0; i < 6; i++) out[i] = S(0);
  for (int i = 0; i < m.wrench_count; i++)
    m.wrench_models[i](m.wrench_coefficients[i], numbers_of<S>(m.constants), numbers_of<S>(state),
                       out);
}

// What the wrench effects say at a state x of attitude R, into m.effect_wrench. The first call
// after `drive` also carries the effects' own states over the step: made at the state itself
template <class S> void apply_effects(Model<S> &m, const S *x, const S R[3][3]) {
  if (m.wrench_count == 0) return;
  fill_state(m, x, R, x + VELOCITY, x + RATE, m.rotors.speed, m.effect_state);
  if (m.waiting > 0) {
    m.waiting = 0;
    for (int i = 0; i < m.wrench_count; i++)
      if (m.wrench_hooks[i])
        m.wrench_hooks[i](m.wrench_coefficients[i], numbers_of<S>(m.constants),
                          numbers_of<S>(m.effect_state), numbers_of<S>(m.rotors));
  }
  add_wrenches(m, m.effect_state, m.effect_wrench);
}

// Rotor speeds and pose, the first 11 numbers of m.sample, from truth to report (direction +1), or
// back (-1) in the reverse order. parts: 1 position, 2 attitude, 4 rotor speeds; where the attitude
// is no part of it, it must still be readable
template <class S> void rewrite_sample(Model<S> &m, int parts, S dt, int direction) {
  m.sample.step = dt;
  m.sample.direction = S(direction);
  m.sample.has_position = S(parts & 1 ? 1 : 0);
  m.sample.has_quaternion = S(parts & 2 ? 1 : 0);
  m.sample.has_speed = S(parts & 4 ? 1 : 0);
  for (int n = 0; n < m.sensing_count; n++) {
    int i = direction > 0 ? n : int(m.sensing_count) - 1 - n;
    m.sensing_models[i](m.sensing_coefficients[i], numbers_of<S>(m.constants),
                        numbers_of<S>(m.sample), m.memory[ROTORS + i]);
  }
}
template <class S> void undo_sensing(Model<S> &m, int parts, S dt) {
  rewrite_sample(m, parts, dt, -1);
}

}  // namespace windwrench
