// The wrench filter: an unscented Kalman filter over pose, twist and external wrench of a
// quadrotor.
//
// McKinnon and Schoellig, Unscented External Force and Torque Estimation for Quadrotors, IROS 2016,
// (15)-(37); estimator/reference.py is the readable text.
#pragma once
#include "correction.hpp"
#include "prediction.hpp"

namespace windwrench {

enum Part { POSITION_PART = 1, ATTITUDE_PART = 2, SPEED_PART = 4 };  // of a sample

// The parts of a sample z (11), rotor speeds rad/s, position m and quaternion, that can be used; -1
// if the quaternion is no rotation. Rotor speeds that no vehicle has become the last ones that one
// may have; the quaternion is brought to length 1
template <class S> int check_sample(const Settings<S> &s, Belief<S> &f, S *z, int parts) {
  int usable = 0;
  if ((parts & POSITION_PART) && finite(z[4] + z[5] + z[6])) usable |= POSITION_PART;
  if (parts & ATTITUDE_PART) {
    S square = z[7] * z[7] + z[8] * z[8] + z[9] * z[9] + z[10] * z[10];
    if (finite(square)) {
      if (square < S(0.81) || square > S(1.21)) return -1;
      S scale = S(1) / root(square);
      for (int i = 7; i < 11; i++) z[i] *= scale;
      usable |= ATTITUDE_PART;
    }
  }
  for (int i = 0; i < 4; i++) {
    if (!(absolute(z[i]) <= s.fastest)) z[i] = f.last_speeds[i];
    f.last_speeds[i] = z[i];
  }
  return usable;
}

// The checked parts of the sample f.z as they were before the declared sensing effects, in
// f.vehicle.sample. Rotor speeds count where dt is positive. Where the attitude was not measured,
// the estimated one stands in for it
template <class S> const S *true_sample(Filter<S> &f, int parts, S dt) {
  S *sample = numbers_of<S>(f.vehicle.sample);
  for (int i = 0; i < 11; i++) sample[i] = f.z[i];
  if (f.vehicle.sensing_count > 0) {
    if (!(parts & ATTITUDE_PART))
      for (int i = 0; i < 4; i++) sample[7 + i] = f.belief.x[QUATERNION + i];
    undo_sensing(f.vehicle, dt > S(0) ? parts | SPEED_PART : parts, dt);
  }
  return sample;
}

// The pose of a new estimate as it was before the declared sensing effects
template <class S> void undo_first_pose(Filter<S> &f) {
  if (f.vehicle.sensing_count == 0) return;
  S *pose = numbers_of<S>(f.vehicle.sample) + 4;
  for (int i = 0; i < 7; i++) pose[i] = f.belief.x[i];
  undo_sensing(f.vehicle, POSITION_PART | ATTITUDE_PART, S(0));
  for (int i = 0; i < 7; i++) f.belief.x[i] = pose[i];
}

// Carry the filter dt s ahead at rotor speeds (4) rad/s: (18)-(27)
template <class S> void predict(Filter<S> &f, const S *speeds, S dt, S voltage, Prediction<S> &w) {
  Model<S> &m = f.vehicle;
  drive(m, speeds, dt, voltage);
  if (m.wrench_count == 0) carry(m.body, f.settings, m.rotor_wrench, dt, f.belief, w);
  else carry_with_effects(m.body, m, f.settings, dt, f.belief, w);
  after_prediction(f.settings, dt, f.belief);
  for (int i = 0; i < 3; i++)
    for (int j = 0; j < 3; j++) f.centre_rotation[i][j] = w.R[i][j];
  m.time += dt;
}

// Correct with the checked parts of a sample: (29)-(37)
template <class S> void correct_parts(Filter<S> &f, const S *sample, int parts, Innovation<S> &n) {
  if (parts)
    correct(f.settings, f.belief, sample + 4, (parts & POSITION_PART) != 0,
            (parts & ATTITUDE_PART) != 0, n);
}

// Predict over dt s if that is positive, then correct with the parts of f.z that were measured.
// Returns the parts that could be used, or -1, with the filter as it was, if the quaternion is no
// rotation; leaves the innovation in n
template <class S> int step(Filter<S> &f, int parts, S dt, S voltage, Innovation<S> &n) {
  int usable = check_sample(f.settings, f.belief, f.z, parts);
  if (usable < 0) return usable;
  const S *sample = true_sample(f, usable, dt);
  if (dt > S(0)) {
    Prediction<S> w;
    predict(f, sample, dt, voltage, w);
  }
  correct_parts(f, sample, usable, n);
  return usable;
}

// Step lanes of filters of one vehicle, `of` being like each of them, over a period: z (11) rotor
// speeds, position and quaternion, NaN where nothing was measured; model: the vehicle's effects in
// lanes, at a voltage in V, or null
template <class T>
void step_lanes(const Filter<Single<T>> &of, Belief<T> &f, T *z, Model<T> *model = nullptr,
                T voltage = T{}) {
  using S = Single<T>;
  const Settings<S> &s = of.settings;
  T scale = S(1) / root(z[7] * z[7] + z[8] * z[8] + z[9] * z[9] + z[10] * z[10]);
  for (int i = 7; i < 11; i++) z[i] *= scale;
  for (int i = 0; i < 4; i++) {
    z[i] = choose(absolute(z[i]) <= T{} + s.fastest, z[i], f.last_speeds[i]);
    f.last_speeds[i] = z[i];
  }
  auto position = finite(z[4] + z[5] + z[6]), attitude = finite(z[7] + z[8] + z[9] + z[10]);
  T rotors[4];
  Prediction<T> w;
  if (model && model->sensing_count > 0) {
    T one = T{} + S(1), *sample = numbers_of<T>(model->sample);
    for (int i = 0; i < 7; i++) sample[i] = z[i];
    for (int i = 0; i < 4; i++) sample[7 + i] = choose(attitude, z[7 + i], f.x[QUATERNION + i]);
    rewrite_sample(*model, choose(position, one, T{}), choose(attitude, one, T{}), one, s.period,
                   -1);
    for (int i = 0; i < 11; i++) z[i] = sample[i];
  }
  if (model) drive(*model, z, s.period, voltage);
  if (model && model->wrench_count > 0) {
    carry_with_effects(of.vehicle.body, *model, s, s.period, f, w);
  } else {
    if (!model) rotor_wrench(of.vehicle.body, z, rotors);
    carry(of.vehicle.body, s, model ? model->rotor_wrench : rotors, s.period, f, w);
  }
  after_prediction(s, s.period, f);
  if (model) model->time += s.period;
  Innovation<T> n;
  correct(s, f, z + 4, position, attitude, n);
}

}  // namespace windwrench
