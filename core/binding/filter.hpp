// What the module of an instruction set takes in, and what its files share.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "../filter.hpp"

template <class T, class... Shape>
using Array = nanobind::ndarray<T, nanobind::c_contig, nanobind::device::cpu, Shape...>;

// A call of a filter: a step's sample, which parts of the pose there are, s, V; or gyro and
// accelerometer, and which of both
struct Call {
  double z[11];
  std::int64_t parts;
  double dt, voltage;
};
constexpr int NUMBERS = 30;  // of an estimate, without its covariance

// of a register
#if defined(__AVX512F__)
constexpr int REGISTER = 64;  // bytes
#elif defined(__AVX2__)
constexpr int REGISTER = 32;
#else
constexpr int REGISTER = 16;
#endif

inline windwrench::Filter<double> &filter_at(std::uintptr_t address) {
  return *reinterpret_cast<windwrench::Filter<double> *>(address);
}

inline windwrench::Model<double> &model_at(std::uintptr_t address) {
  return *reinterpret_cast<windwrench::Model<double> *>(address);
}

template <class... Arrays> void check_rows(std::size_t count, const Arrays &...arrays) {
  if (((arrays.shape(0) != count) || ...))
    throw nanobind::value_error("expected a row for each sample");
}

void bind_batch(nanobind::module_ &m);
void bind_constant_gain(nanobind::module_ &m);
void bind_control(nanobind::module_ &m);
void bind_diagnosis(nanobind::module_ &m);
void bind_effects(nanobind::module_ &m);
void bind_filter(nanobind::module_ &m);
void bind_rotation(nanobind::module_ &m);
void bind_lanes(nanobind::module_ &m);
void bind_readers(nanobind::module_ &m);
void bind_reproduction(nanobind::module_ &m);
void bind_smoother(nanobind::module_ &m);
void bind_tick(nanobind::module_ &m);
void bind_winds(nanobind::module_ &m);
