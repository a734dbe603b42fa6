// The noise of measured poses, learned from the poses: estimator/recovery.py says why and how fast.
#pragma once
#include "filter.hpp"

namespace windwrench {

constexpr double PRIOR_OF_NOISE = 5;     // poses that the declared noise counts for
constexpr double MEMORY_OF_NOISE = 200;  // poses over which later ones are forgotten: 1 s at 200 Hz
// times the expected square, that a pose counts with: noise alone exceeds this in one of 140, and a
// jump of any size counts as little
constexpr double LARGEST_SQUARE = 4;
// a variance is refuted where the learned one, less so many of its deviations, exceeds it so far:
// vehicle files state deviations to some 20 %
constexpr double SURE = 3, REFUTED = 1.5;

// variance of number i of a measured pose, (rho, x), that the filter assumes
template <class T> T pose_noise(const Settings<Single<T>> &s, const Belief<T> &f, int i) {
  return s.noise[i] * (Single<T>(1) + f.poses.widened[i < 3 ? 0 : 1]);
}

// the same as poses show it, as a multiple of the declared variance: at least 1
template <class T> T likeliest_scale(const Belief<T> &f, int i) {
  return larger(Single<T>(1) + f.excess[i < 3 ? 0 : 1], T{} + Single<T>(1));
}

// Count the time since poses were believed and refused, and widen the noise by what was learned
template <class T> void grow_older(const Settings<Single<T>> &s, Single<T> dt, Belief<T> &f) {
  using S = Single<T>;
  Poses<T> &m = f.poses;
  T uncertainty = S(1) + S(SURE) / root(S(PRIOR_OF_NOISE) + m.judged);
  for (int part = 0; part < 2; part++) {
    T proved = (S(1) + f.excess[part]) / uncertainty;
    m.widened[part] = choose(proved > T{} + S(REFUTED), proved - S(1), T{});
  }
  m.settling -= dt;
  m.astray -= dt;
  m.strain -= smaller(dt / s.patience, S(1)) * m.strain;
  m.position_age += dt;
  m.attitude_age += dt;
  m.doubted_position_age += dt;
  m.doubted_attitude_age += dt;
}

// Learn from a measured pose how large the noise of attitudes and positions is. The innovation's
// change since the last pose, increment (6), holds the noise of both, 2 R, and the uncertainty of
// the expected pose, unsure (6), adds to that
template <class T, class A>
void learn_noise(const Settings<Single<T>> &s, const T *increment, const T *unsure, A with_position,
                 A with_attitude, Belief<T> &f) {
  using S = Single<T>;
  Poses<T> &m = f.poses;
  T poses = S(PRIOR_OF_NOISE) + m.judged;
  for (int part = 0; part < 2; part++) {
    T wide = S(1) + m.widened[part], share{}, square{};
    for (int i = 3 * part; i < 3 * part + 3; i++) {
      T noise = wide * s.noise[i], variance = unsure[i];
      T expected = S(2) * noise + variance * (variance / (variance + noise));
      share += S(2) * noise / (S(3) * expected);
      square += increment[i] * increment[i] / (S(3) * expected);
    }
    // the variance that this pose shows, times the share; the weight is the square of the share:
    // an innovation of an unknown pose is no noise
    T shown = larger(wide * (share + smaller(square, T{} + S(LARGEST_SQUARE)) - S(1)), T{});
    T news = share * (shown - share * (S(1) + f.excess[part])) / poses;
    auto counts = (part == 0 ? with_attitude : with_position) & finite(news);
    f.excess[part] += choose(counts, news, T{});  // overflowing numbers say nothing
  }
  T judged = smaller(m.judged + S(1), T{} + S(MEMORY_OF_NOISE));
  m.judged = choose(with_position | with_attitude, judged, m.judged);
}

}  // namespace windwrench
