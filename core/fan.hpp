// The fan of the environment: its jet with gusts, and the drag of a vehicle in the jet. The mean
// jet: mean_jet.hpp.
#pragma once
#include "mean_jet.hpp"
#include "rigid_body.hpp"

namespace windwrench {

constexpr int STATIONS = 12;  // points of drag: four rotors and a ring of eight on the hull

// The fan's memory. `Fan<double>` is what Python sees as a NumPy record (envs/fan.py)
template <class T> struct Fan {
  using S = Single<T>;
  T speed, height;               // m/s, m
  S turbulence;                  // standard deviation of the gusts, of the local axial speed
  T rotor_drag, hull_area;       // N/(m/s), m2
  S keep;                        // share of a gust left after a tick
  S mixing[STATIONS][STATIONS];  // lower root of the correlation between stations
  S stations[STATIONS][3];       // m, body frame, from the geometric centre
  T gusts[STATIONS][3];          // unit variance
  T y;                           // m, where the fan is
  int64_t blown;                 // whether other winds blow
  T air[STATIONS][3];            // m/s, theirs at the stations, world
};

// The mean wind at a point (3) m of the world, out (3) m/s; jet: tables of axial and radial speed
template <class T> void jet_at(const Fan<T> &f, const Single<T> *jet, const T *point, T *wind) {
  using S = Single<T>;
  T dy = point[1] - f.y, dz = point[2] - f.height, none = T{}, one = T{} + S(1);
  T r = root(dy * dy + dz * dz);
  T row = (point[0] - S(FIRST_X)) / S(STEP_X), column = r / S(STEP_R);
  auto inside = (row >= none) & (row < none + S(COUNT_X - 1)) & (column < none + S(COUNT_R - 1)) &
                (f.speed > none);
  if (!any(inside)) {
    wind[0] = wind[1] = wind[2] = none;
    return;
  }
  // without a jet any place of the table will do
  row = choose(inside, row, none), column = choose(inside, column, none);
  T i = rounded_down(row), j = rounded_down(column), a = row - i, b = column - j;
  T u = between(jet, i, j, a, b), v = between(jet + COUNT_X * COUNT_R, i, j, a, b);
  auto off = inside & (r > none + S(1e-9));
  T scale = choose(off, f.speed * v / choose(off, r, one), none);
  wind[0] = choose(inside, f.speed * u, none);
  wind[1] = choose(inside, scale * dy, none);
  wind[2] = choose(inside, scale * dz, none);
}

// Let the gusts at the stations age by one tick; noise: 36 unit normals
template <class T> void gust(Fan<T> &f, const T *noise) {
  Single<T> fresh = root(Single<T>(1) - f.keep * f.keep);
  for (int i = 0; i < STATIONS; i++) {
    for (int a = 0; a < 3; a++) {
      T total = T{};
      for (int j = 0; j <= i; j++) total += f.mixing[i][j] * noise[3 * j + a];
      f.gusts[i][a] = f.keep * f.gusts[i][a] + fresh * total;
    }
  }
}

// Force and torque about the centre of mass (3, body), out (6), world, of the wind on a vehicle at
// a position (3) and attitude R. Drag acts at the stations, each in its own wind: so a symmetric
// vehicle feels a torque as the jet falls off across its span. velocity (6): the geometric
// centre's in the world, and the angular velocity in the body frame
template <class T, class C>
void jet_wrench(const Fan<T> &f, const Single<T> *jet, const T *position, const T R[3][3],
                const T *velocity, const C *com, T *out) {
  using S = Single<T>;
  const T *w = velocity + 3;
  T turning[3], centre[3];
  for (int a = 0; a < 3; a++) {
    turning[a] = row_times(R[a], w[0], w[1], w[2]);
    centre[a] = R[a][0] * com[0] + R[a][1] * com[1] + R[a][2] * com[2];
  }
  for (int i = 0; i < 6; i++) out[i] = T{};
  T hull = S(0.5) * S(AIR_DENSITY) * f.hull_area / S(STATIONS - 4);
  for (int i = 0; i < STATIONS; i++) {
    const S *s = f.stations[i];
    T at[3], point[3], wind[3], u[3], force[3];
    for (int a = 0; a < 3; a++) {
      at[a] = R[a][0] * s[0] + R[a][1] * s[1] + R[a][2] * s[2];
      point[a] = position[a] + at[a];
    }
    jet_at(f, jet, point, wind);
    T strength = f.turbulence * wind[0];
    for (int a = 0; a < 3; a++) {
      int b = (a + 1) % 3, c = (a + 2) % 3;
      u[a] = wind[a] + strength * f.gusts[i][a] + f.air[i][a] - velocity[a] -
             (turning[b] * at[c] - turning[c] * at[b]);
    }
    if (i < 4) {
      T along = R[0][2] * u[0] + R[1][2] * u[1] + R[2][2] * u[2];
      for (int a = 0; a < 3; a++) force[a] = f.rotor_drag * (u[a] - along * R[a][2]);
    } else {
      T scale = hull * root(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
      for (int a = 0; a < 3; a++) force[a] = scale * u[a];
    }
    for (int a = 0; a < 3; a++) {
      at[a] -= centre[a];
      out[a] += force[a];
    }
    for (int a = 0; a < 3; a++) {
      int b = (a + 1) % 3, c = (a + 2) % 3;
      out[3 + a] += at[b] * force[c] - at[c] * force[b];
    }
  }
}

}  // namespace windwrench
