// Winds: velocity fields of the air. Formula and parameters of each; the parameters are what Python
// sees as NumPy records (envs/wind). A formula adds to velocities (3, count) m/s, world, at points
// (3, count) m and a time in s.
#pragma once
#include "mean_jet.hpp"
#include "rotation.hpp"

namespace windwrench {

using WindFormula = void (*)(const void *parameters, int64_t count, double time,
                             const double *points, double *velocities);

// A wind that blows: its formula, and the formula's parameters
struct WindCall {
  WindFormula formula;
  const void *parameters;
};

inline void add_winds(const WindCall *winds, int64_t number, int64_t count, double time,
                      const double *points, double *velocities) {
  for (int64_t k = 0; k < number; k++)
    winds[k].formula(winds[k].parameters, count, time, points, velocities);
}

// A formula of its own parameters as a `WindFormula`
template <class P, void formula(const P &, int64_t, double, const double *, double *)>
void blow(const void *parameters, int64_t count, double time, const double *points,
          double *velocities) {
  formula(*static_cast<const P *>(parameters), count, time, points, velocities);
}

// A uniform wind, one that grows with height, or a single travelling gust
struct SteadyWind {
  double velocity[3];                  // m/s, at the reference height; of a gust, its largest
  int64_t law;                         // 0: none, 1: logarithm, 2: power
  double reference, roughness, floor;  // m; of the power law its exponent; m, the lowest height
  double travel[3], front[3], speed,
      start;      // direction; m, place of the front at the start; m/s; s
  double length;  // m, of the rise; 0: no gust
  int64_t falls;
};

// The share of a gust of the form 1 - cos at a share of its length behind its front
inline double gust_share(double inside, bool falls) {
  const double pi = 3.141592653589793;
  if (inside <= 0.0) return 0.0;
  if (inside < 1.0 || (falls && inside < 2.0)) return 0.5 * (1.0 - std::cos(pi * inside));
  return falls ? 0.0 : 1.0;
}

inline void add_steady(const SteadyWind &w, int64_t count, double time, const double *points,
                       double *velocities) {
  for (int64_t j = 0; j < count; j++) {
    const double p[3] = {points[j], points[count + j], points[2 * count + j]};
    double scale = 1.0, height = larger(p[2], w.floor);
    if (w.law == 1)
      scale = larger(std::log(height / w.roughness), 0.0) / std::log(w.reference / w.roughness);
    else if (w.law == 2) scale = std::pow(height / w.reference, w.roughness);
    if (w.length > 0.0) {
      double ahead = 0.0;
      for (int i = 0; i < 3; i++) ahead += w.travel[i] * (p[i] - w.front[i]);
      scale = gust_share((w.speed * (time - w.start) - ahead) / w.length, w.falls > 0);
    }
    for (int i = 0; i < 3; i++) velocities[i * count + j] += scale * w.velocity[i];
  }
}

// A frozen field of plane waves that is carried along
struct PlaneWaves {
  const double (*waves)[7];  // wave number (3) in turns a m, phase in turns, amplitude (3) in m/s
  int64_t count;
  double advection[3];  // m/s
};

// cos(2 pi s) of -1/2 <= s <= 1/2 by powers of s^2, right to 1e-10: (-1)^n (2 pi)^2n / (2n)!
constexpr double COSINE_POWERS[12] = {1.0,
                                      -19.739208802178716,
                                      64.93939402266828,
                                      -85.45681720669371,
                                      60.24464137187664,
                                      -26.426256783374388,
                                      7.903536371318465,
                                      -1.7143907110886711,
                                      0.282005968455791,
                                      -0.03638284114254564,
                                      0.0037798342006800365,
                                      -0.0003229910672070975};

inline void add_waves(const PlaneWaves &w, int64_t count, double time, const double *points,
                      double *velocities) {
  const double *x = points, *y = points + count, *z = points + 2 * count;
  double *__restrict u = velocities, *__restrict v = velocities + count,
                     *__restrict up = velocities + 2 * count;
  for (int64_t m = 0; m < w.count; m++) {
    const double *k = w.waves[m], kx = k[0], ky = k[1], kz = k[2], ax = k[4], ay = k[5], az = k[6];
    double begin = k[3] - time * (kx * w.advection[0] + ky * w.advection[1] + kz * w.advection[2]);
    begin -= std::floor(begin);
    for (int64_t j = 0; j < count; j++) {
      double s = begin + kx * x[j] + ky * y[j] + kz * z[j];
      s -= std::floor(s + 0.5);
      double square = s * s, c = COSINE_POWERS[11];
      for (int n = 10; n >= 0; n--) c = c * square + COSINE_POWERS[n];
      u[j] += ax * c;
      v[j] += ay * c;
      up[j] += az * c;
    }
  }
}

// Rotors whose places and speeds change. The momentum fluxes of overlapping jets add,
// u^2 = sum u_i^2 (Reichardt's hypothesis, also behind the mean jet); the air drawn in adds as
// velocity
struct Jets {
  const double *axial, *radial;  // the jet's tables
  const double (*places)[3];     // (place_steps, jets) m
  const double *speeds;          // (steps, jets) m/s
  const double (*waves)[7];      // of the gusts
  int64_t place_steps, steps, jets, wave_count;
  double axes[3][3];    // rows: the jets' axes in the world, the one along the jets first
  double advection[3];  // m/s, of the gusts
};

constexpr double TABLE_PERIOD = 0.02;  // s, of the tables of places and speeds
constexpr double SLOWEST = 1e-3;       // m/s, at which a jet counts as off
constexpr int CHUNK = 32;              // points whose gusts are worked out at once

// What all jets blow at a point, into sum: root of the momentum flux over density along the axes,
// m/s, and the inflow across, m/s
inline void add_up_jets(const Jets &w, const double *point, double time, double *sum) {
  double at = larger(time / TABLE_PERIOD, 0.0), momentum = 0.0;
  at = smaller(at, 1e9);
  int64_t k = int64_t(at), last = w.steps - 1, last_place = w.place_steps - 1;
  double share = at - double(k);
  const double *before = w.speeds + w.jets * smaller(k, last),
               *after = w.speeds + w.jets * smaller(smaller(k, last) + 1, last);
  const double (*from)[3] = w.places + w.jets * smaller(k, last_place);
  const double (*to)[3] = w.places + w.jets * smaller(smaller(k, last_place) + 1, last_place);
  sum[1] = sum[2] = 0.0;
  for (int64_t n = 0; n < w.jets; n++) {
    double speed = (1.0 - share) * before[n] + share * after[n], off[3];
    if (speed < SLOWEST) continue;
    for (int i = 0; i < 3; i++) off[i] = point[i] - (1.0 - share) * from[n][i] - share * to[n][i];
    double x = w.axes[0][0] * off[0] + w.axes[0][1] * off[1] + w.axes[0][2] * off[2];
    double y = w.axes[1][0] * off[0] + w.axes[1][1] * off[1] + w.axes[1][2] * off[2];
    double z = w.axes[2][0] * off[0] + w.axes[2][1] * off[1] + w.axes[2][2] * off[2];
    double r = std::sqrt(y * y + z * z), row = (x - FIRST_X) / STEP_X, column = r / STEP_R;
    if (row < 0.0 || row >= COUNT_X - 1 || column >= COUNT_R - 1) continue;
    double i = std::floor(row), j = std::floor(column), a = row - i, b = column - j;
    double u = between(w.axial, i, j, a, b), v = between(w.radial, i, j, a, b);
    momentum += speed * speed * u * u;
    if (r > 1e-9) {
      sum[1] += speed * v * y / r;
      sum[2] += speed * v * z / r;
    }
  }
  sum[0] = std::sqrt(momentum);
}

inline void add_jets(const Jets &w, int64_t count, double time, const double *points,
                     double *velocities) {
  const PlaneWaves gusts = {
      w.waves, w.wave_count, {w.advection[0], w.advection[1], w.advection[2]}};
  for (int64_t first = 0; first < count; first += CHUNK) {
    int64_t size = smaller(count - first, int64_t(CHUNK));
    double some[3 * CHUNK], gust[3 * CHUNK] = {}, sum[3];
    for (int64_t j = 0; j < 3 * size; j++) some[j] = points[j / size * count + first + j % size];
    add_waves(gusts, size, time, some, gust);
    for (int64_t j = 0; j < size; j++) {
      const double point[3] = {some[j], some[size + j], some[2 * size + j]};
      add_up_jets(w, point, time, sum);
      for (int i = 0; i < 3; i++)
        velocities[i * count + first + j] += w.axes[0][i] * sum[0] + w.axes[1][i] * sum[1] +
                                             w.axes[2][i] * sum[2] + sum[0] * gust[i * size + j];
    }
  }
}

// A wind on a grid in time and space, linear in between; beyond an end as at the end
struct GridWind {
  double first[4], step[4];  // s and m: the grid's beginning, t, x, y, z, and from point to point
  const double (*field)[3];  // m/s
  int64_t counts[4];         // points along each
};

inline void add_grid(const GridWind &w, int64_t count, double time, const double *points,
                     double *velocities) {
  for (int64_t j = 0; j < count; j++) {
    const double place[4] = {time, points[j], points[count + j], points[2 * count + j]};
    int64_t low[4];
    double part[4];
    for (int a = 0; a < 4; a++) {
      double at = larger((place[a] - w.first[a]) / w.step[a], 0.0);
      at = smaller(at, double(w.counts[a] - 1));
      low[a] = smaller(int64_t(at), larger(w.counts[a] - 2, int64_t(0)));
      part[a] = at - double(low[a]);
    }
    for (int corner = 0; corner < 16; corner++) {
      double weight = 1.0;
      int64_t index = 0;
      for (int a = 0; a < 4; a++) {
        int far = corner >> a & 1;
        weight *= far ? part[a] : 1.0 - part[a];
        index = w.counts[a] * index + low[a] + far;
      }
      if (weight == 0.0) continue;
      for (int i = 0; i < 3; i++) velocities[i * count + j] += weight * w.field[index][i];
    }
  }
}

}  // namespace windwrench
