// Python's random generators, for the bindings that draw from them.
#pragma once
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>

#include <string>
#include <vector>

#include "../normals.hpp"

namespace nb = nanobind;
using namespace windwrench;

inline const Ziggurat &ziggurat() {
  static const Ziggurat tables;
  return tables;
}

// NumPy's generators of n environments
class Streams {
 public:
  explicit Streams(std::size_t count) : streams_(count), owners_(count) {}

  void put(std::size_t n, nb::object generator) {
    nb::object bits = generator.attr("bit_generator"), capsule = bits.attr("capsule");
    auto *known = static_cast<BitGenerator *>(PyCapsule_GetPointer(capsule.ptr(), "BitGenerator"));
    if (!known) throw nb::python_error();
    streams_.at(n) = {known, pcg_of(bits, *known)};
    owners_[n] = bits;
  }

  const Stream *data() const { return streams_.data(); }
  const Stream &at(std::size_t n) const {
    if (!streams_.at(n).generator) throw nb::value_error("draw: an environment without generator");
    return streams_[n];
  }

 private:
  // The state of NumPy's default generator, or null: another one, or another layout of its memory
  static Pcg64 *pcg_of(const nb::object &bits, const BitGenerator &known) {
    if (nb::cast<std::string>(bits.type().attr("__name__")) != "PCG64") return nullptr;
    nb::object stated = bits.attr("state")["state"], low = nb::int_(~std::uint64_t(0));
    Pcg64 &pcg = **static_cast<Pcg64 **>(known.state);
    auto same = [&](const char *name, unsigned __int128 value) {
      nb::object whole = stated[name];
      return nb::cast<std::uint64_t>(whole & low) == std::uint64_t(value) &&
             nb::cast<std::uint64_t>(whole >> nb::int_(64)) == std::uint64_t(value >> 64);
    };
    return same("state", pcg.state) && same("inc", pcg.increment) ? &pcg : nullptr;
  }

  std::vector<Stream> streams_;
  std::vector<nb::object> owners_;
};
