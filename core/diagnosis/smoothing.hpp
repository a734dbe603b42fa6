// Series of a log, smoothed: a low-pass of zero phase, and a motion by inertial measurements.
#pragma once
#include <algorithm>
#include <cstdint>

#include "../linear_algebra.hpp"
#include "../rotation.hpp"
#include "evidence.hpp"

namespace windwrench {

// Run second-order sections (count), b0 b1 b2 1 a1 a2, over columns x (n, width) in place:
// forwards, and then backwards where there are two ways; steady: as if a way's first row had
// lasted, else from rest
inline void run_sections(int64_t n, int64_t width, double *x, int64_t count,
                         const double (*sections)[6], bool steady, int ways) {
  Numbers lasted(width), first(width), second(width);
  for (int way = 0; way < ways && n > 0; way++) {
    std::copy_n(x + width * (way == 0 ? 0 : n - 1), width, lasted.begin());
    for (int64_t s = 0; s < count; s++) {
      const double *b = sections[s], *a = b + 4, gain = (b[0] + b[1] + b[2]) / (1 + a[0] + a[1]);
      for (int64_t j = 0; j < width; j++) {
        double begun = steady ? lasted[j] : 0;
        second[j] = (b[2] - a[1] * gain) * begun;
        first[j] = (b[1] - a[0] * gain + (b[2] - a[1] * gain)) * begun;
        lasted[j] *= gain;
      }
      for (int64_t i = 0; i < n; i++) {
        double *row = x + width * (way == 0 ? i : n - 1 - i);
        for (int64_t j = 0; j < width; j++) {
          double given = row[j], made = b[0] * given + first[j];
          first[j] = b[1] * given - a[0] * made + second[j];
          second[j] = b[2] * given - a[1] * made;
          row[j] = made;
        }
      }
    }
  }
}

// Run the low-pass or high-pass of Butterworth, of an even order and by the bilinear transform,
// over columns x (n, width) in place, forwards and backwards, behind an odd reflection of either
// end
inline void filter_both_ways(int64_t n, int64_t width, double *x, int order,
                             double share_of_nyquist, bool high) {
  const double c = 1 / std::tan(0.5 * PI * share_of_nyquist);
  const int count = order / 2;
  const int64_t edge = std::min<int64_t>(3 * (order + 1), n - 1);
  Numbers sections(6 * count), longer((n + 2 * edge) * width);
  for (int k = 0; k < count; k++) {
    double *own = sections.data() + 6 * k;
    double damping = 2 * c * std::sin(0.5 * PI * (2 * k + 1) / order);
    double whole = 1 + damping + c * c, through = (high ? c * c : 1) / whole;
    own[0] = own[2] = through, own[1] = high ? -2 * through : 2 * through;
    own[3] = 1, own[4] = 2 * (1 - c * c) / whole, own[5] = (1 - damping + c * c) / whole;
  }
  for (int64_t i = -edge; i < n + edge; i++)
    for (int64_t j = 0; j < width; j++) {
      auto at = [&](int64_t row) { return x[width * row + j]; };
      longer[(i + edge) * width + j] = i < 0   ? 2 * at(0) - at(-i)
                                       : i < n ? at(i)
                                               : 2 * at(n - 1) - at(2 * (n - 1) - i);
    }
  run_sections(n + 2 * edge, width, longer.data(), count,
               reinterpret_cast<const double (*)[6]>(sections.data()), true, 2);
  std::copy_n(longer.data() + edge * width, n * width, x);
}

// The first or second derivative out (n, width) of columns x: of the polynomial through five
// samples, at the middle one; at an end at all of them
inline void differentiate(int64_t n, int64_t width, const double *x, double period, int order,
                          double *out) {
  constexpr double WEIGHTS[2][3][5] = {
      {{-25, 48, -36, 16, -3}, {-3, -10, 18, -6, 1}, {1, -8, 0, 8, -1}},
      {{35, -104, 114, -56, 11}, {11, -20, 6, 4, -1}, {-1, 16, -30, 16, -1}}};
  const double scale = 1 / (12 * (order == 1 ? period : period * period));
  for (int64_t k = 0; k < n; k++) {
    const int64_t from_end = n - 1 - k, place = std::min<int64_t>({k, from_end, 2});
    const bool back = from_end < 2;
    const double *weights = WEIGHTS[order - 1][place];
    for (int64_t j = 0; j < width; j++) {
      double sum = 0;
      for (int64_t i = 0; i < 5; i++)
        sum += weights[i] * x[width * (back ? n - 1 - i : k - place + i) + j];
      out[width * k + j] = (back && order == 1 ? -scale : scale) * sum;
    }
  }
}

// Attitude out (n, 4) integrated from the gyro (n, 3) rad/s, from `start` on, and levelled over
// `time` s by the specific force (n, 3) (R. Mahony, T. Hamel, J.-M. Pflimlin, IEEE Transactions on
// Automatic Control 53, 2008)
inline void level_attitude(int64_t n, const double (*gyro)[3], const double (*force)[3], double dt,
                           double time, const double *start, double (*out)[4]) {
  std::copy_n(start, 4, out[0]);
  for (int64_t k = 0; k + 1 < n; k++) {
    double R[3][3], w[3];
    const double *f = force[k], *up = R[2];
    double scale = 1 / (time * (root(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]) + 1e-9));
    matrix_of(out[k], R);
    for (int i = 0; i < 3; i++) {
      int u = (i + 1) % 3, v = (i + 2) % 3;
      w[i] = gyro[k][i] + scale * (f[u] * up[v] - f[v] * up[u]);
    }
    turn_body(out[k], w, dt, out[k + 1]);
    normalise(out[k + 1]);
  }
}

// error state: attitude, velocity, position, gyro bias, accelerometer bias, three each
constexpr int INERTIAL = 15, INERTIAL_VELOCITY = 3, INERTIAL_POSITION = 6;
using InertialState = double[INERTIAL];
using InertialMatrix = double[INERTIAL][INERTIAL];

// Measurements of three of the states from `first` on, sorted by knot; positions are `late` s
// behind the knot
struct InertialReadings {
  int64_t count;
  const int64_t *knots, *firsts;
  const double *late, (*off)[3], *variances;
};

// out = A B, or A B'
template <bool TRANSPOSED>
inline void product(const InertialMatrix A, const InertialMatrix B, InertialMatrix out) {
  for (int i = 0; i < INERTIAL; i++) {
    for (int j = 0; j < INERTIAL; j++) out[i][j] = 0;
    for (int k = 0; k < INERTIAL; k++)
      for (int j = 0; j < INERTIAL; j++) out[i][j] += A[i][k] * (TRANSPOSED ? B[j][k] : B[k][j]);
  }
}

inline void take_reading(const InertialReadings &z, int64_t at, InertialState x, InertialMatrix P) {
  int first = int(z.firsts[at]);
  double late = first == INERTIAL_POSITION ? z.late[at] : 0;
  for (int i = 0; i < 3; i++) {
    double c[INERTIAL];
    int u = first + i, v = INERTIAL_VELOCITY + i;
    for (int j = 0; j < INERTIAL; j++) c[j] = P[j][u] + late * P[j][v];
    double variance = c[u] + late * c[v] + z.variances[at];
    double miss = z.off[at][i] - (x[u] + late * x[v]);
    for (int j = 0; j < INERTIAL; j++) {
      double gain = c[j] / variance;
      x[j] += gain * miss;
      for (int k = 0; k < INERTIAL; k++) P[j][k] -= gain * c[k];
    }
  }
}

// Smoothed error state x (m, 15) about a nominal motion, and its standard deviations: forwards and
// back (H. E. Rauch, F. Tung, C. T. Striebel, 1965). F and defect: from each knot to the next; x
// and std hold the prior in their first rows. False where a covariance is singular
inline bool smooth_motion(int64_t m, const InertialMatrix *F, const InertialState *defect,
                          const double *noise, const InertialReadings &z, InertialState *x,
                          InertialState *std) {
  struct Knot {
    InertialState mean, before;
    InertialMatrix P, spread;  // after its readings, and before
  };
  std::vector<Knot> knots(m);
  InertialMatrix A, B, C;
  int64_t at = 0;
  for (int64_t k = 0; k < m; k++) {
    Knot &here = knots[k];
    if (k == 0) {
      for (int i = 0; i < INERTIAL; i++)
        here.before[i] = x[0][i], here.spread[i][i] = std[0][i] * std[0][i];
    } else {
      const Knot &last = knots[k - 1];
      product<false>(F[k - 1], last.P, A);
      product<true>(A, F[k - 1], here.spread);
      for (int i = 0; i < INERTIAL; i++) {
        double moved = 0;
        for (int j = 0; j < INERTIAL; j++) moved += F[k - 1][i][j] * last.mean[j];
        here.before[i] = moved + defect[k - 1][i];
        here.spread[i][i] += noise[i];
      }
    }
    std::copy_n(here.before, INERTIAL, here.mean);
    std::copy_n(here.spread[0], INERTIAL * INERTIAL, here.P[0]);
    for (; at < z.count && z.knots[at] == k; at++) take_reading(z, at, here.mean, here.P);
    symmetrise<INERTIAL>(here.P);
  }
  for (int64_t k = m - 1; k >= 0; k--) {
    Knot &here = knots[k];
    if (k < m - 1) {  // here.P and here.mean become the smoothed ones
      const Knot &next = knots[k + 1];
      double miss[INERTIAL];
      product<false>(F[k], here.P, A);
      if (!solve(INERTIAL, Numbers(next.spread[0], next.spread[0] + INERTIAL * INERTIAL), INERTIAL,
                 A[0]))
        return false;
      for (int i = 0; i < INERTIAL; i++) {
        miss[i] = next.mean[i] - next.before[i];
        for (int j = 0; j < INERTIAL; j++) {
          B[i][j] = A[j][i];  // the gain
          C[i][j] = next.P[i][j] - next.spread[i][j];
        }
      }
      product<false>(B, C, A);
      product<true>(A, B, C);
      for (int i = 0; i < INERTIAL; i++)
        for (int j = 0; j < INERTIAL; j++) {
          here.mean[i] += B[i][j] * miss[j];
          here.P[i][j] += C[i][j];
        }
      symmetrise<INERTIAL>(here.P);
    }
    for (int i = 0; i < INERTIAL; i++) {
      x[k][i] = here.mean[i];
      std[k][i] = std::sqrt(std::max(here.P[i][i], 0.0));
    }
  }
  return true;
}

}  // namespace windwrench
