// How external torque and force change by themselves: an Ornstein-Uhlenbeck process, dw = -w rate
// dt + noise, or a random walk where the rate is zero.
#pragma once
#include "filter.hpp"

namespace windwrench {

// Over a step: w becomes decay w plus noise
template <class S> struct WrenchWalk {
  S decay[6];     // of torque and force, world
  S variance[6];  // that the step adds, Nm2 and N2

  WrenchWalk() = default;
  WrenchWalk(const Settings<S> &s, S dt) {
    S periods = dt / s.period;
    for (int i = 0; i < 3; i++) {
      decay[i] = decay[3 + i] = S(1);
      variance[i] = periods * s.torque_walk[i];
      variance[3 + i] = periods * s.force_walk[i];
      tie(s.torque_rate[i] * dt, i);
      tie(s.force_rate[i] * dt, 3 + i);
    }
  }

 private:
  // the decay, and the variance by the integral of exp(-2 rate t) over the step; passed: rate dt
  void tie(S passed, int i) {
    if (!(passed > S(0))) return;
    decay[i] = std::exp(-passed);
    variance[i] *= -std::expm1(S(-2) * passed) / (S(2) * passed);
  }
};

}  // namespace windwrench
