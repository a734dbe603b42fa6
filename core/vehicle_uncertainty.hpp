// Variances of torque and force by the vehicle's own uncertainty: estimator/model_uncertainty.py
// says why they add to the output and leave the filter alone.
#pragma once
#include "wrench_walk.hpp"

namespace windwrench {

// out (6): variances of torque and force at followed loads
template <class T> void load_variances(const Single<T> *factors, const T load[7][3], T *out) {
  using S = Single<T>;
  S mass = factors[0], thrust = factors[1], command = factors[2], arm = factors[3];
  S reaction = factors[4], inertia = factors[5], yy = factors[6], xx = factors[7], xy = factors[8];
  for (int i = 0; i < 3; i++) {
    T ax = load[0][i], ay = load[1][i], t = load[2][i], w = load[3][i];
    T a = load[4][i], z = load[5][i], turning = load[6][i];
    out[i] = arm * a * a + reaction * z * z + command * (a + z) * (a + z) +
             inertia * turning * turning + (yy * ax * ax + xx * ay * ay - S(2) * xy * ax * ay);
    out[3 + i] = mass * w * w + (thrust + command) * t * t;
  }
}

// share of the variance of torque or force number i that the corrections since the last prediction
// took away
template <class T> T taken_in(const WrenchWalk<Single<T>> &walk, Belief<T> &f, int i) {
  T before = f.predicted[i], now = f.P[12 + i][12 + i];
  f.predicted[i] = walk.decay[i] * walk.decay[i] * now + walk.variance[i];
  return choose(now < before, Single<T>(1) - now / before, T{});
}

// Follow the loads of a prediction at the attitude R, with P before the prediction:
// rows are thrust along body x, y (times an arm a torque) and z, the force that moves the mass (N),
// torques of the rotors about body x and y, about z, and all torques (Nm)
template <class T, class E6>
void follow_loads(const Settings<Single<T>> &s, const WrenchWalk<Single<T>> &walk, const T R[3][3],
                  const T *rotors, const E6 *effects, Belief<T> &f) {
  T(*load)[3] = f.load;
  for (int i = 0; i < 3; i++) {
    T turn = taken_in(walk, f, i), push = taken_in(walk, f, 3 + i);
    T thrust = R[i][2] * rotors[0], across = R[i][0] * rotors[1] + R[i][1] * rotors[2];
    T around = R[i][2] * rotors[3];
    T of_effects = R[i][0] * effects[3] + R[i][1] * effects[4] + R[i][2] * effects[5];
    load[0][i] += turn * (R[i][0] * rotors[0] - load[0][i]);
    load[1][i] += turn * (R[i][1] * rotors[0] - load[1][i]);
    load[2][i] += push * (thrust - load[2][i]);
    load[3][i] += push * (thrust + f.x[FORCE + i] + effects[i] - load[3][i]);
    load[4][i] += turn * (across - load[4][i]);
    load[5][i] += turn * (around - load[5][i]);
    load[6][i] += turn * (across + around + of_effects + f.x[TORQUE + i] - load[6][i]);
    for (int row = 0; row < 7; row++)  // a wrench that a wrong vehicle makes decays like any other
      load[row][i] *= walk.decay[row == 2 || row == 3 ? 3 + i : i];
  }
  load_variances<T>(s.uncertain, load, f.model);
}

}  // namespace windwrench
