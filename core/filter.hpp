// The memory of one wrench filter. `Filter<double>` is what Python sees as a NumPy record
// (estimator/filter_record.py): the same fields in the same order.
#pragma once
#include "effects/form.hpp"
#include "rigid_body.hpp"

// room for declared effects: on the wrench, the rotors and the sensors, and numbers of each one's
// memory. An exported vehicle has room for its own effects alone
#ifndef WINDWRENCH_ROOM
#define WINDWRENCH_ROOM 16, 16, 4, 112
#endif
// 0: no memory for inertial measurements, in a filter that takes none
#ifndef WINDWRENCH_IMU
#define WINDWRENCH_IMU 1
#endif

namespace windwrench {

constexpr int ROOM[] = {WINDWRENCH_ROOM};
constexpr int WRENCHES = ROOM[0], ROTORS = ROOM[1], SENSORS = ROOM[2], MEMORY = ROOM[3];
constexpr int NOISE = 12;            // noise inputs: motor torque, torque walk, thrust, force walk
constexpr int BIASES = 6;            // of gyro rad/s and accelerometer m/s2
constexpr int COMPANIONS = 12;       // the biases, and the noise of the last step
constexpr int AGREEING_SAMPLES = 5;  // accelerometer samples in a row that make a push

// A vehicle with its effects
template <class S> struct Model {
  Body<S> body;
  VehicleNumbers<S> constants;  // for effects
  EffectModel<S> wrench_models[WRENCHES];
  S wrench_coefficients[WRENCHES][ROW];
  EffectModel<S> wrench_hooks[WRENCHES];  // carry an effect's own state; null where it has none
  int64_t wrench_count, hooked, waiting;  // waiting: the states have still to be carried
  EffectModel<S> rotor_models[ROTORS];
  S rotor_coefficients[ROTORS][PARAMETERS];
  int64_t rotor_count;
  EffectModel<S> sensing_models[SENSORS];
  S sensing_coefficients[SENSORS][PARAMETERS];
  int64_t sensing_count;
  Sample<S> sample;  // rotor speeds and pose on their way through the sensing effects
  S memory[ROTORS + SENSORS + 1][MEMORY];  // of these effects; last: delivered rotor speeds
  S time, voltage, wind[3];                // s, V, m/s
  Rotors<S> rotors;                        // delivered
  S rotor_wrench[4];                       // their thrust N and torques Nm about the centre of mass
  FlightState<S> effect_state;
  S effect_wrench[6];  // force in the world, torque in the body frame
};

enum Phase { BELIEVING, ONE_REFUSED, REFUSING };          // what became of the last poses
enum Status { TRACKING, COASTING, REJECTED, RESTARTED };  // the verdict on a measurement

// What is remembered of poses from one step to the next
template <class T> struct Poses {
  T phase;
  T strain;        // NIS, of 1 expected, of unlikely poses that were taken in; falls
  T astray;        // s for which a jump that was followed at once may have been an outlier
  T settling;      // s for which a restart may be repeated
  T judged;        // poses that the noise was learned from
  T widened[2];    // share by which more than the declared variance is taken: attitude, position
  T residual[6];   // (rho, x) of the last measurement after its correction
  T seen[7];       // pose that was believed last
  T position_age;  // s since a position was believed
  T attitude_age;
  T doubted[7];                                  // pose that was refused last
  T doubted_position_age, doubted_attitude_age;  // s
  T position_stride, attitude_stride;            // s between the last two refused; 0: not two
  T pace[6];                                     // motion of (rho, x) over that time, per second
  T agreeing;    // of those refused: how many went on from each other
  T agreed_for;  // s for which they have
  T jump[6];     // of (rho, x): what those from one to the next add up to
  T blur[6];     // what these may miss by
};

// What a filter must not forget from one step to the next
template <class T> struct Belief {
  Poses<T> poses;
  T x[STATE];
  T status, restarts;  // the verdict on the last measurement; restarts since the reset
  T excess[2];         // share by which variances of attitudes and positions exceed the declared
  T model[6];          // variances of torque and force by the vehicle's uncertainty
  T P[N][N];
  T load[7][3];      // what that uncertainty scales: vehicle_uncertainty.hpp
  T predicted[6];    // variances of torque and force before the last measurement
  T last_speeds[4];  // rad/s, measured last
};

// What a filter assumes
template <class S> struct Settings {
  int64_t gated;
  S alarm[2];           // largest NIS taken in unseen: of three numbers, of six
  S restart_at;         // NIS beyond which no linear correction is made
  S patience, give_up;  // s
  S prior[N];           // variances of what nothing is known of
  S reason[6];          // squares of torque and force beyond which none is believed
  S lost[N];            // variances beyond which what is not measured is given up
  S push[2];            // rad/s2 and m/s2, of the hardest push
  S response;           // s
  S fastest;            // rad/s, beyond which a rotor speed counts as not measured
  S motor_torque[3], torque_walk[3], thrust[3], force_walk[3];  // variances in a period
  S torque_rate[3], force_rate[3];  // 1/s, at which torque and force decay; 0: they only walk
  S noise[6], imu_noise[6];         // variances of (rho, x), of gyro and accelerometer
  S uncertain[9];                   // of the vehicle
  S kappa, period;                  // -, s
};

// An inertial measurement's biases, and the noise of the last step: imu.hpp
template <class S> struct Imu {
  int64_t used, known, refused;  // known: there was a step, whose noise is the last one
  S gate[3];                     // largest NIS of three numbers, of six, and of samples that agree
  int64_t in_row;                // accelerometer samples that the gate would refuse
  S unlikely[AGREEING_SAMPLES][3];  // m/s2, innovations of the last of them
  S doubt[2];                       // s for which a sensor was refused; negative: it was not
  S prior[BIASES], walk[BIASES];    // variances; the walk's in a period
  S bound[BIASES];                  // largest bias of a sensor of its class
  S mean[COMPANIONS];
  S regression[N][COMPANIONS];     // on the error state
  S rest[COMPANIONS][COMPANIONS];  // covariance of what that leaves
  S bias_covariance[BIASES][BIASES];
  S sensitivity[6][COMPANIONS];  // of gyro and accelerometer
};

struct NoImu {};

template <class S> struct Filter {
  Model<S> vehicle;
  Belief<S> belief;
  Settings<S> settings;
  std::conditional_t<WINDWRENCH_IMU, Imu<S>, NoImu> imu;
  S z[11];                  // a step's sample: rotor speeds rad/s, position m, quaternion
  S centre_rotation[3][3];  // attitude at the start of the last step
};

// The numbers of one lane, out of a struct of nothing but numbers of type T, or back into it
template <class T, class Many, class One> void take_lane(const Many &many, int i, One &one) {
  const T *from = reinterpret_cast<const T *>(&many);
  Single<T> *to = reinterpret_cast<Single<T> *>(&one);
  for (unsigned k = 0; k < sizeof(Many) / sizeof(T); k++) to[k] = from[k][i];
}
template <class T, class Many, class One> void put_lane(Many &many, int i, const One &one) {
  T *to = reinterpret_cast<T *>(&many);
  const Single<T> *from = reinterpret_cast<const Single<T> *>(&one);
  for (unsigned k = 0; k < sizeof(Many) / sizeof(T); k++) to[k][i] = from[k];
}

}  // namespace windwrench
