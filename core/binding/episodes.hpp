// Python's arrays of episodes, for the bindings of single loops and of lanes.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "../episodes.hpp"
#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

inline Flying &flying_at(std::uintptr_t address) { return *reinterpret_cast<Flying *>(address); }

// Arrays of n episodes, with a row each; they live as long as this
struct Scene {
  using Whole = Array<std::int64_t, nb::shape<-1>>;
  using Cube = Array<double, nb::shape<-1, -1, -1>>;
  using Table = Array<double, nb::shape<-1, -1>>;
  using Flags = Array<bool, nb::shape<-1>>;
  using Fixed = Array<const double, nb::shape<-1>>;

  Scene(Whole ticks, Whole decisions, Table paths, Table heights, Cube references, Table commands,
        Table actions, Table last_actions, Flags broken, Table rows, Flags flying)
      : held_{ticks,    decisions, paths,        heights, references,
              commands, actions,   last_actions, broken},
        rows(rows),
        flying(flying) {
    if (rows.shape(1) != ROW_SIZE) throw nb::value_error("Scene: rows of another layout");
    episodes = {std::int64_t(ticks.shape(0)),
                std::int64_t(commands.shape(1)),
                ticks.data(),
                decisions.data(),
                paths.data(),
                heights.data(),
                std::int64_t(paths.shape(1)),
                std::int64_t(heights.shape(1)),
                references.data(),
                std::int64_t(references.shape(1)),
                commands.data(),
                actions.data(),
                last_actions.data(),
                broken.data()};
  }

  void write(std::int64_t n, const Motion &motion) {
    flying.data()[n] = write_row(motion, episodes, n, rows.data() + ROW_SIZE * n);
  }

  Episodes episodes;

 private:
  struct {
    Whole ticks, decisions;
    Table paths, heights;
    Cube references;
    Table commands, actions, last_actions;
    Flags broken;
  } held_;
  Table rows;
  Flags flying;
};
