// The flight loop and the trackers' inner loop for Python. The flight loop's memory is Python's: a
// NumPy record, laid out as `Flight<double>` (controllers/flight.py), given by its address.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "../flight_loop.hpp"
#include "../tracker.hpp"
#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

template <nb::ssize_t SIZE> using Numbers = Array<const double, nb::shape<SIZE>>;

Flight<double> &flight_at(std::uintptr_t address) {
  return *reinterpret_cast<Flight<double> *>(address);
}

void move_setpoint_at(std::uintptr_t flight, Numbers<3> position, double dt) {
  move_setpoint(flight_at(flight), position.data(), dt);
}

void steer_at(std::uintptr_t flight, Numbers<STATE> x, Numbers<4> command, int kind, double dt) {
  steer(flight_at(flight), x.data(), command.data(), CommandKind(kind), dt);
}

void foresee_at(std::uintptr_t flight, std::uintptr_t model, Numbers<STATE> x) {
  foresee(flight_at(flight), model_at(model), x.data());
}

void through_the_rotors_at(std::uintptr_t flight, std::uintptr_t model) {
  through_the_rotors(flight_at(flight), model_at(model));
}

template <class Row, class Given> const Row *rows(const Given &given) {
  return reinterpret_cast<const Row *>(given.data());
}

void weigh_particles(Numbers<-1> place, Numbers<-1> level, Array<double, nb::shape<-1, 21>> memory,
                     Numbers<3> own, Numbers<AXES> seen,
                     Array<const double, nb::shape<MAP_COUNT, 4, AXES>> tables,
                     Array<const double, nb::shape<AXES, 3, 3>> keep,
                     Array<const double, nb::shape<AXES, 3>> enter,
                     Array<const double, nb::shape<ORDER + 1, AXES, ORDER>> regression,
                     Array<const double, nb::shape<ORDER + 1, AXES>> variance,
                     std::int64_t decision, Array<double, nb::shape<-1>> out) {
  std::size_t count = out.shape(0);
  if (place.shape(0) != count || level.shape(0) != count || memory.shape(0) != count)
    throw nb::value_error("weigh: expected a row for each particle");
  const SensorModel<double> model = {rows<double[4][AXES]>(tables), rows<double[3][3]>(keep),
                                     rows<double[3]>(enter), rows<double[AXES][ORDER]>(regression),
                                     rows<double[AXES]>(variance)};
  const OwnMotion<double> motion = {own.data()[0], own.data()[1], own.data()[2]};
  auto *particles = reinterpret_cast<ParticleMemory<double> *>(memory.data());
  for (std::size_t i = 0; i < count; i++)
    out.data()[i] =
        weigh(model, place.data()[i], level.data()[i], motion, seen.data(), decision, particles[i]);
}

}  // namespace

void bind_control(nb::module_ &m) {
  m.attr("FLIGHT_SIZE") = sizeof(Flight<double>);
  m.def(
      "move_setpoint", &move_setpoint_at, "flight"_a, "position"_a, "dt"_a,
      "Move the set point of the flight loop at an address with its own velocity for dt s; on an\n"
      "axis where it runs too far ahead of the position (3,) m it waits.");
  m.def("steer", &steer_at, "flight"_a, "x"_a, "command"_a, "kind"_a, "dt"_a,
        "Fly a command (4,) of a kind in the estimated state x (20,), and write the rotor speeds "
        "into\n"
        "the flight loop at an address.");
  m.def("foresee", &foresee_at, "flight"_a, "model"_a, "x"_a,
        "Write the wrench of the effects of the model at an address, for the rotors to balance, "
        "into\n"
        "the flight loop at an address; x (20,) is the estimated state.");
  m.def("through_the_rotors", &through_the_rotors_at, "flight"_a, "model"_a,
        "Turn the rotor speeds commanded by the flight loop at an address into commands that "
        "deliver\n"
        "them by the model at an address.");
  m.def(
      "weigh", &weigh_particles, "place"_a, "level"_a, "memory"_a, "own"_a, "seen"_a, "tables"_a,
      "keep"_a, "enter"_a, "regression"_a, "variance"_a, "decision"_a, "out"_a,
      "Write the log-likelihood of an observation for each particle into out (n,), and carry its\n"
      "memory (n, 21) on: places (n,) m of the fan, levels (n,) of the noise, the vehicle's own "
      "place\n"
      "m, velocity m/s and yaw rate rad/s, the estimated torque and forces (3,), and a tracker's\n"
      "tables; at the first decision, 0, the filter has settled on the jet where it is.");
}
