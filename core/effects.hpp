// A vehicle's declared effects at work: what rotors deliver, what wrench effects add, what sensing
// effects changed. The models themselves are functions of their own (`EffectModel`).
#pragma once
#include "filter.hpp"

namespace windwrench {

// layouts of dynamics/effects/base.py
enum {
  AT_ROTATION = 3,
  AT_VELOCITY = 12,
  AT_RATE = 15,
  AT_SPEED = 18,
  AT_THRUST = 22,
  AT_WIND = 26,
  AT_VOLTAGE = 29,
  AT_TIME = 30,
  AT_ACCELERATION = 31
};  // of the flight's state
enum { ROTOR_STEP = 4, ROTOR_VOLTAGE = 5, ROTOR_TIME = 6 };                     // of the rotors
enum { SAMPLE_STEP = 11, HAS_SPEED, HAS_POSITION, HAS_QUATERNION, DIRECTION };  // of a sample

// What the rotors deliver over a step of dt s at the logged rotor speeds (4) rad/s
template <class S> void drive(Model<S> &m, const S *speeds, S dt, S voltage) {
  m.voltage = voltage;
  for (int i = 0; i < 4; i++) m.rotors[i] = speeds[i];
  m.rotors[ROTOR_STEP] = dt;
  m.rotors[ROTOR_TIME] = m.time;
  if (m.rotor_count > 0) m.rotors[ROTOR_VOLTAGE] = voltage;
  for (int i = 0; i < m.rotor_count; i++)
    m.rotor_models[i](m.rotor_coefficients[i], m.constants, m.rotors, m.memory[i]);
  if (m.wrench_count > 0) {
    S *last =
        m.memory[ROTORS + SENSORS];  // whether there are delivered rotor speeds, and their values
    S share = dt > S(0) ? last[0] / dt : S(0);
    last[0] = S(1);
    for (int i = 0; i < 4; i++) {
      m.effect_state[AT_ACCELERATION + i] = share * (m.rotors[i] - last[1 + i]);
      last[1 + i] = m.rotors[i];
    }
    m.waiting = m.hooked;
  }
  rotor_wrench(m.body, m.rotors, m.rotor_wrench);
}

// What the wrench effects say at a state x of attitude R, into m.effect_wrench. The first call
// after `drive` also carries the effects' own states over the step: made at the state itself
template <class S> void apply_effects(Model<S> &m, const S *x, const S R[3][3]) {
  if (m.wrench_count == 0) return;
  S *state = m.effect_state;
  for (int i = 0; i < 3; i++) {
    state[i] = x[i];
    state[AT_VELOCITY + i] = x[VELOCITY + i];
    state[AT_RATE + i] = x[RATE + i];
    state[AT_WIND + i] = m.wind[i];
    for (int j = 0; j < 3; j++) state[AT_ROTATION + 3 * i + j] = R[i][j];
  }
  for (int i = 0; i < 4; i++) {
    state[AT_SPEED + i] = m.rotors[i];
    state[AT_THRUST + i] = m.body.k[i] * m.rotors[i] * m.rotors[i];
  }
  state[AT_VOLTAGE] = m.voltage;
  state[AT_TIME] = m.time;
  if (m.waiting > 0) {
    m.waiting = 0;
    for (int i = 0; i < m.wrench_count; i++)
      if (m.wrench_hooks[i])
        m.wrench_hooks[i](m.wrench_coefficients[i], m.constants, state, m.rotors);
  }
  for (int i = 0; i < 6; i++) m.effect_wrench[i] = S(0);
  for (int i = 0; i < m.wrench_count; i++)
    m.wrench_models[i](m.wrench_coefficients[i], m.constants, state, m.effect_wrench);
}

// Rotor speeds and pose, the first 11 of m.sample, from report back to truth. parts: 1 position,
// 2 attitude, 4 rotor speeds; where the attitude is no part of it, it must still be readable
template <class S> void undo_sensing(Model<S> &m, int parts, S dt) {
  m.sample[SAMPLE_STEP] = dt;
  m.sample[DIRECTION] = S(-1);
  m.sample[HAS_POSITION] = S(parts & 1 ? 1 : 0);
  m.sample[HAS_QUATERNION] = S(parts & 2 ? 1 : 0);
  m.sample[HAS_SPEED] = S(parts & 4 ? 1 : 0);
  for (int i = int(m.sensing_count) - 1; i >= 0; i--)
    m.sensing_models[i](m.sensing_coefficients[i], m.constants, m.sample, m.memory[ROTORS + i]);
}

}  // namespace windwrench
