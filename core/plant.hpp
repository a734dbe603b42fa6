// The plant: a quadrotor with real motors, real sensing and effects that nobody declared. One tick
// is one sample of the motion capture. The motors follow their commands; rotors, effects, jet and
// unmodelled disturbance make a wrench for the tick.
#pragma once
#include "effects.hpp"
#include "fan.hpp"

namespace windwrench {

constexpr double TICK = 0.005;  // s
constexpr int SUBSTEPS = 2;     // of the rigid body in a tick
constexpr int KEPT = 21;        // ticks of what is kept for later
// unit normals that one tick uses: pose, disturbance, gusts, dropout; and of an accelerometer
enum {
  POSE_NOISE = 0,
  DISTURBANCE_NOISE = 6,
  GUST_NOISE = 12,
  DROPOUT_NOISE = 12 + 3 * STATIONS,
  PLANT_NOISE,
  ACCELEROMETER_NOISE = 3
};

// The plant's memory. `Plant<double>` is what Python sees as a NumPy record (envs/plant.py)
template <class T> struct Plant {
  Model<T> vehicle;
  int64_t seen;  // parts of the last pose that were measured
  T voltage_ref, battery_life;
  T battery;                         // V now; 0: not modelled
  T motor_keep;                      // share of a speed's difference to its command after a tick
  T omega_lsb;                       // rad/s
  T sigma_position, sigma_attitude;  // m, rad
  T disturbance_force, disturbance_torque, disturbance_keep;
  T applied[6];  // a user's part of `external`, until changed
  T omega_max;   // rad/s
  // a unit normal below loses the pose: after a pose, and after a lost one
  T dropout, dropout_kept;
  T lost;                                // 1: the last pose was lost
  T actuator_late, pose_late, imu_late;  // ticks
  T speeds[4];                           // of the motors, rad/s
  T z[11];  // the sample: logged rotor speeds of the last tick, position, quaternion
  T disturbance[6];
  T external[6];  // true external force and torque about the centre of mass, world
  T jet[6];       // the jet's part of it
  T rotation[3][3];
  // the last ticks, the newest first: rad/s; m and quaternion; m/s2, body
  T past_commands[KEPT][4], past_poses[KEPT][7], past_felt[KEPT][3];
};

// Write `now` (WIDTH) of so many ticks ago into `late`, and keep it
template <int WIDTH, class T> void delay(T past[KEPT][WIDTH], T ticks, const T *now, T *late) {
  bool any_late = any(ticks > T{});
  for (int i = 0; i < WIDTH; i++) {
    late[i] = now[i];
    if (!any_late) continue;
    for (int j = KEPT - 1; j > 0; j--) {
      past[j][i] = past[j - 1][i];
      late[i] = choose(ticks == T{} + Single<T>(j), past[j][i], late[i]);
    }
    past[0][i] = now[i];
  }
}

// Write a pose (7) and its noise into p.z. The attitude comes with a non-negative scalar part, as
// from a real system: a vehicle facing -x sees its quaternion's sign flip several times a second
template <class T> void measure(Plant<T> &p, const T *pose, const T *noise) {
  using S = Single<T>;
  T rho[3], turn[4], one = T{} + S(1);
  for (int i = 0; i < 3; i++) {
    p.z[4 + i] = pose[i] + p.sigma_position * noise[POSE_NOISE + i];
    rho[i] = S(0.25) * p.sigma_attitude * noise[POSE_NOISE + 3 + i];
  }
  quaternion_of(rho, turn);
  multiply(turn, pose + 3, p.z + 7);
  normalise(p.z + 7);
  T sign = choose(p.z[7] < T{}, -one, one);
  for (int i = 7; i < 11; i++) p.z[i] *= sign;
}

// Write motion capture's present sample into p.z, and whether it is lost into p.lost; losses come
// in runs. Sensing effects change the true pose (7) before its noise comes on
template <class T> void sense(Plant<T> &p, const T *pose, const T *noise) {
  using S = Single<T>;
  Model<T> &m = p.vehicle;
  T *reported = m.sample.position;  // and the quaternion behind it
  delay<7>(p.past_poses, p.pose_late, pose, reported);
  rewrite_sample(m, 1 | 2, S(0), +1);
  measure(p, reported, noise);
  T bound = choose(p.lost > T{}, p.dropout_kept, p.dropout);
  p.lost = choose(noise[DROPOUT_NOISE] < bound, T{} + S(1), T{});
}

// Let the motors follow their commands (4) rad/s for one tick
template <class T> void follow(Plant<T> &p, const T *command) {
  T late[4];
  delay<4>(p.past_commands, p.actuator_late, command, late);
  for (int i = 0; i < 4; i++) {
    T speed = late[i] + p.motor_keep * (p.speeds[i] - late[i]);
    p.speeds[i] = smaller(larger(speed, T{}), p.omega_max);
  }
}

// Write rotor speeds (4) rad/s into p.z, rounded as in the log
template <class T> void log_speeds(Plant<T> &p, const T *speeds) {
  using S = Single<T>;
  auto whole = p.omega_lsb == T{};
  T lsb = choose(whole, T{} + S(1), p.omega_lsb);
  for (int i = 0; i < 4; i++)
    p.z[i] = choose(whole, speeds[i], lsb * rounded_down(speeds[i] / lsb + S(0.5)));
}

// Let the battery age by one tick under the rotors' load: its voltage falls by a tenth over the
// battery's life, and by a twentieth under twice the hover load
template <class T> void drain(Plant<T> &p) {
  using S = Single<T>;
  if (!any(p.voltage_ref > T{})) return;
  const auto &body = p.vehicle.body;
  T load = {};
  for (int i = 0; i < 4; i++) load += body.k[i] * p.speeds[i] * p.speeds[i];
  T full = S(1.05) - S(0.1) * p.vehicle.time / p.battery_life -
           S(0.05) * (load / (body.mass * body.gravity) - S(1));
  p.battery += S(0.05) * (full * p.voltage_ref - p.battery);
}

// Let the gusts age by one tick, and write the jet's wrench at p.rotation into p.jet
template <class T>
void blow(Plant<T> &p, Fan<T> &fan, const Single<T> *jet, const T *qpos, const T *qvel,
          const T *noise) {
  bool blows = any(fan.speed > T{});
  if (blows) gust(fan, noise + GUST_NOISE);
  if (blows || fan.blown > 0)
    jet_wrench(fan, jet, qpos, p.rotation, qvel, p.vehicle.body.com, p.jet);
}

// Let the unmodelled disturbance age by one tick
template <class T> void disturb(Plant<T> &p, const T *noise) {
  T fresh = root(Single<T>(1) - p.disturbance_keep * p.disturbance_keep);
  for (int i = 0; i < 6; i++) {
    T size = i < 3 ? p.disturbance_force : p.disturbance_torque;
    T kept = p.disturbance_keep * p.disturbance[i];
    p.disturbance[i] = kept + fresh * size * noise[DISTURBANCE_NOISE + i];
  }
}

// Write the wrench on the vehicle at p.rotation into xfrc (6), world, and its external part into
// p.external
template <class T> void add_up(Plant<T> &p, T *xfrc) {
  const auto &R = p.rotation;
  const Model<T> &m = p.vehicle;
  for (int i = 0; i < 3; i++) {
    p.external[i] = m.effect_wrench[i] + p.jet[i] + p.disturbance[i] + p.applied[i];
    xfrc[i] = p.external[i] + R[i][2] * m.rotor_wrench[0];
    T torque = {};
    for (int j = 0; j < 3; j++) torque += R[i][j] * m.effect_wrench[3 + j];
    p.external[3 + i] = torque + p.jet[3 + i] + p.disturbance[3 + i] + p.applied[3 + i];
    xfrc[3 + i] = p.external[3 + i];
    for (int j = 0; j < 3; j++) xfrc[3 + i] += R[i][j] * m.rotor_wrench[1 + j];
  }
}

// Let the motors follow their commands (4) rad/s for one tick, and write the tick's wrench into
// xfrc (6); qpos (7) and qvel (6): MuJoCo's pose and velocity, world, with the body's rate
template <class T>
void actuate(Plant<T> &p, const T *command, Fan<T> &fan, const Single<T> *jet, const T *qpos,
             const T *qvel, const T *noise, T *xfrc) {
  using S = Single<T>;
  Model<T> &m = p.vehicle;
  T x[STATE];
  for (int i = 0; i < 7; i++) x[i] = qpos[i];
  for (int i = 0; i < 6; i++) x[VELOCITY + i] = qvel[i];
  follow(p, command);
  for (int i = 0; i < 4; i++) m.sample.speed[i] = p.speeds[i];
  rewrite_sample(m, 4, S(TICK), +1);
  log_speeds(p, m.sample.speed);
  drain(p);
  drive(m, p.speeds, S(TICK), p.battery);
  matrix_of(qpos + 3, p.rotation);
  apply_effects(m, x, p.rotation);
  blow(p, fan, jet, qpos, qvel, noise);
  disturb(p, noise);
  add_up(p, xfrc);
  m.time += S(TICK);
}

}  // namespace windwrench
