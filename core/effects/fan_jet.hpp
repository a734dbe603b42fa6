// Fan jet: dynamics/effects/fan_jet.py has the equation in words.
#pragma once
#include "../mean_jet.hpp"
#include "parts.hpp"

namespace windwrench {

constexpr int HULL_STATIONS = 8;  // on a ring of 0.26 m: x, and y two stations on
constexpr double HULL_X[HULL_STATIONS] = {0.26,  0.1838477631085024,  0, -0.1838477631085024,
                                          -0.26, -0.1838477631085024, 0, 0.1838477631085024};

// Axial and radial speed of a jet with u0 = 1 over a grid of distances and radii, (COUNT_X,
// COUNT_R) each. The program that uses the effect has the table: dynamics/mean_jet.py makes it
template <class S> struct JetTable {
  const S *axial, *radial;
};
template <class S> JetTable<S> jet_table();
template <> JetTable<double> jet_table<double>();
template <> JetTable<float> jet_table<float>();

// speeds at a distance and a radius, m: bilinear; none outside the grid
template <class T>
void look_up(const JetTable<Single<T>> &table, T distance, T radius, T &axial, T &radial) {
  using S = Single<T>;
  T row = (distance - S(FIRST_X)) / S(STEP_X), column = radius / S(STEP_R);
  axial = radial = T{};
  for (int n = 0; n < lanes_of<T>; n++) {
    S x = number_of(row, n), y = number_of(column, n);
    if (!(x >= S(0) && x < S(COUNT_X - 1) && y < S(COUNT_R - 1))) continue;
    S i = rounded_down(x), j = rounded_down(y);
    lane_of(&axial, n)[0] = between(table.axial, i, j, x - i, y - j);
    lane_of(&radial, n)[0] = between(table.radial, i, j, x - i, y - j);
  }
}

// c: u0 m/s, x, y, z m, heading rad, kd N/(m/s), area m2
template <class T, class C>
void fan_jet(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w) {
  using S = Single<T>;
  const JetTable<S> table = jet_table<S>();
  C cos_heading = cosine(c[4]), sin_heading = sine(c[4]);
  C hull = Single<C>(0.5 * AIR_DENSITY) * c[6] / Single<C>(HULL_STATIONS);
  for (int n = 0; n < 4 + HULL_STATIONS; n++) {
    C r[3] = {};
    if (n < 4) {
      rotor_place(v, n, C{}, r);
    } else {
      r[0] = C{} + Single<C>(HULL_X[n - 4]);
      r[1] = C{} + Single<C>(HULL_X[(n + 2) % HULL_STATIONS]);
    }
    // the station as seen from the fan: distance along its axis, and offset across it
    T p[3], wind[3], u[3], f[3];
    for (int i = 0; i < 3; i++)
      p[i] = s.position[i] + s.rotation[i][0] * r[0] + s.rotation[i][1] * r[1] +
             s.rotation[i][2] * r[2] - c[1 + i];
    T distance = cos_heading * p[0] + sin_heading * p[1],
      dy = cos_heading * p[1] - sin_heading * p[0];
    T radius = root(dy * dy + p[2] * p[2]), axial, radial;
    look_up(table, distance, radius, axial, radial);
    axial *= c[0];
    radial *= choose(radius > T{} + S(1e-9), c[0] / radius, T{});
    // relative to the vehicle, in body axes
    wind[0] = cos_heading * axial - sin_heading * radial * dy - s.velocity[0];
    wind[1] = sin_heading * axial + cos_heading * radial * dy - s.velocity[1];
    wind[2] = radial * p[2] - s.velocity[2];
    for (int i = 0; i < 3; i++) {
      int j = (i + 1) % 3, k = (i + 2) % 3;
      u[i] = s.rotation[0][i] * wind[0] + s.rotation[1][i] * wind[1] + s.rotation[2][i] * wind[2] -
             (s.rate[j] * r[k] - s.rate[k] * r[j]);
    }
    T scale = hull * root(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
    for (int i = 0; i < 3; i++) f[i] = n >= 4 ? scale * u[i] : i < 2 ? c[5] * u[i] : T{};
    add_force_at(v, s, r, f, w);
  }
}

}  // namespace windwrench
