// One tick of the closed loop: plant, wrench filter and flight loop together, a vehicle that flies
// along a reference in wind.
#pragma once
#include "flight_loop.hpp"
#include "plant.hpp"
#include "ukf.hpp"
#include "wind.hpp"

namespace windwrench {

constexpr int WIND_EVERY = 2;  // ticks between two evaluations of the winds at the stations
constexpr int REFERENCE = 10;  // position m, velocity m/s, acceleration m/s2, yaw rad

// A vehicle in closed loop. `Loop<double>` begins what Python sees as a NumPy record
// (envs/closed_loop.py)
template <class T> struct Loop {
  Plant<T> plant;
  Flight<T> flight;
  Fan<T> fan;
  T action[4];              // the command, of a kind that `steer` knows
  T accelerometer_sigma;    // m/s2, a tick
  T accelerometer_bias[3];  // m/s2, body axes
  // m/s2, world, mean over the last run: specific force of the accelerometer, and of the rotors by
  // the declared model
  T specific[3], thrust[3];
};

// The winds at the stations (3, body, m) of a vehicle at a pose (7), air (3, STATIONS) m/s; points
// (3, STATIONS) m: where these are in the world
template <class S>
void winds_at(const WindCall *winds, std::int64_t count, double time, const double *pose,
              const S stations[STATIONS][3], double points[3][STATIONS], double air[3][STATIONS]) {
  double R[3][3];
  matrix_of(pose + 3, R);
  for (int i = 0; i < STATIONS; i++)
    for (int a = 0; a < 3; a++) {
      const S *s = stations[i];
      points[a][i] = pose[a] + R[a][0] * s[0] + R[a][1] * s[1] + R[a][2] * s[2];
      air[a][i] = 0.0;
    }
  add_winds(winds, count, STATIONS, time, points[0], air[0]);
}

// Add the specific force of an accelerometer in the centre of mass, in the world by the estimated
// attitude, and that of the rotors by the declared model; noise (3): unit normals
template <class T> void accelerate(Loop<T> &loop, const T *xfrc, const T *noise) {
  Plant<T> &plant = loop.plant;
  const auto &body = loop.flight.body;
  const auto &R = plant.rotation, &E = loop.flight.rotation;
  T thrust = {}, felt[3], late[3];
  for (int i = 0; i < 4; i++) thrust += body.k[i] * plant.z[i] * plant.z[i];
  for (int j = 0; j < 3; j++) {
    felt[j] = loop.accelerometer_bias[j] + loop.accelerometer_sigma * noise[j];
    for (int i = 0; i < 3; i++) felt[j] += R[i][j] * xfrc[i] / plant.vehicle.body.mass;
  }
  delay<3>(plant.past_felt, plant.imu_late, felt, late);
  for (int j = 0; j < 3; j++) {
    for (int i = 0; i < 3; i++) loop.specific[i] += E[i][j] * late[j];
    loop.thrust[j] += E[j][2] * thrust / body.mass;
  }
}

// ---- a single vehicle, in MuJoCo ---------------------------------------------------------------

// A vehicle's record in Python, and what its tick reads and writes elsewhere
struct Flying {
  Loop<double> loop;
  std::int64_t ticks;          // since the start of the episode; below zero while it settles
  std::int64_t kind;           // of the commands
  std::int64_t model_in_loop;  // whether the flight loop counters the effects of its model
  double points[3][STATIONS];  // m, world, of the stations when the winds blew last
  double air[3][STATIONS];     // m/s, world, of the winds there
  Filter<double> *filter;
  std::int64_t (*step)(Filter<double> *, std::int64_t, double, double);
  double *qpos, *qvel, *xfrc;  // (7), (6), (6): MuJoCo's pose, velocity and applied wrench
  const double *jet;           // tables of the jet's axial and radial speed
  const double *reference;  // (rows, REFERENCE), a row a tick; none: the set point moves by itself
  std::int64_t rows;
  const WindCall *winds;
  std::int64_t wind_count, blowing;  // the core's, and all with those of a user's own
  void (*mujoco_step)(void *, void *);
  void *model, *data;
};

// The unit normals of a run (count, size), a row a tick, and the fan's y and height m (rows, 2)
struct Run {
  const double *noise;
  std::int64_t count, size;
  const double *path;
  std::int64_t rows;
};

enum Stage { WIND, SENSE, ESTIMATE, STEER, ACTUATE, FEEL, MOVE, STAGES };

inline void blow(Flying &f) {
  if (f.blowing == 0 || f.ticks % WIND_EVERY != 0) return;
  double time = double(f.ticks > 0 ? f.ticks : 0) * TICK;
  winds_at(f.winds, f.wind_count, time, f.qpos, f.loop.fan.stations, f.points, f.air);
  for (int i = 0; i < STATIONS; i++)
    for (int a = 0; a < 3; a++) f.loop.fan.air[i][a] = f.air[a][i];
}

inline void estimate(Flying &f) {
  for (int i = 0; i < 11; i++) f.filter->z[i] = f.loop.plant.z[i];
  f.step(f.filter, f.loop.plant.seen, TICK, f.loop.plant.battery);
}

// The rotor speeds that fly to the reference, or to the set point where there is none
inline void steer(Flying &f) {
  Flight<double> &flight = f.loop.flight;
  Filter<double> &filter = *f.filter;
  const double *x = filter.belief.x;
  CommandKind kind = CommandKind(f.kind);
  if (f.rows > 0) {
    std::int64_t row = f.ticks < 0 ? 0 : f.ticks < f.rows ? f.ticks : f.rows - 1;
    for (int i = 0; i < REFERENCE; i++) flight.setpoint[i] = f.reference[REFERENCE * row + i];
  } else {
    move_setpoint(flight, x, TICK);
  }
  if (f.model_in_loop > 0) foresee(flight, filter.vehicle, x);
  steer(flight, x, f.loop.action, kind, TICK);
  if (f.model_in_loop > 0 && kind != ROTOR_SPEEDS) through_the_rotors(flight, filter.vehicle);
}

// An accelerometer feels the tick's wrench; its answer is a mean over the run
inline void feel(Flying &f, const Run &run, std::int64_t k) {
  Loop<double> &loop = f.loop;
  if (run.size <= PLANT_NOISE) return;
  for (int j = 0; k == 0 && j < 3; j++) loop.specific[j] = loop.thrust[j] = 0.0;
  accelerate(loop, f.xfrc, run.noise + run.size * k + PLANT_NOISE);
  for (int j = 0; k == run.count - 1 && j < 3; j++) {
    loop.specific[j] /= double(run.count);
    loop.thrust[j] /= double(run.count);
  }
}

// Run a stage of tick k of a run
inline void run_stage(Flying &f, int stage, const Run &run, std::int64_t k) {
  Loop<double> &loop = f.loop;
  const double *noise = run.noise + run.size * k;
  switch (stage) {
    case WIND:
      blow(f);
      break;
    case SENSE:
      sense(loop.plant, f.qpos, noise);
      loop.plant.seen = loop.plant.lost > 0.0 ? 0 : POSITION_PART | ATTITUDE_PART;
      break;
    case ESTIMATE:
      estimate(f);
      break;
    case STEER:
      steer(f);
      break;
    case ACTUATE: {
      const double *place = run.path + 2 * (k < run.rows ? k : run.rows - 1);
      loop.fan.y = place[0];
      loop.fan.height = place[1];
      actuate(loop.plant, loop.flight.command, loop.fan, f.jet, f.qpos, f.qvel, noise, f.xfrc);
      break;
    }
    case FEEL:
      feel(f, run, k);
      break;
    case MOVE:
      for (int i = 0; i < SUBSTEPS; i++) f.mujoco_step(f.model, f.data);
      f.ticks += 1;
      break;
  }
}

}  // namespace windwrench
