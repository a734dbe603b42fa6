// A vehicle's declared effects at work: what rotors deliver, what wrench effects add, what sensing
// effects changed. The equations are functions of their own (effects/NAME.hpp, `EffectModel`).
#pragma once
#include "filter.hpp"

namespace windwrench {

// What the rotors deliver over a step of dt s at the logged rotor speeds (4) rad/s
template <class T> void drive(Model<T> &m, const T *speeds, Single<T> dt, T voltage) {
  using S = Single<T>;
  m.voltage = voltage;
  for (int i = 0; i < 4; i++) m.rotors.speed[i] = speeds[i];
  m.rotors.step = T{} + dt;
  m.rotors.time = m.time;
  if (m.rotor_count > 0) m.rotors.voltage = voltage;
  for (int i = 0; i < m.rotor_count; i++)
    m.rotor_models[i](m.rotor_coefficients[i], numbers_of<T>(m.constants), numbers_of<T>(m.rotors),
                      m.memory[i]);
  if (m.wrench_count > 0) {
    T *last = m.memory[ROTORS + SENSORS];  // are there delivered rotor speeds, and their values
    T share = dt > S(0) ? last[0] / dt : T{};
    last[0] = T{} + S(1);
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
template <class T>
void fill_state(const Model<T> &m, const T *position, const T R[3][3], const T *velocity,
                const T *rate, const T *speeds, FlightState<T> &state) {
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
template <class T> void add_wrenches(Model<T> &m, FlightState<T> &state, T *out) {
  for (int i = 0; i < 6; i++) out[i] = T{};
  for (int i = 0; i < m.wrench_count; i++)
    m.wrench_models[i](m.wrench_coefficients[i], numbers_of<T>(m.constants), numbers_of<T>(state),
                       out);
}

// What the wrench effects say at a state x of attitude R, into m.effect_wrench. The first call
// after `drive` also carries the effects' own states over the step: made at the state itself
template <class T> void apply_effects(Model<T> &m, const T *x, const T R[3][3]) {
  if (m.wrench_count == 0) return;
  fill_state(m, x, R, x + VELOCITY, x + RATE, m.rotors.speed, m.effect_state);
  if (m.waiting > 0) {
    m.waiting = 0;
    for (int i = 0; i < m.wrench_count; i++)
      if (m.wrench_hooks[i])
        m.wrench_hooks[i](m.wrench_coefficients[i], numbers_of<T>(m.constants),
                          numbers_of<T>(m.effect_state), numbers_of<T>(m.rotors));
  }
  add_wrenches(m, m.effect_state, m.effect_wrench);
}

// Rotor speeds and pose, the first 11 numbers of m.sample, from truth to report (direction +1), or
// back (-1) in the reverse order. position, quaternion, speed: 1 where there is one; where there is
// no quaternion, the one in the sample must still be readable
template <class T>
void rewrite_sample(Model<T> &m, T position, T quaternion, T speed, Single<T> dt, int direction) {
  m.sample.step = T{} + dt;
  m.sample.direction = T{} + Single<T>(direction);
  m.sample.has_position = position;
  m.sample.has_quaternion = quaternion;
  m.sample.has_speed = speed;
  for (int n = 0; n < m.sensing_count; n++) {
    int i = direction > 0 ? n : int(m.sensing_count) - 1 - n;
    m.sensing_models[i](m.sensing_coefficients[i], numbers_of<T>(m.constants),
                        numbers_of<T>(m.sample), m.memory[ROTORS + i]);
  }
}
// parts: 1 position, 2 attitude, 4 rotor speeds
template <class T> void rewrite_sample(Model<T> &m, int parts, Single<T> dt, int direction) {
  auto has = [parts](int part) { return T{} + Single<T>(parts & part ? 1 : 0); };
  rewrite_sample(m, has(1), has(2), has(4), dt, direction);
}
template <class T> void undo_sensing(Model<T> &m, int parts, Single<T> dt) {
  rewrite_sample(m, parts, dt, -1);
}

}  // namespace windwrench
