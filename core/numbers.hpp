// Numbers of the core: double, float, or lanes of either, one register of a processor's vector
// unit.
//
// A formula is written once for all of them. A comparison of lanes has an answer for each lane, so
// code for all numbers takes `choose`, `any` and `all` in place of `if`. Each operation rounds like
// that of single numbers: a lane equals a single filter to the bit.
#pragma once
#include <cmath>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <utility>

#ifdef __AVX__
#include <immintrin.h>
#endif

namespace windwrench {

constexpr double PI = 3.14159265358979323846;  // M_PI is not in every C library

template <class S, int LANES> struct Register {
  typedef S type __attribute__((vector_size(LANES * sizeof(S))));
};
template <class S, int LANES> using Lanes = typename Register<S, LANES>::type;

template <class T> constexpr bool is_single = std::is_arithmetic<T>::value;

template <class T, bool SINGLE> struct Parts {
  using type = T;
};
template <class T> struct Parts<T, false> {
  using type = std::remove_reference_t<decltype(std::declval<T &>()[0])>;
};
template <class T> using Single = typename Parts<T, is_single<T>>::type;  // the number of one lane
template <class T> using Answer = decltype(std::declval<T>() < std::declval<T>());
template <class T> constexpr int lanes_of = sizeof(T) / sizeof(Single<T>);

template <class T> inline T choose(bool c, T a, T b) { return c ? a : b; }
template <class C, class T> inline T choose(C c, T a, T b) { return c ? a : b; }

// whether a condition holds in any lane, or in all
template <class C> inline bool any(C c) {
  if constexpr (is_single<C>) {
    return c != 0;
  } else {
#ifdef __AVX512F__
    if constexpr (sizeof(C) == 64) {
      __m512i bits = reinterpret_cast<__m512i>(c);
      return _mm512_test_epi64_mask(bits, bits) != 0;
    }
#endif
#ifdef __AVX__
    if constexpr (sizeof(C) == 32) {
      __m256i bits = reinterpret_cast<__m256i>(c);
      return !_mm256_testz_si256(bits, bits);
    }
#endif
    bool found = false;
    for (int i = 0; i < lanes_of<C>; i++) found |= c[i] != 0;
    return found;
  }
}
template <class C> inline bool all(C c) { return !any(c == C{}); }
inline bool opposite(bool c) { return !c; }
template <class C> inline C opposite(C c) {
  static_assert(!std::is_arithmetic<C>::value, "of lanes, or a bool");
  return ~c;
}
template <class T> inline Answer<T> finite(T a) { return a - a == T{}; }

// the larger and the smaller of two; the first where one is no number
template <class T> inline T larger(T a, T b) { return choose(b > a, b, a); }
template <class T> inline T smaller(T a, T b) { return choose(b < a, b, a); }
template <class T> inline T absolute(T a) { return choose(a < T{}, -a, a); }
template <class T> inline T within(T a, Single<T> low, Single<T> high) {
  return smaller(larger(a, T{} + low), T{} + high);
}

template <class T, class F> inline T lane_by_lane(T a, F function) {
  if constexpr (is_single<T>) {
    return function(a);
  } else {
    T result;
    for (int i = 0; i < lanes_of<T>; i++) result[i] = function(a[i]);
    return result;
  }
}
template <class T> inline T root(T a) {
  return lane_by_lane(a, [](Single<T> one) { return std::sqrt(one); });
}
template <class T> inline T sine(T a) {
  return lane_by_lane(a, [](Single<T> one) { return std::sin(one); });
}
template <class T> inline T cosine(T a) {
  return lane_by_lane(a, [](Single<T> one) { return std::cos(one); });
}
template <class T> inline T rounded_down(T a) {
  return lane_by_lane(a, [](Single<T> one) { return std::floor(one); });
}
template <class T> inline T exponential(T a) {
  return lane_by_lane(a, [](Single<T> one) { return std::exp(one); });
}

// a function of two numbers, lane by lane
template <class T, class F> inline T lane_by_lane(T a, T b, F function) {
  if constexpr (is_single<T>) {
    return function(a, b);
  } else {
    T result;
    for (int i = 0; i < lanes_of<T>; i++) result[i] = function(a[i], b[i]);
    return result;
  }
}
template <class T> inline T power(T a, T b) {
  return lane_by_lane(a, b, [](Single<T> x, Single<T> y) { return std::pow(x, y); });
}
template <class T> inline T angle_of(T y, T x) {
  return lane_by_lane(y, x, [](Single<T> a, Single<T> b) { return std::atan2(a, b); });
}

}  // namespace windwrench
