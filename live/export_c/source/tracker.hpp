// Fan tracking by a particle filter on the fan's place and velocity: controllers/tracker.py.
#pragma once
#include "windwrench.h"
#include "windwrench_numbers.hpp"

namespace windwrench {

constexpr SensorModel<ww_number> MODEL = {JET, KEEP, ENTER, REGRESSION, REST};

// Random numbers of 32 bits: Marsaglia's xorshift, a stream for each use
enum Stream { DRIFT, WHETHER, KIND, FRESH, SHIFT, STREAMS };
constexpr uint32_t SEEDS[STREAMS] = {2463534242u, 1013904223u, 362436069u, 521288629u, 88675123u};

// One path that the fan may have taken
struct Particle {
  ww_number place, velocity;  // m and m/s, along y, from where the vehicle was at first
  ParticleMemory<ww_number> memory;
  ww_number log_weight, weight, drawn;
};

struct Policy {
  uint32_t random[STREAMS];
  int count;  // decisions, at most ORDER
  ww_number own, own_velocity, own_torque, yaw[3];
  Particle particles[WW_PARTICLES];

  void begin() {
    for (int i = 0; i < STREAMS; i++) random[i] = SEEDS[i];
    for (Particle &p : particles) {
      p.place = REACH * (ww_number(2) * uniform(DRIFT) - ww_number(1));
      p.velocity = fresh_velocity(uniform(KIND) < STOP);
    }
  }

  ww_number decide(const ww_estimate &e) {
    const ww_number seen[3] = {e.torque[2], e.force[0], e.force[1]};
    int order = count;
    ww_number most = -INFINITY, sum = 0, squares = 0, place = 0, velocity = 0;
    look(e);
    const OwnMotion<ww_number> motion = {own, own_velocity, yaw[2]};
    for (Particle &p : particles) {
      if (order > 0) move_fan(p);
      p.log_weight += weigh(MODEL, p.place, ww_number(1), motion, seen, order, p.memory);
      most = larger(most, p.log_weight);
    }
    for (Particle &p : particles) {
      p.log_weight -= most;
      p.weight = std::exp(p.log_weight);
      sum += p.weight;
    }
    for (Particle &p : particles) {
      p.weight /= sum;
      place += p.weight * p.place;
      velocity += p.weight * p.velocity;
      squares += p.weight * p.weight;
    }
    if (squares > ww_number(1) / (FEW * ww_number(WW_PARTICLES))) resample();
    return FEED * velocity + GAIN * (place - own) + DAMPING * (velocity - own_velocity);
  }

 private:
  // between 0 and 1, neither included
  ww_number uniform(Stream of) {
    uint32_t x = random[of];
    x ^= x << 13;
    x ^= x >> 17;
    x ^= x << 5;
    random[of] = x;
    return (ww_number(x >> 9) + ww_number(0.5)) * ww_number(1.0 / 8388608.0);
  }

  // standard normal, by Box and Muller
  ww_number normal(Stream of) {
    ww_number radius = root(ww_number(-2) * std::log(uniform(of)));
    return radius * cosine(ww_number(2) * ww_number(3.14159265) * uniform(of));
  }

  // a velocity that the fan takes all at once, m/s
  ww_number fresh_velocity(bool stops) {
    ww_number velocity = SPEED * normal(FRESH);
    return stops ? ww_number(0) : velocity;
  }

  // Carry the own motion on to this estimate
  void look(const ww_estimate &e) {
    ww_number torque = e.torque[2], velocity = e.velocity[1];
    bool first = count == 0;
    for (int n = 0; n < (first ? SETTLED : 1); n++) {
      ww_number before = first ? torque : own_torque;
      const ww_number in[5] = {yaw[0], yaw[1], yaw[2], before,
                               (torque - before) / WW_POLICY_PERIOD};
      for (int i = 0; i < 3; i++) {
        yaw[i] = 0;
        for (int j = 0; j < 5; j++) yaw[i] += YAW[i][j] * in[j];
      }
    }
    if (!first) own += ww_number(0.5) * WW_POLICY_PERIOD * (velocity + own_velocity);
    own_velocity = velocity;
    own_torque = torque;
    if (count < ORDER) count++;  // no more is asked of it
  }

  // Move a particle's fan by one decision
  void move_fan(Particle &p) {
    ww_number before = p.velocity, drift = DRIFT_STD * normal(DRIFT);
    if (before < 0 || before > 0) p.velocity += drift;
    if (uniform(WHETHER) < JUMPS) {
      ww_number kind = uniform(KIND), fresh = fresh_velocity(kind < STOP);
      p.velocity = kind >= STOP && kind < TURN ? -before : fresh;
    }
    p.place += ww_number(0.5) * WW_POLICY_PERIOD * (before + p.velocity);
  }

  // Draw the particles anew, systematically and in place: those drawn move to the front, and
  // spread out again from the last one on
  void resample() {
    ww_number shift = uniform(SHIFT), each = ww_number(1) / ww_number(WW_PARTICLES), reached = 0;
    int k = 0, kept = 0;
    for (int i = 0; i < WW_PARTICLES; i++) {
      int before = k;
      reached += particles[i].weight;
      while (k < WW_PARTICLES &&
             ((ww_number(k) + shift) * each <= reached || i == WW_PARTICLES - 1))
        k++;
      if (k > before) {
        particles[kept] = particles[i];
        particles[kept].drawn = ww_number(k - before);
        particles[kept++].log_weight = 0;
      }
    }
    while (kept-- > 0)
      for (int left = int(particles[kept].drawn); left > 0; left--)
        particles[--k] = particles[kept];
  }
};

}  // namespace windwrench
