// Effects for Python: by name to their addresses, and called by these.
#include "../effects/library.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "../effects.hpp"
#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

using Numbers = Array<double, nb::shape<-1>>;
using Grid = Array<const double, nb::shape<COUNT_X, COUNT_R>>;

template <class S> struct Jet {
  S axial[COUNT_X * COUNT_R], radial[COUNT_X * COUNT_R];
};
Jet<double> jet;
Jet<float> single_jet;

void set_jet_table(Grid axial, Grid radial) {
  for (int i = 0; i < COUNT_X * COUNT_R; i++) {
    jet.axial[i] = axial.data()[i];
    jet.radial[i] = radial.data()[i];
    single_jet.axial[i] = float(jet.axial[i]);
    single_jet.radial[i] = float(jet.radial[i]);
  }
}

using Addresses = nb::typed<nb::tuple, std::uintptr_t, std::uintptr_t>;

Addresses effect_addresses(const char *name, const char *kind) {
  const LibraryEffect<double> *found = find_effect<double>(name);
  if (!found || std::strcmp(found->kind, kind) != 0) return Addresses(nb::make_tuple(0, 0));
  return Addresses(nb::make_tuple(reinterpret_cast<std::uintptr_t>(found->model),
                                  reinterpret_cast<std::uintptr_t>(found->advance)));
}

void call_effect(std::uintptr_t address, Numbers c, Numbers vehicle, Numbers third,
                 Numbers fourth) {
  reinterpret_cast<EffectModel<double>>(address)(c.data(), vehicle.data(), third.data(),
                                                 fourth.data());
}

}  // namespace

namespace windwrench {
template <> JetTable<double> jet_table<double>() { return {jet.axial, jet.radial}; }
template <> JetTable<float> jet_table<float>() { return {single_jet.axial, single_jet.radial}; }
}  // namespace windwrench

void bind_effects(nb::module_ &m) {
  m.attr("MODEL_SIZE") = sizeof(Model<double>);
  m.def("effect_addresses", &effect_addresses, "name"_a, "kind"_a,
        "Return the addresses of an effect's equation and of its `advance`, C functions of four\n"
        "arrays of doubles; 0 where the library has none of this kind: wrench, rotor input,\n"
        "sensing.");
  m.def("call_effect", &call_effect, "address"_a, "c"_a, "vehicle"_a, "third"_a, "fourth"_a,
        "Call the effect at an address with its four arrays, in place.");
  m.def("set_jet_table", &set_jet_table, "axial"_a, "radial"_a,
        "Give the effect fan_jet the axial and radial speeds (137, 151) of a jet with u0 = 1.");
  m.def(
      "drive",
      [](std::uintptr_t address, Array<const double, nb::shape<4>> speeds, double dt,
         double voltage) { drive(model_at(address), speeds.data(), dt, voltage); },
      "address"_a, "rotor_speeds"_a, "dt"_a, "voltage"_a,
      "Work out in the model at an address what its rotors deliver over dt s at the logged rotor\n"
      "speeds (4,), rad/s; voltage in V, 0 where it is not known.");
  m.def(
      "apply_effects",
      [](std::uintptr_t address, Array<const double, nb::shape<-1>> x,
         Array<const double, nb::shape<3, 3>> rotation) {
        if (x.size() < TORQUE) throw nb::value_error("x: expected 13 numbers or more");
        double R[3][3];
        for (int i = 0; i < 9; i++) R[i / 3][i % 3] = rotation.data()[i];
        apply_effects(model_at(address), x.data(), R);
      },
      "address"_a, "x"_a, "rotation"_a,
      "Write in the model at an address the wrench of its effects at a state: x begins with\n"
      "position m, quaternion, velocity m/s (world) and rate rad/s (body); rotation (3, 3) is "
      "from\n"
      "body to world.");
  m.def(
      "rewrite_sample",
      [](std::uintptr_t address, double dt, int parts, int direction) {
        rewrite_sample(model_at(address), parts, dt, direction);
      },
      "address"_a, "dt"_a, "parts"_a, "direction"_a,
      "Change rotor speeds and pose in the sample of the model at an address from truth to report\n"
      "(direction 1) or back (-1); parts: 1 position, 2 attitude, 4 rotor speeds.");
}
