// Filters side by side for Python.
#include "../batch.hpp"

#include <vector>

#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

template <class S> class Batch {
 public:
  static constexpr int LANES = REGISTER / sizeof(S);
  using Block = Belief<Lanes<S, LANES>>;

  Batch(std::uintptr_t address, long count) : count_(count), blocks_((count + LANES - 1) / LANES) {
    convert(*reinterpret_cast<const Filter<double> *>(address), like_);
    for (Block &block : blocks_) put(block, like_.belief, 0);
  }

  void put_filter(long n, std::uintptr_t address) {
    Filter<S> one;
    convert(*reinterpret_cast<const Filter<double> *>(address), one);
    int lane = int(n % LANES);
    put(blocks_.at(n / LANES), one.belief, lane, n == count_ - 1 ? LANES : lane + 1);
  }

  void step(Array<const double, nb::shape<-1, 11>> z, Array<double, nb::shape<-1, 30>> numbers,
            Array<double, nb::shape<-1, N>> variances) {
    if (long(z.shape(0)) != count_ || long(numbers.shape(0)) != count_ ||
        long(variances.shape(0)) != count_)
      throw nb::value_error("step: expected a row for each filter");
    nb::gil_scoped_release others_run;
    step_blocks(like_, blocks_.data(), count_, z.data(), numbers.data(), variances.data());
  }

  void covariance(Array<double, nb::shape<-1, N, N>> out) const {
    for (long n = 0; n < count_ && n < long(out.shape(0)); n++)
      for (int i = 0; i < N * N; i++)
        out.data()[N * N * n + i] = blocks_[n / LANES].P[i / N][i % N][n % LANES];
  }

  nb::bytes state() const {
    std::size_t size = blocks_.size() * sizeof(Block);
    std::vector<char> all(sizeof(like_) + size);
    std::memcpy(all.data(), &like_, sizeof(like_));
    std::memcpy(all.data() + sizeof(like_), blocks_.data(), size);
    return nb::bytes(all.data(), all.size());
  }

  Batch(long count, const nb::bytes &given) : count_(count), blocks_((count + LANES - 1) / LANES) {
    std::size_t size = blocks_.size() * sizeof(Block);
    if (given.size() != sizeof(like_) + size) throw nb::value_error("a state of another core");
    std::memcpy(static_cast<void *>(&like_), given.data(), sizeof(like_));
    const char *rest = static_cast<const char *>(given.data()) + sizeof(like_);
    std::memcpy(static_cast<void *>(blocks_.data()), rest, size);
  }

  long count() const { return count_; }

 private:
  long count_;
  Filter<S> like_;  // for all filters
  std::vector<Block> blocks_;
};

using State = nb::typed<nb::tuple, long, nb::bytes>;  // how many, and all memory

template <class S> void bind_filters(nb::module_ &m, const char *name) {
  nb::class_<Batch<S>>(m, name)
      .def(nb::init<std::uintptr_t, long>(), "address"_a, "count"_a,
           "Filters side by side, `count` like the one at an address, without effects.")
      .def("put", &Batch<S>::put_filter, "n"_a, "address"_a,
           "Let filter n stand where the one at an address stands.")
      .def("step", &Batch<S>::step, "z"_a, "numbers"_a, "variances"_a,
           "Step all over a period: samples (n, 11), rotor speeds rad/s, position m and "
           "quaternion,\n"
           "NaN where nothing was measured; estimates (n, 30) and variances of the error states\n"
           "(n, 18), written.")
      .def("covariance", &Batch<S>::covariance, "out"_a,
           "Write the covariances (n, 18, 18), of noise alone.")
      .def("__getstate__",
           [](const Batch<S> &self) { return State(nb::make_tuple(self.count(), self.state())); })
      .def("__setstate__", [](Batch<S> &self, const State &given) {
        new (&self) Batch<S>(nb::cast<long>(given[0]), nb::cast<nb::bytes>(given[1]));
      });
}

}  // namespace

void bind_batch(nb::module_ &m) {
  bind_filters<double>(m, "Batch");
  bind_filters<float>(m, "SingleBatch");
}
