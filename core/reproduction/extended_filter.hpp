// The error-state extended Kalman filter on the wrench filter's model: its covariance goes on by
// F P F' + B Q B', with the Jacobian F of the model at the estimate.
#pragma once
#include "../linear_model.hpp"
#include "../ukf.hpp"

namespace windwrench {

inline void predict_linearised(Filter<double> &f, const double *speeds, double dt, double voltage) {
  Model<double> &m = f.vehicle;
  Belief<double> &b = f.belief;
  double R[3][3], a[6], centre[STATE], A[12][N], B[6][N];
  WrenchWalk<double> walk(f.settings, dt);
  drive(m, speeds, dt, voltage);
  matrix_of(b.x + QUATERNION, R);
  apply_effects(m, b.x, R);
  step_accelerations(m.body, b.x, R, m.rotor_wrench, m.effect_wrench, dt, a);
  move(m.body, b.x, R, m.rotor_wrench, m.effect_wrench, dt, centre);
  decay_wrench(walk, centre);
  model_jacobian(m, b.x, R, a + 3, dt, true, A);
  carry_by_jacobian(walk, A, b.P);
  noise_inputs(m.body, f.settings, R, dt, B);
  add_noise(m.body, walk, B, b.P);
  symmetrise<N>(b.P);
  for (int i = 0; i < NIS; i++) b.x[i] = centre[i];
  b.x[NIS] = NAN;
  after_prediction(f.settings, dt, b);
  m.time += dt;
}

// `step` of the wrench filter, linearised
inline int step_linearised(Filter<double> &f, int parts, double dt, double voltage) {
  int usable = check_sample(f.settings, f.belief, f.z, parts);
  if (usable < 0) return usable;
  const double *sample = true_sample(f, usable, dt);
  Innovation<double> n;
  if (dt > 0) predict_linearised(f, sample, dt, voltage);
  correct_parts(f, sample, usable, n);
  return usable;
}

}  // namespace windwrench
