// The module of one instruction set. `windwrench._core` chooses one when it is imported.
#include <nanobind/nanobind.h>

#include "filter.hpp"

namespace nb = nanobind;

NB_MODULE(WINDWRENCH_MODULE, m) {
  m.doc() = "The compiled core: what is computed at every step.";
  m.def(
      "instruction_set", [] { return WINDWRENCH_INSTRUCTION_SET; },
      "Return the instruction set that the core was built for: baseline, avx2 or avx512.");
  bind_batch(m);
  bind_constant_gain(m);
  bind_control(m);
  bind_diagnosis(m);
  bind_effects(m);
  bind_filter(m);
  bind_rotation(m);
  bind_lanes(m);
  bind_readers(m);
  bind_reproduction(m);
  bind_smoother(m);
  bind_tick(m);
  bind_winds(m);
}
