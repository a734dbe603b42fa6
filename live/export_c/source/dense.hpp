// A trained policy of dense layers on a history of frames: controllers/trained_policy.py.
#pragma once
#include "windwrench.h"
#include "windwrench_numbers.hpp"

namespace windwrench {

struct Policy {
  int count;  // decisions for which the command has been held
  ww_number frames[HISTORY][FRAME], command;

  void begin() {}

  ww_number decide(const ww_estimate &e) {
    if (count > 0 && count < REPEAT) {
      count++;
      return command;
    }
    bool first = count == 0;
    count = 1;
    look(e, first);
    ww_number a[WIDEST], b[WIDEST];
    for (int k = 0; k < HISTORY; k++)
      for (int i = 0; i < FRAME; i++) a[k * FRAME + i] = frames[k][i];
    command = through_layers(a, b)[0];
    return command;
  }

 private:
  // Put an estimate's frame at the history's end; at first the history is full of it
  void look(const ww_estimate &e, bool first) {
    const ww_number seen[8] = {e.force[0],  e.force[1],  e.force[2],    e.torque[0],
                               e.torque[1], e.torque[2], e.velocity[1], command};
    for (int i = 0; i < FRAME; i++) {
      ww_number now = smaller(larger(seen[PLACES[i]] / SCALES[i], ww_number(-10)), ww_number(10));
      for (int k = 0; k + 1 < HISTORY; k++) frames[k][i] = first ? now : frames[k + 1][i];
      frames[HISTORY - 1][i] = now;
    }
  }
};

}  // namespace windwrench
