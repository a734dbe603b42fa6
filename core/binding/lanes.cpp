// Blocks of closed loops side by side for Python.
#include "../lanes.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/string.h>

#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

#include "episodes.hpp"
#include "filter.hpp"
#include "streams.hpp"

namespace {

using Whole = Array<const std::int64_t, nb::shape<-1>>;

// `count` structs of zeros in pages that take no memory before they are written
template <class Many> class Zeros {
 public:
  Zeros() = default;
  explicit Zeros(std::size_t count)
      : count_(count), room_(std::calloc(count * sizeof(Many) + alignof(Many), 1)) {
    std::size_t size = count * sizeof(Many) + alignof(Many);
    void *first = room_.get();
    if (!std::align(alignof(Many), count * sizeof(Many), first, size)) throw std::bad_alloc();
    first_ = static_cast<Many *>(first);
  }
  Many &at(std::size_t i) const {
    if (i >= count_) throw nb::index_error("no such block");
    return first_[i];
  }
  Many *begin() const { return first_; }
  Many *end() const { return first_ + count_; }
  std::size_t size() const { return count_; }
  std::size_t bytes() const { return count_ * sizeof(Many); }

 private:
  struct Free {
    void operator()(void *room) const { std::free(room); }
  };
  std::size_t count_ = 0;
  std::unique_ptr<void, Free> room_;
  Many *first_ = nullptr;
};

template <class S> class LoopBlocks {
 public:
  static constexpr int LANES = REGISTER / sizeof(S);
  using T = Lanes<S, LANES>;

  LoopBlocks(std::uintptr_t like, std::size_t count, bool follows, bool moves, Whole places)
      : blocks_(count), places_(places) {
    const Flying &f = flying_at(like);
    const Model<double> &declared = f.filter->vehicle;
    Model<T> known;
    if (!lay_effects(known, f.loop.plant.vehicle) || !lay_effects(known, declared))
      throw nb::value_error("an effect in Python");
    convert(*f.filter, common_.filter);
    for (int i = 0; i < 2 * COUNT_X * COUNT_R; i++) jet_.push_back(S(f.jet[i]));
    common_.jet = jet_.data();
    common_.follows = follows;
    common_.moves = moves;
    common_.places = places_.data();
    common_.model_in_loop = f.model_in_loop > 0;
    if (declared.wrench_count + declared.rotor_count + declared.sensing_count > 0)
      declared_ = Zeros<Model<T>>(count);
    for (std::size_t i = 0; i < count; i++) put(i, 0, LANES, like);
  }

  void put(std::size_t block, int first, int last, std::uintptr_t address) {
    const Flying &f = flying_at(address);
    Block<T> &b = blocks_.at(block);
    Filter<S> one;
    convert(*f.filter, one);
    lay_effects(b.loop.plant.vehicle, f.loop.plant.vehicle);
    put_loop(b.loop, f.loop, first, last);
    put_numbers<T>(b.qpos, f.qpos, 7, first, last);
    put_numbers<T>(b.qvel, f.qvel, 6, first, last);
    windwrench::put(b.belief, one.belief, first, last);
    if (declared_.size() == 0) return;
    lay_effects(declared_.at(block), f.filter->vehicle);
    put_model(declared_.at(block), f.filter->vehicle, first, last);
  }

  // Let a lane stand where the same lane of another's block stands
  void take(std::size_t block, int lane, const LoopBlocks &other, std::size_t source) {
    take_part(blocks_.at(block), other.blocks_.at(source), lane);
    if (declared_.size() != 0) take_part(declared_.at(block), other.declared_.at(source), lane);
  }

  void fly(std::size_t begin, std::size_t end, Whole slots, Scene &scene, int kind,
           std::int64_t ticks, std::int64_t size, const Streams &streams,
           Array<const std::int64_t, nb::shape<-1, -1, 2>> winds, Whole wind_counts) {
    if (slots.shape(0) != LANES * blocks_.size() || end > blocks_.size())
      throw nb::value_error("fly: expected a slot for each lane");
    nb::gil_scoped_release others_run;
    Common<S> common = common_;
    common.kind = CommandKind(kind);
    common.size = size;
    const Weather air = {reinterpret_cast<const WindCall *>(winds.data()),
                         std::int64_t(winds.shape(1)), wind_counts.data(), streams.data(),
                         &ziggurat()};
    for (std::size_t i = begin; i < end; i++) {
      const std::int64_t *members = slots.data() + LANES * i;
      bool some = false;
      for (int lane = 0; lane < LANES; lane++) some = some || members[lane] >= 0;
      if (some)
        fly_block(blocks_.at(i), declared_.size() == 0 ? nullptr : &declared_.at(i), common,
                  members, scene.episodes, ticks, air);
    }
  }

  // Environments of `which` with numbers too large start over; write the rows of all
  void look(Array<const bool, nb::shape<-1>> which, Scene &scene) {
    for (std::int64_t n = 0; n < scene.episodes.count; n++) {
      Block<T> &b = blocks_.at(std::size_t(n / LANES));
      int lane = int(n % LANES);
      if (which.data()[n]) scene.episodes.broken[n] = start_over(b, lane);
      scene.write(n, motion_of(b.loop, b.belief, b.qpos, b.qvel, lane));
    }
  }

  // A field (blocks, size, lanes) of the memory
  nb::ndarray<nb::numpy, S> view(const std::string &name) {
    static_assert(sizeof(Block<T>) % sizeof(S) == 0, "a whole number of numbers");
    if (blocks_.size() == 0) throw nb::value_error("view: no blocks");
    Block<T> &b = blocks_.at(0);
    Plant<T> &plant = b.loop.plant;
    const struct {
      const char *name;
      T *first;
      std::size_t size;
    } fields[] = {{"qpos", b.qpos, 7},
                  {"qvel", b.qvel, 6},
                  {"xfrc", b.xfrc, 6},
                  {"speeds", plant.speeds, 4},
                  {"sum", b.loop.flight.sum, 3},
                  {"actuator_late", &plant.actuator_late, 1},
                  {"pose_late", &plant.pose_late, 1}};
    for (const auto &field : fields)
      if (name == field.name) {
        const std::size_t shape[3] = {blocks_.size(), field.size, LANES};
        const std::int64_t strides[3] = {std::int64_t(sizeof(Block<T>) / sizeof(S)), LANES, 1};
        return nb::ndarray<nb::numpy, S>(field.first, 3, shape, nb::find(this), strides);
      }
    throw nb::value_error("view: no field of this name");
  }

  void fly_freely(double dt, int steps) {
    for (Block<T> &b : blocks_)
      for (int i = 0; i < steps; i++) windwrench::fly_freely(b, S(dt));
  }

  nb::bytes state() const {
    std::vector<char> all(blocks_.bytes() + declared_.bytes());
    std::memcpy(all.data(), blocks_.begin(), blocks_.bytes());
    if (declared_.size())
      std::memcpy(all.data() + blocks_.bytes(), declared_.begin(), declared_.bytes());
    return nb::bytes(all.data(), all.size());
  }

  // Stand where the blocks of a state stood; the effects are those of this process
  void restore(const nb::bytes &given, std::uintptr_t like) {
    if (given.size() != blocks_.bytes() + declared_.bytes())
      throw nb::value_error("a state of another core");
    const char *from = static_cast<const char *>(given.data());
    std::memcpy(static_cast<void *>(blocks_.begin()), from, blocks_.bytes());
    if (declared_.size())
      std::memcpy(static_cast<void *>(declared_.begin()), from + blocks_.bytes(),
                  declared_.bytes());
    for (Block<T> &b : blocks_)
      lay_effects(b.loop.plant.vehicle, flying_at(like).loop.plant.vehicle);
    for (Model<T> &m : declared_) lay_effects(m, flying_at(like).filter->vehicle);
  }

  std::size_t size() const { return blocks_.size(); }

 private:
  // Numbers of lanes lie at whole registers, and between them is what all blocks have in common
  template <class Many> static void take_part(Many &to, const Many &from, int lane) {
    T *mine = reinterpret_cast<T *>(&to);
    const T *its = reinterpret_cast<const T *>(&from);
    for (std::size_t i = 0; i < sizeof(Many) / sizeof(T); i++)
      if (std::memcmp(&mine[i], &its[i], sizeof(T)) != 0) mine[i][lane] = its[i][lane];
  }

  Zeros<Block<T>> blocks_;
  Zeros<Model<T>> declared_;  // of the filters, where these have effects
  std::vector<S> jet_;
  Whole places_;
  Common<S> common_ = {};
};

template <class S> void bind_loops(nb::module_ &m, const char *name) {
  using Blocks = LoopBlocks<S>;
  nb::class_<Blocks>(m, name)
      .def(
          nb::init<std::uintptr_t, std::size_t, bool, bool, Whole>(), "like"_a, "count"_a,
          "follows"_a, "moves"_a, "places"_a,
          "Closed loops side by side, one to each lane of `count` blocks, all like the one at an\n"
          "address. follows: whether the set point is a row of the reference; moves: whether\n"
          "commands are velocities of the set point; places (n,) of commands in the set point, or\n"
          "in the action. ValueError: an effect of a vehicle is written in Python.")
      .def("__len__", &Blocks::size)
      .def_prop_ro_static("lanes", [](nb::handle) { return int(Blocks::LANES); })
      .def("put", &Blocks::put, "block"_a, "first"_a, "last"_a, "address"_a,
           "Let lanes `first` to `last - 1` of a block stand where the loop at an address stands.")
      .def("take", &Blocks::take, "block"_a, "lane"_a, "other"_a, "source"_a,
           "Let a lane of a block stand where the same lane of another's block stands.")
      .def("fly", &Blocks::fly, "begin"_a, "end"_a, "slots"_a, "scene"_a, "kind"_a, "ticks"_a,
           "size"_a, "streams"_a, "winds"_a, "wind_counts"_a,
           "Fly blocks `begin` to `end - 1` for some ticks of `size` unit normals each, from the\n"
           "environments' streams. slots (lanes,): the environment in each lane; -1: no flight.\n"
           "kind: of the commands; winds (n, most, 2): calls of each environment's, and their\n"
           "number (n,).")
      .def("look", &Blocks::look, "which"_a, "scene"_a,
           "Let environments of which (n,) with numbers too large start over; write all rows.")
      .def("view", &Blocks::view, "name"_a,
           "Return a field (blocks, size, lanes) of the memory: qpos, qvel, xfrc, speeds, sum,\n"
           "actuator_late or pose_late.")
      .def("fly_freely", &Blocks::fly_freely, "dt"_a, "steps"_a,
           "Carry the free bodies on by steps of dt s at the wrench in xfrc.")
      .def("state", &Blocks::state, "Return all memory.")
      .def("restore", &Blocks::restore, "state"_a, "like"_a,
           "Stand where the blocks of a state stood, of loops like the one at an address.");
}

}  // namespace

void bind_lanes(nb::module_ &m) {
  bind_loops<double>(m, "LoopBlocks");
  bind_loops<float>(m, "SingleLoopBlocks");
}
