// Fan tracking with lead, u = -(gain x + rate_gain dx/dt) with x = tau_z / f_x: Lead in
// controllers/fan_laws.py.
#pragma once
#include "windwrench.h"
#include "windwrench_numbers.hpp"

namespace windwrench {

struct Policy {
  int started;
  ww_number last;

  void begin() {}

  ww_number decide(const ww_estimate &e) {
    ww_number ratio = e.torque[2] / larger(e.force[0], LEAST_FORCE);
    ww_number rate = started ? (ratio - last) / WW_POLICY_PERIOD : ww_number(0);
    started = 1;
    last = ratio;
    return -(GAIN * ratio + RATE_GAIN * rate);
  }
};

}  // namespace windwrench
