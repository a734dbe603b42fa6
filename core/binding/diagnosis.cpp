// What a diagnosis computes at each row of a log, for Python. A model's memory is Python's: a NumPy
// record, laid out as `Model<double>` at its beginning, given by its address.
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include "../diagnosis/causal_filter.hpp"
#include "../diagnosis/evidence.hpp"
#include "../diagnosis/flights.hpp"
#include "../diagnosis/smoothing.hpp"
#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

template <int... SHAPE> using In = Array<const double, nb::shape<SHAPE...>>;
template <int... SHAPE> using Out = Array<double, nb::shape<SHAPE...>>;
template <int... SHAPE> using Ints = Array<const std::int64_t, nb::shape<SHAPE...>>;
using Bools = Array<const bool, nb::shape<-1>>;

// an array as rows of numbers, or of rows
template <class T, nb::ssize_t W> auto rows(const Array<T, nb::shape<-1, W>> &array) {
  return reinterpret_cast<T(*)[W]>(array.data());
}
template <class T, nb::ssize_t V, nb::ssize_t W>
auto rows(const Array<T, nb::shape<-1, V, W>> &array) {
  return reinterpret_cast<T(*)[V][W]>(array.data());
}

LoggedRotors rotors_of(const In<-1, 4> &speeds, const In<-1> &voltage) {
  check_rows(speeds.shape(0), voltage);
  return {std::int64_t(speeds.shape(0)), rows(speeds), voltage.data()};
}

void write_acting_wrench(std::uintptr_t model, double period, In<-1, 4> speeds, In<-1> voltage,
                         In<-1, 3> position, In<-1, 3, 3> rotation, In<-1, 3> velocity,
                         In<-1, 3> rate, In<-1, 3> turning, double mass, In<3, 3> inertia,
                         Out<-1, 6> out) {
  check_rows(speeds.shape(0), position, rotation, velocity, rate, turning, out);
  LoggedMotion flown = {rows(position), rows(rotation), rows(velocity), rows(rate), rows(turning)};
  acting_wrench(model_at(model), period, rotors_of(speeds, voltage), flown, mass,
                reinterpret_cast<const double (*)[3]>(inertia.data()), rows(out));
}

void undo_sensing_of(std::uintptr_t model, In<-1> t, Bools seen, Out<-1, 11> samples) {
  check_rows(t.size(), seen, samples);
  undo_log_sensing(model_at(model), std::int64_t(t.size()), t.data(), seen.data(), rows(samples));
}

void write_prediction(std::uintptr_t model, In<-1> t, In<-1, 4> speeds, In<-1> voltage,
                      In<-1, FLOWN> states, Ints<-1> starts, double period, Bools aloft,
                      double spread, bool keeps_velocity, In<-1> reaction,
                      Out<-1, -1, FLOWN> path) {
  check_rows(t.size(), speeds, states, aloft);
  check_rows(starts.size(), path);
  for (std::size_t k = 0; k < starts.size(); k++)
    if (starts.data()[k] < 0 || std::size_t(starts.data()[k]) + 1 >= t.size())
      throw nb::value_error("predict_flight: expected a row behind each start");
  if (reaction.size() != 0 && reaction.size() != REACTIONS)
    throw nb::value_error("predict_flight: expected 9 numbers of a reaction, or none");
  auto *loop = reaction.size() ? reinterpret_cast<const LoopReaction *>(reaction.data()) : nullptr;
  predict_flight(model_at(model), rotors_of(speeds, voltage), t.data(), rows(states), starts.data(),
                 std::int64_t(starts.size()), period, aloft.data(), spread, keeps_velocity, loop,
                 std::int64_t(path.shape(1)), reinterpret_cast<double (*)[FLOWN]>(path.data()));
}

void choose_states(Ints<-1> last, Bools posed, In<-1, -1> numbers, In<-1, 12> innovations,
                   Out<-1, FLOWN> states, Out<-1> best) {
  check_rows(last.size(), states, best);
  check_rows(posed.size(), numbers, innovations);
  choose_likeliest(std::int64_t(last.size()), last.data(), posed.data(), numbers.data(),
                   std::int64_t(numbers.shape(1)), rows(innovations), rows(states), best.data());
}

void run_causal_filter(std::uintptr_t model, double period, In<-1, 4> speeds, In<-1> voltage,
                       In<-1, 3> position, In<-1, 4> quaternion, In<6> begun, In<6, 3, 2> gain,
                       In<6> keep, In<-1, 6, 3> known, Out<-1, 3> at_position,
                       Out<-1, 3, 3> at_rotation, Out<-1, 3> at_velocity, Out<-1, 3> at_rate,
                       Out<-1, 6> acceleration, Out<-1, 4> rotor_wrenches, Out<-1, 6> model_alone,
                       Out<-1, 7> predicted, Out<-1, 2> heading, Out<-1, 6> innovations,
                       Out<-1, 6> disturbance) {
  LoggedRotors rotors = rotors_of(speeds, voltage);
  check_rows(speeds.shape(0), position, quaternion, known, at_position, at_rotation, at_velocity,
             at_rate, acceleration, rotor_wrenches, model_alone, predicted, heading, innovations,
             disturbance);
  Track track = {rows(at_position),  rows(at_rotation),    rows(at_velocity), rows(at_rate),
                 rows(acceleration), rows(rotor_wrenches), rows(model_alone), rows(predicted),
                 rows(heading),      rows(innovations),    rows(disturbance)};
  SteadyGains steady = {period, reinterpret_cast<const double (*)[3][2]>(gain.data()), keep.data()};
  if (rotors.n == 0) return;
  CausalFilter filter(steady, position.data(), quaternion.data(), begun.data());
  for (std::int64_t k = 0; k < rotors.n; k++)
    filter.step(model_at(model), rotors, k, rows(position)[k], rows(quaternion)[k], rows(known)[k],
                track);
}

using Strided = nb::ndarray<const double, nb::device::cpu>;
using Product = std::tuple<double, Strided, Strided, int>;

// columns of n rows, as scale, x (n,), y (n, width) and their first channel
std::vector<ProductColumn> columns_of(const std::vector<Product> &products, std::size_t n) {
  std::vector<ProductColumn> out;
  for (const auto &[scale, x, y, first] : products) {
    if (x.ndim() != 1 || y.ndim() != 2 || first < 0 || y.shape(1) + first > 6)
      throw nb::value_error("sensitivities: expected products of (n,) and (n, k) in six channels");
    check_rows(n, x, y);
    out.push_back(
        {scale, x.data(), y.data(), x.stride(0), y.stride(0), y.stride(1), int(y.shape(1)), first});
  }
  return out;
}

void write_sensitivities(double period, In<6, 3, 2> gain, In<6> keep, In<-1, 2> heading,
                         In<-1, 3, 3> rotation, In<-1, 4> rotor_wrenches, In<-1, 3> rate,
                         In<3, 3, 3> twist, std::vector<Product> acting, std::vector<Product> moved,
                         In<-1, 6, 3> jumps, In<6, 3, -1> shares, Ints<-1> jump_state,
                         In<6, 7, -1> slopes, In<-1, 6> innovations, In<-1, 6> disturbance,
                         In<6, 6> whiten, Bools counted, Out<6, 3, -1> state, Out<-1, 6, -1> out) {
  const std::size_t n = heading.shape(0),
                    columns = acting.size() + shares.shape(2) + slopes.shape(2);
  check_rows(n, rotation, rotor_wrenches, rate, jumps, innovations, disturbance, counted);
  check_rows(std::size_t(std::count(counted.data(), counted.data() + n, true)), out);
  if (state.shape(2) != columns || out.shape(2) != columns + 1 ||
      jump_state.size() != shares.shape(2) || moved.size() > acting.size())
    throw nb::value_error("sensitivities: the columns do not match");
  for (std::size_t j = 0; j < jump_state.size(); j++)
    if (jump_state.data()[j] < 0 || jump_state.data()[j] > 2)
      throw nb::value_error("sensitivities: expected a state of 0, 1 or 2");
  SteadyGains steady = {period, reinterpret_cast<const double (*)[3][2]>(gain.data()), keep.data()};
  SensitivityInput input = {std::int64_t(n),
                            int(shares.shape(2)),
                            int(slopes.shape(2)),
                            rows(heading),
                            rows(rotation),
                            rows(rotor_wrenches),
                            rows(rate),
                            reinterpret_cast<const double (*)[3][3]>(twist.data()),
                            columns_of(acting, n),
                            columns_of(moved, n),
                            rows(jumps),
                            shares.data(),
                            jump_state.data(),
                            slopes.data(),
                            rows(innovations),
                            rows(disturbance),
                            reinterpret_cast<const double (*)[6]>(whiten.data()),
                            counted.data()};
  sensitivities(steady, input, state.data(), out.data());
}

double write_evidence(In<-1, -1> normal, In<-1> right, In<-1> low, In<-1> high, Out<-1> mode,
                      Out<-1> std) {
  std::size_t n = right.size();
  check_rows(n, normal, low, high, mode, std);
  return evidence_of(int(n), Numbers(normal.data(), normal.data() + n * n), right.data(),
                     low.data(), high.data(), mode.data(), std.data());
}

bool write_bounded_mode(In<-1, -1> normal, In<-1> right, In<-1> low, In<-1> high, Out<-1> mode) {
  check_rows(right.size(), normal, low, high, mode);
  return bounded_mode(int(right.size()), normal.data(), right.data(), low.data(), high.data(),
                      mode.data());
}

void run_over_columns(Out<-1, -1> x, In<-1, 6> sections, bool steady, int ways) {
  run_sections(std::int64_t(x.shape(0)), std::int64_t(x.shape(1)), x.data(),
               std::int64_t(sections.shape(0)), rows(sections), steady, ways);
}

void filter_columns(Out<-1, -1> x, int order, double share_of_nyquist, bool high) {
  if (order < 2 || order % 2 != 0 || !(share_of_nyquist > 0 && share_of_nyquist < 1))
    throw nb::value_error("filter_both_ways: expected an even order, and a share within (0, 1)");
  if (x.shape(0) > 0)
    filter_both_ways(std::int64_t(x.shape(0)), std::int64_t(x.shape(1)), x.data(), order,
                     share_of_nyquist, high);
}

void differentiate_columns(In<-1, -1> x, double period, int order, Out<-1, -1> out) {
  if (x.shape(0) < 5 || x.shape(0) != out.shape(0) || x.shape(1) != out.shape(1) ||
      (order != 1 && order != 2))
    throw nb::value_error("differentiate: expected five samples, and an order of 1 or 2");
  differentiate(std::int64_t(x.shape(0)), std::int64_t(x.shape(1)), x.data(), period, order,
                out.data());
}

void level_from(In<-1, 3> gyro, In<-1, 3> force, double dt, double time, In<4> start,
                Out<-1, 4> out) {
  check_rows(gyro.shape(0), force, out);
  if (gyro.shape(0) > 0)
    level_attitude(std::int64_t(gyro.shape(0)), rows(gyro), rows(force), dt, time, start.data(),
                   rows(out));
}

bool smooth_inertial_motion(In<-1, INERTIAL, INERTIAL> F, In<-1, INERTIAL> defect,
                            In<INERTIAL> noise, Ints<-1> knots, Ints<-1> firsts, In<-1> late,
                            In<-1, 3> off, In<-1> variances, Out<-1, INERTIAL> x,
                            Out<-1, INERTIAL> std) {
  check_rows(knots.size(), firsts, late, off, variances);
  check_rows(F.shape(0), defect);
  check_rows(F.shape(0) + 1, x, std);
  InertialReadings readings = {std::int64_t(knots.size()),
                               knots.data(),
                               firsts.data(),
                               late.data(),
                               rows(off),
                               variances.data()};
  return smooth_motion(std::int64_t(x.shape(0)), rows(F), rows(defect), noise.data(), readings,
                       rows(x), rows(std));
}

}  // namespace

void bind_diagnosis(nb::module_ &m) {
  m.def("acting_wrench", &write_acting_wrench, "model"_a, "period"_a, "speeds"_a, "voltage"_a,
        "position"_a, "rotation"_a, "velocity"_a, "rate"_a, "turning"_a, "mass"_a, "inertia"_a,
        "out"_a.noconvert(),
        "Write the force (N, world) and torque (Nm, body) of a model's accelerations along a "
        "flight,\n"
        "for a body of this mass and inertia, at each sample (n, 6); turning: measured angular\n"
        "acceleration (n, 3) rad/s2.");
  m.def("undo_sensing", &undo_sensing_of, "model"_a, "t"_a, "seen"_a, "samples"_a.noconvert(),
        "Bring samples (n, 11), rotor speeds and pose, back to the truth in place; rows `seen` "
        "have\n"
        "a pose.");
  m.def(
      "predict_flight", &write_prediction, "model"_a, "t"_a, "speeds"_a, "voltage"_a, "states"_a,
      "starts"_a, "period"_a, "aloft"_a, "spread"_a, "keeps_velocity"_a, "reaction"_a,
      "path"_a.noconvert(),
      "Run a model along a flight of states (n, 13), and a copy of it from each start, a row;\n"
      "write the copy's states (starts, ahead, 13), a period (s) apart. The rows `aloft` before "
      "tell\n"
      "the thrust, known to a share of `spread`; 0: as the model's. With keeps_velocity no force\n"
      "acts. The reaction (9) of a flight loop turns the body, too; (0): none.");
  m.def("choose_likeliest", &choose_states, "last"_a, "posed"_a, "numbers"_a, "innovations"_a,
        "states"_a.noconvert(), "best"_a.noconvert(),
        "Write the state (n, 13) after the `last` of a filter's calls of each row, and the\n"
        "log-likelihood (n,) of the poses so far, where this is larger than of the filters "
        "before.\n"
        "Calls: `posed` with a pose, numbers (calls, 13 or more), innovations (calls, 12).");
  m.def("run_causal_filter", &run_causal_filter, "model"_a, "period"_a, "speeds"_a, "voltage"_a,
        "position"_a, "quaternion"_a, "begun"_a, "gain"_a, "keep"_a, "known"_a,
        "at_position"_a.noconvert(), "at_rotation"_a.noconvert(), "at_velocity"_a.noconvert(),
        "at_rate"_a.noconvert(), "acceleration"_a.noconvert(), "rotors"_a.noconvert(),
        "model_alone"_a.noconvert(), "predicted"_a.noconvert(), "heading"_a.noconvert(),
        "innovations"_a.noconvert(), "disturbance"_a.noconvert(),
        "Run the causal filter of a model over poses; write the fields of its track.");
  m.def(
      "sensitivities", &write_sensitivities, "period"_a, "gain"_a, "keep"_a, "heading"_a,
      "rotation"_a, "rotors"_a, "rate"_a, "twist"_a, "acting"_a, "moved"_a, "jumps"_a, "shares"_a,
      "jump_state"_a, "slopes"_a, "innovations"_a, "disturbance"_a, "whiten"_a, "counted"_a,
      "state"_a.noconvert(), "out"_a.noconvert(),
      "Write rows (m, 6, c + 1) of the counted samples: the whitened change of the innovations'\n"
      "predictions with a unit of each column, and the innovations. Columns are products: scale,\n"
      "x (n,), y (n, k), and their first channel.");
  m.def("evidence", &write_evidence, "normal"_a, "right"_a, "low"_a, "high"_a, "mode"_a.noconvert(),
        "std"_a.noconvert(),
        "Return the logarithm of the evidence of n columns of a quadratic log-likelihood; write "
        "the\n"
        "mode of the posterior and its standard deviations (n,). NaN: no prior tells columns "
        "apart.");
  m.def("bounded_mode", &write_bounded_mode, "normal"_a, "right"_a, "low"_a, "high"_a,
        "mode"_a.noconvert(),
        "Write the maximum (n,) of `right @ x - x @ normal @ x / 2` within bounds; return whether\n"
        "there is one.");
  m.def("run_sections", &run_over_columns, "x"_a.noconvert(), "sections"_a, "steady"_a, "ways"_a,
        "Run second-order sections (m, 6) over columns (n, k) in place: forwards, and backwards "
        "where\n"
        "there are two ways; steady: as if the first row of a way had lasted, else from rest.");
  m.def("filter_both_ways", &filter_columns, "x"_a.noconvert(), "order"_a, "share_of_nyquist"_a,
        "high"_a,
        "Run a Butterworth low-pass or high-pass over columns (n, k) in place, both ways.");
  m.def("differentiate", &differentiate_columns, "x"_a, "period"_a, "order"_a, "out"_a.noconvert(),
        "Write the derivative of columns (n, k) by the polynomial through five samples.");
  m.def("level_attitude", &level_from, "gyro"_a, "force"_a, "dt"_a, "time"_a, "start"_a,
        "out"_a.noconvert(),
        "Write the attitude (n, 4) integrated from the gyro (n, 3) and levelled over `time` s by "
        "the\n"
        "specific force (n, 3), both every dt s.");
  m.def("smooth_inertial_motion", &smooth_inertial_motion, "F"_a, "defect"_a, "noise"_a, "knots"_a,
        "firsts"_a, "late"_a, "off"_a, "variances"_a, "x"_a.noconvert(), "std"_a.noconvert(),
        "Smooth an error state (m, 15) with steps F (m - 1, 15, 15) and defects between knots;\n"
        "x and std hold the prior in their first rows. Return whether all covariances are "
        "regular.");
}
