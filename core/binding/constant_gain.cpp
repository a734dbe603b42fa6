// The filter with a constant gain, and the model that filters share, for Python.
#include "../constant_gain.hpp"

#include <nanobind/stl/optional.h>

#include "../imu.hpp"
#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

using State = Array<const double, nb::shape<STATE>>;

std::int64_t step_with_gain(std::int64_t address, std::int64_t parts, double dt, double voltage) {
  auto &c = *reinterpret_cast<ConstantGain<double> *>(std::uintptr_t(address));
  return step(c, int(parts), dt, voltage);
}

void hold_still(std::uintptr_t address, Array<const double, nb::shape<11>> z, int steps,
                double voltage) {
  Filter<double> &f = filter_at(address);
  nb::gil_scoped_release others_run;
  for (int k = 0; k < steps; k++) {
    Innovation<double> n;
    for (int i = 0; i < 11; i++) f.z[i] = z.data()[i];
    step(f, 3, f.settings.period, voltage, n);
  }
}

void hover_jacobian(std::uintptr_t address, double voltage, Array<double, nb::shape<6, N>> out) {
  jacobian_at_hover(filter_at(address), voltage, reinterpret_cast<double (*)[N]>(out.data()));
}

void drive_at(std::uintptr_t address, Array<const double, nb::shape<4>> speeds, double dt,
              double voltage) {
  drive(filter_at(address).vehicle, speeds.data(), dt, voltage);
}

void move_from(std::uintptr_t address, State x, double dt, Array<double, nb::shape<STATE>> out,
               std::optional<Array<double, nb::shape<12, N>>> jacobian) {
  Model<double> &m = filter_at(address).vehicle;
  WrenchWalk<double> walk(filter_at(address).settings, dt);
  double R[3][3], a[6];
  matrix_of(x.data() + QUATERNION, R);
  apply_effects(m, x.data(), R);
  step_accelerations(m.body, x.data(), R, m.rotor_wrench, m.effect_wrench, dt, a);
  move(m.body, x.data(), R, m.rotor_wrench, m.effect_wrench, dt, out.data());
  decay_wrench(walk, out.data());
  if (jacobian)
    model_jacobian(m, x.data(), R, a + 3, dt, true,
                   reinterpret_cast<double (*)[N]>(jacobian->data()));
}

void expected_imu_at(std::uintptr_t address, State x, Array<double, nb::shape<6>> out) {
  expected_imu(filter_at(address), x.data(), out.data());
}

}  // namespace

void bind_constant_gain(nb::module_ &m) {
  m.attr("CONSTANT_GAIN_SIZE") = sizeof(ConstantGain<double>);
  m.def("step_with_gain", &step_with_gain, "address"_a, "parts"_a, "dt"_a, "voltage"_a,
        "Do what `step` does with a filter whose gain is constant in steady flight.");
  m.def(
      "step_with_gain_address", [] { return reinterpret_cast<std::uintptr_t>(&step_with_gain); },
      "Return the address of `step_with_gain`: a C function with the same arguments.");
  m.def("hold_still", &hold_still, "address"_a, "z"_a, "steps"_a, "voltage"_a,
        "Step a filter through periods with one sample (11,), rotor speeds and pose.");
  m.def("hover_jacobian", &hover_jacobian, "address"_a, "voltage"_a, "out"_a,
        "Write the derivatives (6, 18) of angular (body) and linear acceleration by the error\n"
        "state of a filter that hovers at its last rotor speeds; voltage in V.");
  m.def("drive", &drive_at, "address"_a, "speeds"_a, "dt"_a, "voltage"_a,
        "Let the rotors of a filter's model deliver over dt s at logged speeds (4,), rad/s.");
  m.def(
      "move", &move_from, "address"_a, "x"_a, "dt"_a, "out"_a, "jacobian"_a.none() = nb::none(),
      "Write the state (20,) that follows x (20,) after dt s by a filter's model, as driven, and\n"
      "the first 12 rows (12, 18) of the Jacobian of its error state less the identity.");
  m.def("expected_imu", &expected_imu_at, "address"_a, "x"_a, "out"_a,
        "Write what gyro, rad/s, and accelerometer, m/s2, would measure (6,) without bias in a\n"
        "state x (20,), as driven.");
}
