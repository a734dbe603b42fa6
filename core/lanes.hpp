// Closed loops side by side, one to each lane of a block, without MuJoCo: its semi-implicit Euler
// step of a free rigid body is `fly_freely`.
#pragma once
#include <cstddef>

#include "batch.hpp"
#include "effects/library.hpp"
#include "episodes.hpp"
#include "normals.hpp"

namespace windwrench {

// Loops, their filters and their bodies in MuJoCo's words; `declared` is of filters with effects
template <class T> struct Block {
  Loop<T> loop;
  Belief<T> belief;
  T qpos[7], qvel[6], xfrc[6];
};

// `count` single numbers into lanes `first` to `last` of as many. What is so already is not
// written: a page of zeros, such as the memory of effects that a vehicle has not, takes no memory
template <class T>
void put_numbers(T *to, const double *from, std::size_t count, int first, int last) {
  for (std::size_t i = 0; i < count; i++)
    for (int lane = first; lane < last; lane++) {
      Single<T> now = to[i][lane], value = Single<T>(from[i]);
      if (std::memcmp(&now, &value, sizeof(now)) != 0) to[i][lane] = value;
    }
}
template <class T, class Many, class One>
void put_struct(Many &to, const One &from, int first, int last) {
  static_assert(sizeof(Many) / sizeof(T) == sizeof(One) / sizeof(double), "numbers alone");
  put_numbers<T>(reinterpret_cast<T *>(&to), reinterpret_cast<const double *>(&from),
                 sizeof(One) / sizeof(double), first, last);
}

// The functions of shipped effects in lanes, by those of single numbers; false: one is none
template <class T>
bool find_effects(const EffectModel<double> *from, std::int64_t count, bool hooks,
                  EffectModel<T> *to) {
  for (std::int64_t n = 0; n < count; n++) {
    to[n] = nullptr;
    for (int i = 0; i < LIBRARY_EFFECTS && from[n]; i++) {
      const LibraryEffect<double> &known = library<double>()[i];
      const LibraryEffect<T> &same = library<T>()[i];
      if ((hooks ? known.advance : known.model) == from[n])
        to[n] = hooks ? same.advance : same.model;
    }
    if (from[n] && !to[n]) return false;
  }
  return true;
}

// Write which effects a vehicle has into a model in lanes; false: one is a user's own
template <class T> bool lay_effects(Model<T> &to, const Model<double> &from) {
  to.wrench_count = from.wrench_count, to.hooked = from.hooked;
  to.rotor_count = from.rotor_count, to.sensing_count = from.sensing_count;
  return find_effects(from.wrench_models, from.wrench_count, false, to.wrench_models) &&
         find_effects(from.wrench_hooks, from.wrench_count, true, to.wrench_hooks) &&
         find_effects(from.rotor_models, from.rotor_count, false, to.rotor_models) &&
         find_effects(from.sensing_models, from.sensing_count, false, to.sensing_models);
}

// Let lanes of a model stand where a single one stands
template <class T> void put_model(Model<T> &to, const Model<double> &from, int first, int last) {
  to.waiting = from.waiting;
  put_struct<T>(to.body, from.body, first, last);
  put_struct<T>(to.constants, from.constants, first, last);
  put_struct<T>(to.wrench_coefficients, from.wrench_coefficients, first, last);
  put_struct<T>(to.rotor_coefficients, from.rotor_coefficients, first, last);
  put_struct<T>(to.sensing_coefficients, from.sensing_coefficients, first, last);
  constexpr std::size_t rest = sizeof(Model<double>) - offsetof(Model<double>, sample);
  put_numbers<T>(numbers_of<T>(to.sample), numbers_of<const double>(from.sample),
                 rest / sizeof(double), first, last);
}

// Let lanes of a loop stand where a single one stands
template <class T> void put_loop(Loop<T> &to, const Loop<double> &from, int first, int last) {
  using S = Single<T>;
  auto share = [](auto &common, const auto &value) {
    for (std::size_t i = 0; i < sizeof(value) / sizeof(double); i++)
      reinterpret_cast<S *>(&common)[i] = S(reinterpret_cast<const double *>(&value)[i]);
  };
  put_model(to.plant.vehicle, from.plant.vehicle, first, last);
  constexpr std::size_t rest = sizeof(from.plant) - offsetof(Plant<double>, voltage_ref);
  put_numbers<T>(&to.plant.voltage_ref, &from.plant.voltage_ref, rest / sizeof(double), first,
                 last);
  const Flight<double> &flight = from.flight;
  share(to.flight.body, flight.body);
  share(to.flight.unmixing, flight.unmixing);
  for (int i = 0; i < 12; i++) (&to.flight.omega_max)[i] = S((&flight.omega_max)[i]);
  put_numbers<T>(to.flight.setpoint, flight.setpoint, SETPOINT + 3 + 1 + 9 + 4 + 6 + 4, first,
                 last);
  const Fan<double> &fan = from.fan;
  share(to.fan.turbulence, fan.turbulence);
  share(to.fan.keep, fan.keep);
  share(to.fan.mixing, fan.mixing);
  share(to.fan.stations, fan.stations);
  to.fan.blown = fan.blown;
  put_numbers<T>(&to.fan.speed, &fan.speed, 2, first, last);
  put_numbers<T>(&to.fan.rotor_drag, &fan.rotor_drag, 2, first, last);
  put_numbers<T>(to.fan.gusts[0], fan.gusts[0], 3 * STATIONS + 1, first, last);
  put_numbers<T>(to.fan.air[0], fan.air[0], 3 * STATIONS, first, last);
  put_numbers<T>(to.action, from.action, 4 + 1 + 3 + 3 + 3, first, last);
}

// Carry free rigid bodies dt s ahead as MuJoCo's integrator "Euler" does: velocities first, by
// explicit Euler, and with these new ones the pose
template <class T> void fly_freely(Block<T> &b, Single<T> dt) {
  Plant<T> &plant = b.loop.plant;
  const T none[6] = {};
  T x[STATE] = {}, a[6], q[4];
  for (int i = 0; i < 3; i++) {
    x[RATE + i] = b.qvel[3 + i];
    x[TORQUE + i] = b.xfrc[3 + i];
    x[FORCE + i] = b.xfrc[i];
  }
  matrix_of(b.qpos + 3, plant.rotation);
  accelerations(plant.vehicle.body, plant.rotation, x, none, none, a);
  for (int i = 0; i < 6; i++) b.qvel[i] += dt * a[i];
  for (int i = 0; i < 3; i++) b.qpos[i] += dt * b.qvel[i];
  turn_body(b.qpos + 3, b.qvel + 3, dt, q);
  normalise(q);
  for (int i = 0; i < 4; i++) b.qpos[3 + i] = q[i];
}

// What the loops of blocks have in common
template <class S> struct Common {
  Filter<S> filter;  // like each of theirs
  const S *jet;      // tables of the jet's axial and radial speed
  bool follows;      // whether the set point is a row of the reference, or moves by itself
  CommandKind kind;  // of the commands
  bool moves;        // whether commands are velocities of the set point
  const std::int64_t *places;  // (actions) of the commands in the set point, or in the action
  bool model_in_loop;
  std::int64_t size;  // unit normals of a tick
};

// Fly a tick: the stages of a single loop, and then the rigid body. declared: the filters' effects,
// or null; noise (size): unit normals
template <class T>
void tick(Block<T> &b, Model<T> *declared, const Common<Single<T>> &c, const T *noise) {
  using S = Single<T>;
  Loop<T> &loop = b.loop;
  Plant<T> &plant = loop.plant;
  Flight<T> &flight = loop.flight;
  sense(plant, b.qpos, noise);
  T z[11];
  for (int i = 0; i < 11; i++)
    z[i] = i < 4 ? plant.z[i] : choose(plant.lost > T{}, T{} + S(NAN), plant.z[i]);
  step_lanes(c.filter, b.belief, z, declared, plant.battery);
  const T *x = b.belief.x;
  bool counters = c.model_in_loop && declared;
  if (!c.follows) move_setpoint(flight, x, S(TICK));
  if (counters) foresee(flight, *declared, x);
  steer(flight, x, loop.action, c.kind, S(TICK));
  if (counters && c.kind != ROTOR_SPEEDS) through_the_rotors(flight, *declared);
  actuate(plant, flight.command, loop.fan, c.jet, b.qpos, b.qvel, noise, b.xfrc);
  if (c.size > PLANT_NOISE) accelerate(loop, b.xfrc, noise + PLANT_NOISE);
  for (int i = 0; i < SUBSTEPS; i++) fly_freely(b, S(TICK / SUBSTEPS));
}

// The air of n episodes: winds (n, columns) and how many each has (n); streams (n) of its noise
struct Weather {
  const WindCall *winds;
  std::int64_t columns;
  const std::int64_t *counts;
  const Stream *streams;
  const Ziggurat *ziggurat;
};

// Fly a block for so many ticks. members (lanes): the episode in each lane; -1: no flight, no draws
template <class T>
void fly_block(Block<T> &b, Model<T> *declared, const Common<Single<T>> &c,
               const std::int64_t *members, Episodes &e, std::int64_t ticks, const Weather &air) {
  using S = Single<T>;
  Loop<T> &loop = b.loop;
  T normals[PLANT_NOISE + ACCELEROMETER_NOISE] = {};
  for (int lane = 0; lane < lanes_of<T>; lane++)
    for (std::int64_t n = members[lane], i = 0; n >= 0 && i < e.actions; i++) {
      T *commanded = c.moves ? loop.flight.setpoint : loop.action;
      commanded[c.places[i]][lane] = S(e.commands[e.actions * n + i]);
    }
  for (int j = 0; j < 3; j++) loop.specific[j] = loop.thrust[j] = T{};
  for (std::int64_t k = 0; k < ticks; k++) {
    for (int lane = 0; lane < lanes_of<T>; lane++) {
      std::int64_t n = members[lane];
      if (n < 0) continue;
      std::int64_t now = e.ticks[n] + k, row;
      loop.fan.y[lane] = S(e.paths[e.path_rows * n + row_at(now, e.path_rows)]);
      loop.fan.height[lane] = S(e.heights[e.height_rows * n + row_at(now, e.height_rows)]);
      row = e.reference_rows * n + row_at(now, e.reference_rows);
      for (int i = 0; c.follows && i < REFERENCE; i++)
        loop.flight.setpoint[i][lane] = S(e.references[REFERENCE * row + i]);
      if (air.counts[n] > 0 && now % WIND_EVERY == 0) {
        double pose[7], points[3][STATIONS], flow[3][STATIONS];
        for (int i = 0; i < 7; i++) pose[i] = double(b.qpos[i][lane]);
        winds_at(air.winds + air.columns * n, air.counts[n], double(now > 0 ? now : 0) * TICK, pose,
                 loop.fan.stations, points, flow);
        for (int i = 0; i < STATIONS; i++)
          for (int a = 0; a < 3; a++) loop.fan.air[i][a][lane] = S(flow[a][i]);
      }
      draw_normals(*air.ziggurat, air.streams[n], c.size, numbers_of<S>(normals) + lane,
                   lanes_of<T>);
    }
    tick(b, declared, c, normals);
  }
  for (int lane = 0; lane < lanes_of<T>; lane++)
    if (members[lane] >= 0) e.ticks[members[lane]] += ticks;
  for (int j = 0; j < 3; j++) loop.specific[j] /= S(ticks), loop.thrust[j] /= S(ticks);
}

constexpr double LARGEST = 1e10;  // beyond it MuJoCo starts over

// Let the body in a lane start over where a number is too large or not finite, as MuJoCo does;
// return whether it does
template <class T> bool start_over(Block<T> &b, int lane) {
  bool whole = true;
  for (int i = 0; i < 7; i++) whole = whole && absolute(double(b.qpos[i][lane])) <= LARGEST;
  for (int i = 0; i < 6; i++) whole = whole && absolute(double(b.qvel[i][lane])) <= LARGEST;
  for (int i = 0; i < 7 && !whole; i++) b.qpos[i][lane] = Single<T>(i == 3 ? 1 : 0);
  for (int i = 0; i < 6 && !whole; i++) b.qvel[i][lane] = Single<T>(0);
  return !whole;
}

}  // namespace windwrench
