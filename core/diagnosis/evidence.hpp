// The evidence of a set of effects by Laplace's integral, within bounds:
// identification/diagnosis/evidence.py.
#pragma once
#include <algorithm>
#include <cmath>
#include <vector>

namespace windwrench {

using Numbers = std::vector<double>;

// x (n, columns) = A^-1 x, with pivots; false where A is singular, or holds a NaN
inline bool solve(int n, Numbers A, int columns, double *x) {
  for (int j = 0; j < n; j++) {
    int pivot = j;
    for (int i = j + 1; i < n; i++)
      if (std::fabs(A[i * n + j]) > std::fabs(A[pivot * n + j])) pivot = i;
    if (!(std::fabs(A[pivot * n + j]) > 0)) return false;  // nor a number
    if (pivot != j) {
      std::swap_ranges(&A[j * n], &A[j * n] + n, &A[pivot * n]);
      std::swap_ranges(x + j * columns, x + (j + 1) * columns, x + pivot * columns);
    }
    for (int i = j + 1; i < n; i++) {
      double share = A[i * n + j] / A[j * n + j];
      if (share == 0) continue;
      for (int k = j + 1; k < n; k++) A[i * n + k] -= share * A[j * n + k];
      for (int k = 0; k < columns; k++) x[i * columns + k] -= share * x[j * columns + k];
    }
  }
  for (int i = n - 1; i >= 0; i--)
    for (int k = 0; k < columns; k++) {
      double rest = x[i * columns + k];
      for (int j = i + 1; j < n; j++) rest -= A[i * n + j] * x[j * columns + k];
      x[i * columns + k] = rest / A[i * n + i];
    }
  return true;
}

// out = right - normal x
inline void slope_at(int n, const double *normal, const double *right, const double *x,
                     double *out) {
  for (int i = 0; i < n; i++) {
    out[i] = right[i];
    for (int j = 0; j < n; j++) out[i] -= normal[i * n + j] * x[j];
  }
}

// Maximum x (n) of right x - x normal x / 2 within bounds: coefficients outside are held at their
// bounds, the farthest first, and are free again if pulled back. False where there is none
inline bool bounded_mode(int n, const double *normal, const double *right, const double *low,
                         const double *high, double *x) {
  std::vector<char> held(n, 0);
  Numbers pull(n), left(n), part(n), only_held(n);
  std::copy_n(right, n, x);
  if (!solve(n, Numbers(normal, normal + n * n), 1, x)) return false;
  for (int turn = 0; turn < 3 * n; turn++) {
    int worst = -1, freed = -1;
    double farthest = 0, strongest = 0;
    slope_at(n, normal, right, x, pull.data());
    for (int i = 0; i < n; i++) {
      double beyond = std::max(low[i] - x[i], x[i] - high[i]);
      double size = beyond * std::sqrt(normal[i * n + i]),
             in = x[i] >= high[i] ? -pull[i] : pull[i];
      if (!held[i] && beyond > 1e-12 && size > farthest) worst = i, farthest = size;
      if (held[i] && in > 1e-9 && in > strongest) freed = i, strongest = in;
    }
    if (worst >= 0) {
      held[worst] = 1;
      x[worst] = std::min(std::max(x[worst], low[worst]), high[worst]);
    } else if (freed >= 0) {
      held[freed] = 0;
    } else {
      break;
    }
    std::vector<int> free;
    for (int i = 0; i < n; i++) {
      only_held[i] = held[i] ? x[i] : 0;
      if (!held[i]) free.push_back(i);
    }
    slope_at(n, normal, right, only_held.data(), left.data());
    int count = int(free.size());
    Numbers some(count * count);
    for (int i = 0; i < count; i++) {
      part[i] = left[free[i]];
      for (int j = 0; j < count; j++) some[i * count + j] = normal[free[i] * n + free[j]];
    }
    if (!solve(count, std::move(some), 1, part.data())) return false;
    for (int i = 0; i < count; i++) x[free[i]] = part[i];
  }
  bool known = true;
  for (int i = 0; i < n; i++) {
    known = known && std::isfinite(x[i]);
    x[i] = std::min(std::max(x[i], low[i]), high[i]);
  }
  return known;
}

// share of a standard normal density below x
inline double normal_share(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

// z^2 / 2 plus the logarithm of the share of a standard normal density beyond z, at least zero
inline double log_tail(double z) {
  if (z < 10) return 0.5 * z * z + std::log(normal_share(-z));
  double w = 1 / (z * z);  // M. Abramowitz and I. Stegun, Handbook (1964), 26.2.12
  return -std::log(z * std::sqrt(2 * 3.141592653589793)) + std::log1p(-w * (1 - w * (3 - 15 * w)));
}

// Logarithm of the evidence of n columns of a quadratic log-likelihood with a standard normal prior
// cut off at bounds; the mode, and its standard deviations. NaN where no prior tells columns apart
inline double evidence_of(int n, Numbers normal, const double *right, const double *low,
                          const double *high, double *mode, double *std) {
  for (int i = 0; i < n; i++) normal[i * n + i] += 1;
  Numbers L = normal, slope(n), column(n);
  for (int j = 0; j < n; j++) {
    for (int i = j; i < n; i++) {
      for (int k = 0; k < j; k++) L[i * n + j] -= L[i * n + k] * L[j * n + k];
      if (i == j && !(L[j * n + j] > 0)) return NAN;
      L[i * n + j] = i == j ? std::sqrt(L[j * n + j]) : L[i * n + j] / L[j * n + j];
    }
  }
  if (!bounded_mode(n, normal.data(), right, low, high, mode)) return NAN;
  slope_at(n, normal.data(), right, mode, slope.data());
  double value = 0;
  for (int i = 0; i < n; i++) {
    value += 0.5 * mode[i] * (right[i] + slope[i]) - std::log(L[i * n + i]);
    // int_0^inf exp(-s t - h t^2 / 2) dt over the whole normal integral of curvature h
    if (mode[i] <= low[i] || mode[i] >= high[i])
      value += log_tail(std::fabs(slope[i]) / std::sqrt(normal[i * n + i]));
    value -= std::log(std::max(normal_share(high[i]) - normal_share(low[i]), 1e-12));
    double variance = 0;  // the square of column i of the inverse root
    for (int r = i; r < n; r++) {
      column[r] = r == i ? 1 : 0;
      for (int k = i; k < r; k++) column[r] -= L[r * n + k] * column[k];
      column[r] /= L[r * n + r];
      variance += column[r] * column[r];
    }
    std[i] = std::sqrt(variance);
  }
  return value;
}

}  // namespace windwrench
