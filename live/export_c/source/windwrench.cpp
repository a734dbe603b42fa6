// The wrench filter of one vehicle behind the C functions of windwrench.h. Its numbers are in
// windwrench_numbers.hpp, its equations in core/.
#include "windwrench.h"

#include <string.h>

#include "windwrench_numbers.hpp"

#ifdef WW_POLICY_PERIOD
#include "policy.hpp"
#endif
#ifdef WW_HOVER
#include "flight.hpp"
#endif

#ifdef __FAST_MATH__
#error "-ffast-math knows no NaN, which marks what was not measured"
#endif

using namespace windwrench;

namespace {

using S = ww_number;

#if WW_IMU
struct Flying {
#else
struct Flying : Steady {
  int64_t steady;  // whether the constant gain holds
  S near;          // s for which the covariance has been near that of the gain
#endif
  Filter<S> filter;
  S voltage;    // V, 0: not known
  S lost_time;  // s that rounding took off the sum of the steps
};
static_assert(sizeof(Flying) <= sizeof(ww_filter), "ww_filter has room for the filter");

Flying &flying(ww_filter *memory) { return *reinterpret_cast<Flying *>(memory); }
const Flying &flying(const ww_filter *memory) { return *reinterpret_cast<const Flying *>(memory); }

bool measured(const S *values, int count) {
  bool known = values != nullptr;
  for (int i = 0; known && i < count; i++) known = finite(values[i]);
  return known;
}

void copy(const S *from, S *to, int count) {
  for (int i = 0; i < count; i++) to[i] = from[i];
}

// One call of the core: predict over dt s if that is positive, and correct with parts of the pose
int call(Flying &of, int parts, S dt) {
#if WW_IMU
  Filter<S> &f = of.filter;
  Innovation<S> innovation;
  return f.imu.used ? step_with_biases(f, parts, dt, of.voltage, innovation)
                    : step(f, parts, dt, of.voltage, innovation);
#else
  return step(of, parts, dt, of.voltage);
#endif
}

}  // namespace

extern "C" {

int ww_init(ww_filter *memory, const S *position, const S *quaternion) {
  if (!measured(position, 3) || !measured(quaternion, 4)) return WW_BAD_POSE;
  S square = S(0);
  for (int i = 0; i < 4; i++) square += quaternion[i] * quaternion[i];
  if (!(square >= S(0.81) && square <= S(1.21))) return WW_BAD_QUATERNION;
  memset(memory, 0, sizeof *memory);
  Flying &of = flying(memory);
  Filter<S> &f = of.filter;
  of.voltage = FULL_BATTERY;
  begin_vehicle(f.vehicle);
  f.settings = SETTINGS;
  copy(position, f.belief.x, 3);
  for (int i = 0; i < 4; i++) f.belief.x[QUATERNION + i] = quaternion[i] / root(square);
  undo_first_pose(f);
  f.belief.x[NIS] = S(NAN);
  copy(f.belief.x, f.belief.poses.seen, 7);
  copy(FIRST_VARIANCES + 12, f.belief.predicted, 6);
  for (int i = 0; i < 4; i++) f.belief.last_speeds[i] = HOVER_SPEED;
#if WW_IMU
  for (int i = 0; i < N; i++) f.belief.P[i][i] = FIRST_VARIANCES[i];
  copy(IMU_GATE, f.imu.gate, 3);
  copy(IMU_PRIOR, f.imu.prior, BIASES);
  copy(IMU_WALK, f.imu.walk, BIASES);
  copy(IMU_BOUND, f.imu.bound, BIASES);
  forget_biases(f.imu);
#else
  of.steady = 1;
  copy(Steady::converged[0], f.belief.P[0], N * N);
#endif
  return 0;
}

void ww_set_voltage(ww_filter *memory, S volts) {
  flying(memory).voltage = finite(volts) ? volts : S(0);
}

int ww_predict(ww_filter *memory, const S *rotor_speeds, S dt) {
  if (!(dt > S(0)) || !finite(dt)) return WW_BAD_TIME;
  Flying &of = flying(memory);
  Filter<S> &f = of.filter;
  S time = f.vehicle.time;
  copy(rotor_speeds, f.z, 4);
  call(of, 0, dt);
  if (sizeof(S) < sizeof(double)) {  // a float loses a share of a small step
    S step = dt - of.lost_time;
    f.vehicle.time = time + step;
    of.lost_time = (f.vehicle.time - time) - step;
  }
  return int(f.belief.status);
}

int ww_correct_pose(ww_filter *memory, const S *position, const S *quaternion) {
  Flying &of = flying(memory);
  Filter<S> &f = of.filter;
  int parts =
      (measured(position, 3) ? POSITION_PART : 0) | (measured(quaternion, 4) ? ATTITUDE_PART : 0);
  copy(f.belief.last_speeds, f.z, 4);
  if (parts & POSITION_PART) copy(position, f.z + 4, 3);
  if (parts & ATTITUDE_PART) copy(quaternion, f.z + 7, 4);
  if (parts && call(of, parts, S(0)) < 0) return WW_BAD_QUATERNION;
  return int(f.belief.status);
}

#if WW_IMU
int ww_correct_imu(ww_filter *memory, const S *gyro, const S *accelerometer) {
  Filter<S> &f = flying(memory).filter;
  bool with_gyro = measured(gyro, 3), with_accelerometer = measured(accelerometer, 3);
  S z[6] = {};
  if (with_gyro) copy(gyro, z, 3);
  if (with_accelerometer) copy(accelerometer, z + 3, 3);
  if (!f.imu.used) begin_imu(f);
  take_in_imu(f, z, with_gyro, with_accelerometer);
  return int(f.belief.status);
}
#else
int ww_correct_imu(ww_filter *, const S *, const S *) { return WW_NO_IMU; }
#endif

void ww_get(const ww_filter *memory, ww_estimate *out) {
  const Filter<S> &f = flying(memory).filter;
  const Belief<S> &b = f.belief;
  S variances[N];
  S *deviations[6] = {out->std_attitude, out->std_angular_velocity, out->std_position,
                      out->std_velocity, out->std_torque,           out->std_force};
  for (int i = 0; i < N; i++) variances[i] = b.P[i][i];
  if (is_doubted(b.poses)) add_doubt(f.settings, b, variances);
  for (int i = 0; i < N; i++) {
    S variance = i < 12 ? variances[i] : variances[i] + b.model[i - 12];
    S turn = i < 3 ? S(4) : S(1);  // an MRP is a quarter of an angle
    deviations[i / 3][i % 3] = turn * root(larger(variance, S(0)));
  }
  copy(b.x, out->position, 3);
  copy(b.x + QUATERNION, out->quaternion, 4);
  copy(b.x + VELOCITY, out->velocity, 3);
  copy(b.x + RATE, out->angular_velocity, 3);
  copy(b.x + TORQUE, out->torque, 3);
  copy(b.x + FORCE, out->force, 3);
  out->nis = b.x[NIS];
  out->status = int(b.status);
  out->restarts = unsigned(b.restarts);
  out->noise_scale = root(S(1) + S(0.5) * (b.excess[0] + b.excess[1]));
  out->dead_reckoning = larger(b.poses.position_age, b.poses.attitude_age);
#if WW_IMU
  copy(f.imu.mean, out->gyro_bias, 3);
  copy(f.imu.mean + 3, out->accelerometer_bias, 3);
  for (int i = 0; i < 3; i++) {
    out->std_gyro_bias[i] = root(f.imu.bias_covariance[i][i]);
    out->std_accelerometer_bias[i] = root(f.imu.bias_covariance[3 + i][3 + i]);
  }
  out->imu_refused = unsigned(f.imu.refused);
#endif
}

#ifdef WW_POLICY_PERIOD
static_assert(sizeof(Policy) <= sizeof(ww_policy_memory), "ww_policy_memory has room");

void ww_policy_init(ww_policy_memory *memory) {
  memset(memory, 0, sizeof *memory);
  reinterpret_cast<Policy *>(memory)->begin();
}

S ww_policy(ww_policy_memory *memory, const ww_estimate *estimate) {
  S command = reinterpret_cast<Policy *>(memory)->decide(*estimate);
  return smaller(MAX_COMMAND, larger(-MAX_COMMAND, command));
}
#endif

#ifdef WW_HOVER
static_assert(sizeof(Pilot) <= sizeof(ww_flight), "ww_flight has room");

void ww_flight_init(ww_flight *memory) {
  memset(memory, 0, sizeof *memory);
  begin_flight(reinterpret_cast<Pilot *>(memory)->loop);
}

int ww_fly(ww_flight *memory, ww_filter *filter, int law, const S *reference,
           const S *accelerometer, S *rotor_speeds) {
  if (law != WW_HOVER && !(LAWS >> law & 1)) return WW_NO_LAW;
  if (!measured(reference, 10)) return WW_BAD_REFERENCE;
  Pilot &pilot = *reinterpret_cast<Pilot *>(memory);
  const S *felt = measured(accelerometer, 3) ? accelerometer : nullptr;
  pilot.fly(flying(filter).filter, law, reference, felt);
  copy(pilot.loop.command, rotor_speeds, 4);
  return 0;
}
#endif

}  // extern "C"
