// The smoother, and the likelihood of a flight's poses, for Python.
#include "../smoother.hpp"

#include <vector>

#include "../innovations.hpp"
#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

using Bytes = Array<const std::uint8_t, nb::shape<-1>>;
using Rows = Array<double, nb::shape<-1, -1>>;
using Deviations = Array<double, nb::shape<-1, N>>;
using Matrix = Array<double, nb::shape<N, N>>;
using GivenMatrix = Array<const double, nb::shape<N, N>>;

// A smoothed estimate into a row: numbers, with the covariance if there is room, and deviations
void write_smoothed(std::uintptr_t address, long row, Rows numbers, Deviations std) {
  const Belief<double> &b = filter_at(address).belief;
  double *to = numbers.data() + long(numbers.shape(1)) * row;
  for (int i = 0; i < STATE; i++) to[i] = b.x[i];
  for (int i = 0; i < 6; i++) to[NUMBERS - 6 + i] = b.model[i];
  for (int i = 0; i < N; i++) {
    double variance = (1.0 + b.poses.strain) * b.P[i][i];
    std.data()[N * row + i] = root(variance);
    for (int j = 0; long(numbers.shape(1)) > NUMBERS && j < N; j++)
      to[NUMBERS + N * i + j] = i == j ? variance : b.P[i][j];
  }
}

void smooth_block(std::uintptr_t memory, std::uintptr_t smoothed, Bytes calls, Rows numbers,
                  Deviations std) {
  Filter<double> &f = filter_at(memory);
  Belief<double> &last = filter_at(smoothed).belief;
  const Call *call = reinterpret_cast<const Call *>(calls.data());
  long count = long(calls.size() / sizeof(Call));
  std::vector<Link<double>> links(1 + count);
  std::vector<double> strains(count);
  begin_links(f.belief, links[0]);
  for (long k = 0; k < count; k++) {
    for (int i = 0; i < 11; i++) f.z[i] = call[k].z[i];
    step_with_link(f, int(call[k].parts), call[k].dt, call[k].voltage, links[1 + k]);
    const Belief<double> &b = f.belief;
    strains[k] = b.poses.strain;
    const double rest[4] = {b.status, b.restarts, b.excess[0], b.excess[1]};
    for (int i = 0; i < 4; i++) numbers.data()[long(numbers.shape(1)) * k + STATE + i] = rest[i];
  }
  for (long k = count - 1; k >= 0; k--) {
    last.poses.strain = larger(last.poses.strain, strains[k]);
    load_variances(f.settings.uncertain, last.load, last.model);
    write_smoothed(smoothed, k, numbers, std);
    go_back(f.settings, links[k], links[1 + k], call[k].dt, last);
  }
}

void link_between(GivenMatrix P, GivenMatrix C, GivenMatrix after, Matrix G, Matrix K) {
  double turned[N][N];
  for (int i = 0; i < N * N; i++) turned[i % N][i / N] = C.data()[i];
  link_back(reinterpret_cast<const double (*)[N]>(P.data()), turned,
            reinterpret_cast<const double (*)[N]>(after.data()),
            reinterpret_cast<double (*)[N]>(G.data()), reinterpret_cast<double (*)[N]>(K.data()));
}

void judge_rows(std::uintptr_t address, Bytes rows, double log_inlier, double log_outlier,
                Array<std::uint8_t, nb::shape<-1>> out) {
  Filter<double> &f = filter_at(address);
  const FlightRow *row = reinterpret_cast<const FlightRow *>(rows.data());
  PoseLikelihood *found = reinterpret_cast<PoseLikelihood *>(out.data());
  std::size_t count = rows.size() / sizeof(FlightRow);
  if (out.size() != count * sizeof(PoseLikelihood)) throw nb::value_error("judge_rows: sizes");
  nb::gil_scoped_release others_run;
  for (std::size_t k = 0; k < count; k++) judge_row(f, row[k], log_inlier, log_outlier, found[k]);
}

void variances_along(Array<const double, nb::shape<9>> factors,
                     Array<const double, nb::shape<-1, 7, 3>> loads,
                     Array<double, nb::shape<-1, 6>> out) {
  for (std::size_t k = 0; k < loads.shape(0); k++)
    load_variances(factors.data(), reinterpret_cast<const double (*)[3]>(loads.data() + 21 * k),
                   out.data() + 6 * k);
}

}  // namespace

void bind_smoother(nb::module_ &m) {
  m.attr("FLIGHT_ROW_SIZE") = sizeof(FlightRow);
  m.attr("INNOVATION_SIZE") = sizeof(PoseLikelihood);
  m.def("smooth_block", &smooth_block, "memory"_a, "smoothed"_a, "calls"_a, "numbers"_a, "std"_a,
        "Make calls, bytes of the record CALL (n,), of the filter at the address `memory`, and go\n"
        "back from the smoothed estimate after them to the one before, both at the address\n"
        "`smoothed`. Write numbers (n, 30 or 354) and standard deviations (n, 18) of each.");
  m.def("write_smoothed", &write_smoothed, "address"_a, "row"_a, "numbers"_a, "std"_a,
        "Write the smoothed estimate at an address into a row of numbers and deviations.");
  m.def("link_back", &link_between, "P"_a, "C"_a, "after"_a, "G"_a, "K"_a,
        "Write the smoother's gain, transposed, and the covariance of the estimate before, given\n"
        "the one after, from P before a prediction, cross covariance C and P after; all (18, 18).");
  m.def("judge_rows", &judge_rows, "address"_a, "rows"_a, "log_inlier"_a, "log_outlier"_a, "out"_a,
        "Carry a filter along bytes of the record ROW (n,), and write those of INNOVATION (n,).\n"
        "Logarithms of the chance of a pose that is no outlier, and of an outlier's density.");
  m.def("variances_along", &variances_along, "factors"_a, "loads"_a, "out"_a,
        "Write the variances (n, 6) of torque and force by the vehicle's uncertainty, at loads\n"
        "(n, 7, 3).");
}
