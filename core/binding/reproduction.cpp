// The filter's relatives in the literature, for Python: memories are NumPy records, given by their
// addresses.
#include "../reproduction/extended_filter.hpp"
#include "../reproduction/observer.hpp"
#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

Observer &observer_at(std::uintptr_t address) { return *reinterpret_cast<Observer *>(address); }

std::int64_t step_extended(std::int64_t address, std::int64_t parts, double dt, double voltage) {
  return step_linearised(filter_at(std::uintptr_t(address)), int(parts), dt, voltage);
}

void start_observer(std::uintptr_t filter, std::uintptr_t observer) {
  start(filter_at(filter), observer_at(observer));
}

int step_observer(std::uintptr_t filter, std::uintptr_t observer, int parts, double dt,
                  double voltage) {
  return step(filter_at(filter), observer_at(observer), parts, dt, voltage);
}

}  // namespace

void bind_reproduction(nb::module_ &m) {
  m.attr("OBSERVER_SIZE") = sizeof(Observer);
  m.def("step_extended", &step_extended, "address"_a, "parts"_a, "dt"_a, "voltage"_a,
        "Do what `step` does with an extended Kalman filter.");
  m.def(
      "step_extended_address", [] { return reinterpret_cast<std::uintptr_t>(&step_extended); },
      "Return the address of `step_extended`: a C function with the same arguments.");
  m.def("start_observer", &start_observer, "filter"_a, "observer"_a,
        "Start an observer at the pose and twist of the state of a filter's memory.");
  m.def("step_observer", &step_observer, "filter"_a, "observer"_a, "parts"_a, "dt"_a, "voltage"_a,
        "Carry an observer dt s on, its period, with the parts (1 position, 2 attitude) of the\n"
        "sample in the filter's memory that were measured; voltage in V. Return the parts that\n"
        "could be used, or -1 if the quaternion is no rotation.");
}
