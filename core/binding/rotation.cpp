// Rotations for Python.
#include "../rotation.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

template <int SIZE>
using Given = nb::ndarray<const double, nb::c_contig, nb::device::cpu, nb::shape<SIZE>>;
template <int... SIZES>
using Out = nb::ndarray<double, nb::c_contig, nb::device::cpu, nb::shape<SIZES...>>;

void write_matrix(Given<4> q, Out<3, 3> out) {
  double R[3][3];
  windwrench::matrix_of(q.data(), R);
  for (int i = 0; i < 9; i++) out.data()[i] = R[i / 3][i % 3];
}
void write_product(Given<4> a, Given<4> b, Out<4> out) {
  windwrench::multiply(a.data(), b.data(), out.data());
}
void write_quaternion(Given<3> rho, Out<4> out) {
  windwrench::quaternion_of(rho.data(), out.data());
}
void write_error(Given<4> q, Given<4> reference, Out<3> out) {
  windwrench::attitude_error(q.data(), reference.data(), out.data());
}
void write_turned(Given<4> q, Given<3> rate, double dt, Out<4> out) {
  windwrench::turn_body(q.data(), rate.data(), dt, out.data());
}

}  // namespace

void bind_rotation(nb::module_ &m) {
  m.def("matrix_of", &write_matrix, "q"_a, "out"_a,
        "Write the matrix (3, 3) from body to world of a quaternion (4,).");
  m.def("multiply", &write_product, "a"_a, "b"_a, "out"_a,
        "Write Hamilton's product a * b (4,) of two quaternions; out is neither of them.");
  m.def("quaternion_of", &write_quaternion, "rho"_a, "out"_a,
        "Write the quaternion (4,) of modified Rodrigues parameters (3,).");
  m.def("attitude_error", &write_error, "q"_a, "reference"_a, "out"_a,
        "Write the modified Rodrigues parameters (3,), world, that take a quaternion to q.");
  m.def("turn_body", &write_turned, "q"_a, "rate"_a, "dt"_a, "out"_a,
        "Write q turned at a body rate (3,), rad/s, for dt s.");
}
