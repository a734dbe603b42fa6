// The dense layers of a trained policy: controllers/trained_policy.py.
#pragma once
#include <utility>

#include "windwrench_numbers.hpp"

namespace windwrench {

// The layers' output for inputs in one of two rooms (WIDEST); both are written over
inline ww_number *through_layers(ww_number *in, ww_number *out) {
  const ww_number *weight = WEIGHTS, *bias = OFFSETS;
  for (int layer = 0; layer < LAYERS; layer++) {
    bool last = layer + 1 == LAYERS;
    for (int i = 0; i < WIDTHS[layer + 1]; i++) {
      out[i] = *bias++;
      for (int j = 0; j < WIDTHS[layer]; j++) out[i] += *weight++ * in[j];
      if (last)
        out[i] = SQUASH ? std::tanh(out[i]) : out[i];
      else
        out[i] = RELU ? larger(out[i], ww_number(0)) : std::tanh(out[i]);
    }
    std::swap(in, out);
  }
  return in;
}

}  // namespace windwrench
