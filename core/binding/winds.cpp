// Winds and the fan's jet for Python. Their parameters are Python's: NumPy records, laid out as the
// structs of wind.hpp and fan.hpp and given by their address.
#include "../wind.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <string>

#include "../fan.hpp"
#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

using Vector = Array<const double, nb::shape<3>>;
using Tables = Array<const double, nb::shape<2, COUNT_X, COUNT_R>>;

const struct {
  const char *name;
  WindFormula formula;
  std::size_t size;  // bytes of its parameters
} FORMULAS[] = {{"steady", &blow<SteadyWind, add_steady>, sizeof(SteadyWind)},
                {"waves", &blow<PlaneWaves, add_waves>, sizeof(PlaneWaves)},
                {"jets", &blow<Jets, add_jets>, sizeof(Jets)},
                {"grid", &blow<GridWind, add_grid>, sizeof(GridWind)}};

std::uintptr_t wind_formula(const std::string &name, std::size_t size) {
  for (const auto &known : FORMULAS)
    if (name == known.name && size == known.size)
      return reinterpret_cast<std::uintptr_t>(known.formula);
  throw nb::value_error("no formula of a wind of this name with parameters of this size");
}

void add_winds_at(Array<const std::int64_t, nb::shape<-1, 2>> calls, double time,
                  Array<const double, nb::shape<3, -1>> points,
                  Array<double, nb::shape<3, -1>> velocities) {
  if (points.shape(1) != velocities.shape(1)) throw nb::value_error("a velocity for each point");
  const WindCall *winds = reinterpret_cast<const WindCall *>(calls.data());
  add_winds(winds, std::int64_t(calls.shape(0)), std::int64_t(points.shape(1)), time, points.data(),
            velocities.data());
}

void jet_at_points(std::uintptr_t fan, Tables jet, Array<const double, nb::shape<-1, 3>> points,
                   Array<double, nb::shape<-1, 3>> winds) {
  if (points.shape(0) != winds.shape(0)) throw nb::value_error("a wind for each point");
  const Fan<double> &f = *reinterpret_cast<const Fan<double> *>(fan);
  for (std::size_t n = 0; n < points.shape(0); n++)
    jet_at(f, jet.data(), points.data() + 3 * n, winds.data() + 3 * n);
}

void jet_wrench_at(std::uintptr_t fan, Tables jet, Vector position,
                   Array<const double, nb::shape<3, 3>> rotation,
                   Array<const double, nb::shape<6>> velocity, Vector com,
                   Array<double, nb::shape<6>> wrench) {
  double R[3][3];
  std::memcpy(R, rotation.data(), sizeof(R));
  jet_wrench(*reinterpret_cast<const Fan<double> *>(fan), jet.data(), position.data(), R,
             velocity.data(), com.data(), wrench.data());
}

}  // namespace

void bind_winds(nb::module_ &m) {
  m.attr("FAN_SIZE") = sizeof(Fan<double>);
  m.def(
      "wind_formula", &wind_formula, "name"_a, "size"_a,
      "Return the address of a wind's formula, steady, waves, jets or grid, whose parameters have "
      "a\n"
      "size in bytes.\n\n"
      "Raises:\n"
      "    ValueError: no formula has this name and parameters of this size.");
  m.def("add_winds", &add_winds_at, "calls"_a, "time"_a, "points"_a, "velocities"_a,
        "Add winds, addresses of formula and parameters (winds, 2), at points (3, n) m and a time "
        "in s\n"
        "to velocities (3, n) m/s, world.");
  m.def("jet_at", &jet_at_points, "fan"_a, "jet"_a, "points"_a, "winds"_a,
        "Write the mean wind (n, 3) m/s of the fan at an address at points (n, 3) m of the world;\n"
        "`jet` (2, 137, 151) are the tables of axial and radial speed.");
  m.def(
      "jet_wrench", &jet_wrench_at, "fan"_a, "jet"_a, "position"_a, "rotation"_a, "velocity"_a,
      "com"_a, "wrench"_a,
      "Write force N and torque Nm about the centre of mass (6,), world, of the wind on a vehicle "
      "in\n"
      "front of the fan at an address: position (3,) m, rotation (3, 3) from body to world, "
      "velocity\n"
      "(6,) m/s, world, and rad/s, body, centre of mass (3,) m.");
}
