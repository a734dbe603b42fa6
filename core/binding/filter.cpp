// The wrench filter for Python. A filter's memory is Python's: a NumPy record, laid out as
// `Filter<double>` at its beginning (estimator/filter_record.py), given by its address.
#include "filter.hpp"

#include <nanobind/stl/optional.h>

#include "../constant_gain.hpp"
#include "../imu.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

using Sample = Array<const double, nb::shape<6>>;
using Variances = Array<double, nb::shape<N>>;

int step_filter(Filter<double> &f, int parts, double dt, double voltage, Innovation<double> &n) {
  return f.imu.used ? step_with_biases(f, parts, dt, voltage, n) : step(f, parts, dt, voltage, n);
}

std::int64_t step_at(std::int64_t address, std::int64_t parts, double dt, double voltage) {
  Innovation<double> n;
  return step_filter(filter_at(std::uintptr_t(address)), int(parts), dt, voltage, n);
}

// The same; a pose's whitened innovation is left in the record
std::int64_t step_and_tell(std::uintptr_t address, int parts, double dt, double voltage) {
  Innovation<double> n;
  int used = step_filter(filter_at(address), parts, dt, voltage, n);
  auto &record = *reinterpret_cast<ConstantGain<double> *>(address);
  for (int i = 0; used > 0 && i < 6; i++) record.innovation[i] = n.y[i];
  return used;
}

void take_in_imu_at(std::uintptr_t address, Sample z, bool gyro, bool accelerometer) {
  Filter<double> &f = filter_at(address);
  if (!f.imu.used) begin_imu(f);
  take_in_imu(f, z.data(), gyro, accelerometer);
}

void forget_biases_at(std::uintptr_t address) { forget_biases(filter_at(address).imu); }

void start(std::uintptr_t address) {
  Filter<double> &f = filter_at(address);
  forget_biases(f.imu);
  f.imu.refused = 0;
  undo_first_pose(f);
}

void add_doubt_at(std::uintptr_t address, Variances variances) {
  const Filter<double> &f = filter_at(address);
  add_doubt(f.settings, f.belief, variances.data());
}

enum { GYRO = 4, ACCELEROMETER = 8 };  // beside the parts of a pose

// an estimate's numbers (30), and its variances (18), widened by refused and unlikely poses
void write_estimate(const Filter<double> &f, double *numbers, double *variances) {
  const Belief<double> &b = f.belief;
  const double rest[10] = {b.status,   b.restarts, b.excess[0], b.excess[1], b.model[0],
                           b.model[1], b.model[2], b.model[3],  b.model[4],  b.model[5]};
  for (int i = 0; i < STATE; i++) numbers[i] = b.x[i];
  for (int i = STATE; i < NUMBERS; i++) numbers[i] = rest[i - STATE];
  for (int i = 0; i < N; i++) variances[i] = b.P[i][i];
  if (is_doubted(b.poses)) add_doubt(f.settings, b, variances);
}

std::size_t make_calls(std::uintptr_t address, Array<const std::uint8_t, nb::shape<-1>> calls,
                       Array<const std::int64_t, nb::shape<-1>> rows,
                       Array<double, nb::shape<-1, -1>> numbers,
                       Array<double, nb::shape<-1, N>> std,
                       Array<double, nb::shape<-1, 7, 3>> loads,
                       std::optional<Array<double, nb::shape<-1, 12>>> innovations) {
  Innovation<double> n = {};
  Filter<double> &f = filter_at(address);
  const Call *call = reinterpret_cast<const Call *>(calls.data());
  std::size_t count = calls.size() / sizeof(Call);
  for (std::size_t k = 0; k < count; k++) {
    bool gyro = (call[k].parts & GYRO) != 0, accelerometer = (call[k].parts & ACCELEROMETER) != 0;
    for (int i = 0; i < 11; i++) f.z[i] = call[k].z[i];
    if (gyro || accelerometer) {
      if (!f.imu.used) begin_imu(f);
      take_in_imu(f, f.z, gyro, accelerometer);
    } else if (step_filter(f, int(call[k].parts), call[k].dt, call[k].voltage, n) < 0) {
      return k;
    }
    std::int64_t row = rows.data()[k];
    for (int i = 0; innovations && i < 6; i++) {
      innovations->data()[12 * row + i] = n.y[i];
      innovations->data()[12 * row + 6 + i] = n.L[i][i];
    }
    double *deviations = std.data() + N * row;
    write_estimate(f, numbers.data() + std::int64_t(numbers.shape(1)) * row, deviations);
    for (int i = 0; i < N; i++) deviations[i] = root(deviations[i]);
    for (int i = 0; i < 21; i++) loads.data()[21 * row + i] = f.belief.load[i / 3][i % 3];
  }
  return count;
}

void step_many(std::uintptr_t address, std::size_t stride, Array<const double, nb::shape<-1, 11>> z,
               int parts, double dt, Array<const double, nb::shape<-1>> voltage,
               Array<double, nb::shape<-1, NUMBERS>> numbers,
               Array<double, nb::shape<-1, N>> variances) {
  nb::gil_scoped_release others_run;
  for (std::size_t n = 0; n < z.shape(0); n++) {
    Filter<double> &f = filter_at(address + n * stride);
    Innovation<double> innovation;
    for (int i = 0; i < 11; i++) f.z[i] = z.data()[11 * n + i];
    step(f, parts, dt, voltage.data()[n], innovation);
    write_estimate(f, numbers.data() + NUMBERS * n, variances.data() + N * n);
  }
}

}  // namespace

void bind_filter(nb::module_ &m) {
  m.attr("FILTER_SIZE") = sizeof(Filter<double>);
  m.def(
      "step", &step_and_tell, "address"_a, "parts"_a, "dt"_a, "voltage"_a,
      "Predict the filter at an address over dt s if that is positive, then correct with the\n"
      "parts (1 position, 2 attitude) of the sample in its memory that were measured; voltage in\n"
      "V. The memory then also has the pose's whitened innovation.\n\n"
      "Return the parts that could be used, or -1, with the filter as it was, if the quaternion\n"
      "is no rotation.");
  m.def(
      "step_address", [] { return reinterpret_cast<std::uintptr_t>(&step_at); },
      "Return the address of `step` for compiled loops: a C function with the same arguments.");
  m.def("forget_biases", &forget_biases_at, "address"_a,
        "Give the biases of gyro and accelerometer their prior.");
  m.def("start", &start, "address"_a,
        "Start at the pose in the memory: without an inertial measurement, and as the pose was "
        "before\n"
        "the declared sensing effects.");
  m.def("take_in_imu", &take_in_imu_at, "address"_a, "z"_a, "gyro"_a, "accelerometer"_a,
        "Correct with the measured parts of z (6,): gyro, rad/s, and accelerometer, m/s2, body.");
  m.def("add_doubt", &add_doubt_at, "address"_a, "variances"_a,
        "Widen an estimate's variances (18,) by refused and unlikely poses, in place.");
  m.def(
      "step_many", &step_many, "address"_a, "stride"_a, "z"_a, "parts"_a, "dt"_a, "voltage"_a,
      "numbers"_a, "variances"_a,
      "Step filters one after the other, the first at an address and each so many bytes after the\n"
      "last: samples (n, 11), dt in s, voltage (n,) V; estimates (n, 30) and variances (n, 18),\n"
      "written.");
  m.def("make_calls", &make_calls, "address"_a, "calls"_a, "rows"_a, "numbers"_a, "std"_a,
        "loads"_a, "innovations"_a.none() = nb::none(),
        "Make calls of a filter, bytes of the record CALL (n,), and write the results into the row "
        "of\n"
        "each: numbers (N, 30 or more) and standard deviations (N, 18) of an estimate, and the "
        "loads\n"
        "(N, 7, 3) of the vehicle's uncertainty; innovations (N, 12): whitened, of the last "
        "measured\n"
        "pose, and the diagonal of the root of its covariance. Return the number of calls up to a\n"
        "quaternion that is no rotation.");
}
