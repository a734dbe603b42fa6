// The closed loop and its environments for Python. A loop's memory is Python's: a NumPy record,
// laid out as `Flying` (envs/closed_loop.py), given by its address.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include "../episodes.hpp"
#include "episodes.hpp"
#include "filter.hpp"
#include "streams.hpp"

namespace {

using Rows = Array<const double, nb::shape<-1, -1>>;

Run run_of(const Rows &path, const Rows &noise) {
  return {noise.data(), std::int64_t(noise.shape(0)), std::int64_t(noise.shape(1)), path.data(),
          std::int64_t(path.shape(0))};
}

void run_ticks(std::uintptr_t address, Rows path, Rows noise) {
  nb::gil_scoped_release others_run;
  Run run = run_of(path, noise);
  for (std::int64_t k = 0; k < run.count; k++)
    for (int stage = 0; stage < STAGES; stage++) run_stage(flying_at(address), stage, run, k);
}

void stage_at(std::uintptr_t address, int stage, Rows path, Rows noise, std::int64_t k) {
  run_stage(flying_at(address), stage, run_of(path, noise), k);
}

double no_time() { return 0.0; }

}  // namespace

void bind_tick(nb::module_ &m) {
  m.attr("LOOP_SIZE") = sizeof(Flying);
  m.attr("PLANT_SIZE") = sizeof(Plant<double>);
  m.attr("WORLD_SIZE") = int(ROW_SIZE);
  m.def("run_ticks", &run_ticks, "address"_a, "path"_a, "noise"_a,
        "Run a tick of the loop at an address for each row of noise (n, size), unit normals; path\n"
        "(m, 2): the fan's y and height in m, tick by tick. Winds and stages of a user's own do\n"
        "not run.");
  m.def("run_stage", &stage_at, "address"_a, "stage"_a, "path"_a, "noise"_a, "k"_a,
        "Run one stage of tick k: 0 wind, 1 sense, 2 estimate, 3 steer, 4 actuate, 5 the\n"
        "accelerometer, 6 move.");
  m.def(
      "is_healthy",
      [](std::uintptr_t address) {
        const Flying &f = flying_at(address);
        return is_healthy(f.filter->belief.x, f.qvel);
      },
      "address"_a, "Return whether the loop's estimate is finite, and each velocity a vehicle's.");
  m.def(
      "no_time", [] { return reinterpret_cast<std::uintptr_t>(&no_time); },
      "Return the address of a clock for MuJoCo that stands still.");
  m.def(
      "limit",
      [](Rows seen, Array<const float, nb::shape<-1>> limits,
         Array<const float, nb::shape<-1>> scales, Array<float, nb::shape<-1, -1>> si,
         Array<float, nb::shape<-1, -1>> out) {
        std::int64_t size = std::int64_t(seen.shape(1));
        for (std::int64_t n = 0; n < std::int64_t(seen.shape(0)); n++)
          limit(seen.data() + size * n, size, limits.data(), scales.data(), si.data() + size * n,
                out.data() + size * n);
      },
      "seen"_a, "limits"_a, "scales"_a, "si"_a, "out"_a,
      "Write frames (n, k) within limits (k,) as they are into si, and over scales (k,) into out;\n"
      "0 where a number is not finite.");
  nb::class_<Streams>(m, "Streams", "NumPy's generators of n environments.")
      .def(nb::init<std::size_t>(), "count"_a)
      .def("put", &Streams::put, "n"_a, "generator"_a,
           "Let environment n draw from a numpy.random.Generator.")
      .def(
          "draw",
          [](const Streams &self, std::size_t n, Array<double, nb::shape<-1, -1>> out) {
            draw_normals(ziggurat(), self.at(n), std::int64_t(out.size()), out.data(), 1);
          },
          "n"_a, "out"_a, "Draw unit normals out (m, k), as `standard_normal(out=out)` does.");
  nb::class_<Scene>(m, "Scene", "The arrays of n episodes, a row each (envs/state.py).")
      .def(nb::init<Scene::Whole, Scene::Whole, Scene::Table, Scene::Table, Scene::Cube,
                    Scene::Table, Scene::Table, Scene::Table, Scene::Flags, Scene::Table,
                    Scene::Flags>(),
           "ticks"_a, "decisions"_a, "paths"_a, "heights"_a, "references"_a, "commands"_a,
           "actions"_a, "last_actions"_a, "broken"_a, "rows"_a, "flying"_a)
      .def(
          "take",
          [](Scene &self, Array<const double, nb::shape<-1, -1>> wanted,
             Array<const bool, nb::shape<-1>> which, double scale, Scene::Fixed hover,
             Scene::Fixed below, Scene::Fixed above) {
            Commanded how = {scale, hover.data(), below.data(), above.data()};
            return take(wanted.data(), which.data(), how, self.episodes);
          },
          "wanted"_a, "which"_a, "scale"_a, "hover"_a, "below"_a, "above"_a,
          "Write actions (n, size) over scale, within -1 to 1, and their commands into the "
          "episodes\n"
          "which (n,). Return whether all numbers are finite; nothing is written otherwise.")
      .def(
          "gather",
          [](Scene &self, std::int64_t n, std::uintptr_t address) {
            const Flying &f = flying_at(address);
            self.write(n, motion_of(f.loop, f.filter->belief, f.qpos, f.qvel, 0));
          },
          "n"_a, "address"_a, "Write row n from the loop at an address.");
}
