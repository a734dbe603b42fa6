// Filters of one vehicle without effects side by side, as many to a block as there are lanes in a
// register.
#pragma once
#include "ukf.hpp"

namespace windwrench {

// A filter with numbers of another precision, without effects
template <class S> void convert(const Filter<double> &from, Filter<S> &to) {
  static_assert(sizeof(Settings<double>) % 8 == 0, "one whole number, then numbers alone");
  auto copy = [](const void *first, void *into, std::size_t count) {
    for (std::size_t i = 0; i < count; i++)
      static_cast<S *>(into)[i] = S(static_cast<const double *>(first)[i]);
  };
  to = Filter<S>{};
  copy(&from.vehicle.body, &to.vehicle.body, sizeof(from.vehicle.body) / 8);
  copy(&from.belief, &to.belief, sizeof(from.belief) / 8);
  to.settings.gated = from.settings.gated;
  copy(from.settings.alarm, to.settings.alarm, sizeof(from.settings) / 8 - 1);
}

// Let lanes `first` to `last` of a block stand where a filter stands
template <class T>
void put(Belief<T> &block, const Belief<Single<T>> &one, int first, int last = lanes_of<T>) {
  for (int i = first; i < last; i++) put_lane<T>(block, i, one);
}

// Variances (18) of the error states of a block, widened by refused and unlikely poses
template <class T>
void block_variances(const Settings<Single<T>> &s, const Belief<T> &f, T *variances) {
  for (int i = 0; i < N; i++) variances[i] = f.P[i][i];
  auto doubted = is_doubted(f.poses);
  if (!any(doubted)) return;
  for (int lane = 0; lane < lanes_of<T>; lane++)
    if (doubted[lane]) {
      Belief<Single<T>> one;
      Single<T> its[N];
      take_lane<T>(f, lane, one);
      for (int i = 0; i < N; i++) its[i] = variances[i][lane];
      add_doubt(s, one, its);
      for (int i = 0; i < N; i++) variances[i][lane] = its[i];
    }
}

// Step blocks of `count` filters like `of` over a period: samples (count, 11), NaN where nothing
// was measured; writes estimates (count, 30) and variances (count, 18)
template <class T>
void step_blocks(const Filter<Single<T>> &of, Belief<T> *blocks, long count, const double *samples,
                 double *numbers, double *variances) {
  constexpr int LANES = lanes_of<T>;
  for (long first = 0; first < count; first += LANES) {
    Belief<T> &f = blocks[first / LANES];
    T z[11], wide[N];
    for (int lane = 0; lane < LANES; lane++) {  // lanes to spare do what the last filter does
      long n = first + lane < count ? first + lane : count - 1;
      for (int i = 0; i < 11; i++) z[i][lane] = Single<T>(samples[11 * n + i]);
    }
    step_lanes(of, f, z);
    block_variances(of.settings, f, wide);
    const T rest[10] = {f.status,   f.restarts, f.excess[0], f.excess[1], f.model[0],
                        f.model[1], f.model[2], f.model[3],  f.model[4],  f.model[5]};
    for (int lane = 0; lane < LANES && first + lane < count; lane++) {
      for (int i = 0; i < STATE; i++) numbers[30 * (first + lane) + i] = f.x[i][lane];
      for (int i = 0; i < 10; i++) numbers[30 * (first + lane) + STATE + i] = rest[i][lane];
      for (int i = 0; i < N; i++) variances[N * (first + lane) + i] = wide[i][lane];
    }
  }
}

}  // namespace windwrench
