// The flight loop of the tasks, and the laws that fly in it: core/flight_loop.hpp,
// controllers/lqg.py, envs/observations.py.
#pragma once
#include "windwrench.h"
#include "windwrench_numbers.hpp"

namespace windwrench {

constexpr ww_number MOST = 4;  // m/s2, that the regulator adds to the flight loop's acceleration

struct Pilot {
  int law, started;
  int ticks;    // since the law began
  int samples;  // of the accelerometer since the last decision
  Flight<ww_number> loop;
  ww_number x[STATE];  // the estimate of the last step
  ww_number felt[6];   // sums: specific force of the accelerometer and of the rotors, world
  ww_number mean[6];   // m/s2, the same, of the last decision
  ww_number action[4], command[4];
  ww_number wanted[3];  // acceleration of the reference at the last decision, in tilts and m/s2
  ww_number states[STATES];

  void fly(Filter<ww_number> &f, int now, const ww_number *reference,
           const ww_number *accelerometer) {
    if (started && accelerometer) feel(f, accelerometer);
    if (!started) remember(f);
    if (now != law) begin(now, reference);
    CommandKind kind = decide(reference);
    remember(f);
    if (kind == BESIDE)
      for (int i = 0; i < SET_YAW_RATE; i++) loop.setpoint[i] = reference[i];
    else move_setpoint(loop, x, WW_NOMINAL_PERIOD);
    foresee(loop, f.vehicle, x);
    steer(loop, x, command, kind, WW_NOMINAL_PERIOD);
    if (kind != ROTOR_SPEEDS) through_the_rotors(loop, f.vehicle);
    ticks++;
  }

 private:
  void begin(int now, const ww_number *reference) {
    law = now;
    ticks = 0;
    // a law without the flight loop's own acceleration has a set point at rest
    for (int i = 0; i < SETPOINT; i++) loop.setpoint[i] = i < 3 || i == SET_YAW ? reference[i] : 0;
    for (int i = 0; i < 4; i++) action[i] = command[i] = 0;
    for (int i = 0; i < STATES; i++) states[i] = 0;
  }

  void remember(const Filter<ww_number> &f) {
    for (int i = 0; i < STATE; i++) x[i] = f.belief.x[i];
    started = 1;
  }

  // Add the specific force since the last step, by the accelerometer and by the rotors' model
  void feel(const Filter<ww_number> &f, const ww_number *accelerometer) {
    ww_number thrust = 0;
    for (int i = 0; i < 4; i++) {
      ww_number speed = f.belief.last_speeds[i];
      thrust += loop.body.k[i] * speed * speed;
    }
    samples++;
    for (int j = 0; j < 3; j++) {
      for (int i = 0; i < 3; i++) felt[j] += loop.rotation[j][i] * accelerometer[i];
      felt[3 + j] += loop.rotation[j][2] * thrust / loop.body.mass;
    }
  }

  // The kind of the law's commands, after a decision where one is due
  CommandKind decide(const ww_number *reference) {
    bool due = law != WW_HOVER && ticks % DECISION == 0;
    for (int i = 0; due && i < 6; i++) {
      if (samples > 0) mean[i] = felt[i] / ww_number(samples);
      felt[i] = 0;
    }
    if (due) samples = 0;
#ifdef WW_LQG
    if (due && law == WW_LQG) regulate(reference);
#endif
#ifdef WW_LEARNED
    if (due && law == WW_LEARNED) act(reference);
    if (law == WW_LEARNED) return KIND;
#endif
    return BESIDE;
  }

#ifdef WW_LQG
  void regulate(const ww_number *r) {
    ww_number *state = states;
    int decision = ticks / DECISION;
    for (int i = 0; i < 3; i++) {
      bool level = i < 2;
      const ww_number *A = LQG_A[i], *B = LQG_B[i], *C = LQG_C[i];
      int n = LQG_STATES[i], count = level ? 6 : 4;
      ww_number unit = level ? loop.body.gravity : ww_number(1), now = r[6 + i] / unit;
      ww_number turned = decision > 0 ? now - wanted[i] : ww_number(0);
      // the parts of force and torque that accelerate and tilt along the axis
      ww_number torque = i == 0 ? x[TORQUE + 1] : -x[TORQUE], force = x[FORCE + i];
      ww_number place = x[i] - r[i], speed = x[VELOCITY + i] - r[3 + i];
      ww_number tilt = mean[3 + i] / unit - now, gust = mean[i] - mean[3 + i];
      const ww_number both[6] = {place, speed, tilt, force, torque, gust};
      const ww_number up[4] = {place, speed, force, gust};
      const ww_number *seen = level ? both : up;
      ww_number next[STATES] = {};
      for (int a = 0; decision > 0 && a < n; a++) {
        next[a] = B[a] * command[i] - (a == 2 ? turned : ww_number(0));
        for (int b = 0; b < n; b++) next[a] += A[a * n + b] * state[b];
      }
      const ww_number *gain =
          LQG_GAINS[i] + (decision < LQG_ROWS ? decision : LQG_ROWS - 1) * n * count;
      for (int a = 0; a < n; a++) state[a] = next[a];
      for (int s = 0; s < count; s++) {
        ww_number missed = seen[s];
        for (int b = 0; b < n; b++) missed -= C[s * n + b] * next[b];
        for (int a = 0; a < n; a++) state[a] += gain[a * count + s] * missed;
      }
      ww_number wish = -LQG_AHEAD[i] * turned;
      for (int a = 0; a < n; a++) wish -= LQG_LAW[i][a] * state[a];
      command[i] = within(wish, -MOST, MOST);
      wanted[i] = now;
      state += n;
    }
  }
#endif

#ifdef WW_LEARNED
  void act(const ww_number *r) {
    ww_number a[WIDEST], b[WIDEST], *next = a;
    auto see = [&next](const ww_number *values, int count) {
      for (int i = 0; i < count; i++) *next++ = values[i];
    };
    // twice the vector part of the quaternion from upright at the reference's yaw to the estimate
    const ww_number *q = x + QUATERNION;
    ww_number c = std::cos(r[9] / 2), s = std::sin(r[9] / 2);
    ww_number sign = ww_number(c * q[0] + s * q[3] >= 0 ? 2 : -2);
    ww_number pose[9] = {};
    for (int i = 0; i < 3; i++) {
      pose[i] = r[i] - x[i];
      pose[3 + i] = r[3 + i] - x[VELOCITY + i];
    }
    pose[6] = sign * (c * q[1] + s * q[2]);
    pose[7] = sign * (c * q[2] - s * q[1]);
    pose[8] = sign * (c * q[3] - s * q[0]);
    see(pose, 9);
    see(x + RATE, 3);
    if (SEES_WRENCH) see(x + FORCE, 3), see(x + TORQUE, 3);
    if (SEES_IMU) see(mean, 6);
    see(action, 4);
    for (int i = 0; i < WIDTHS[0]; i++) {
      ww_number bounded = within(a[i], -LIMITS[i], LIMITS[i]);
      a[i] = (finite(bounded) ? bounded : ww_number(0)) / DIVISORS[i];
    }
    const ww_number *wish = through_layers(a, b);
    for (int i = 0; i < 4; i++) {
      action[i] = within(wish[i], ww_number(-1), ww_number(1));
      command[i] = AT_ZERO[i] + (action[i] < 0 ? BELOW[i] : ABOVE[i]) * action[i];
    }
  }
#endif
};

}  // namespace windwrench
