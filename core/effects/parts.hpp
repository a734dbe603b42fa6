// Parts that effects share.
#pragma once
#include "../rotation.hpp"
#include "form.hpp"

namespace windwrench {

// where rotor i stands, r (3) m from the geometric centre; `central` (0 to 1) draws it there
template <class C> void rotor_place(const VehicleNumbers<C> &v, int i, C central, C *r) {
  C share = Single<C>(1) - central;
  for (int j = 0; j < 3; j++) r[j] = share * v.rotor[i][j];
}

// velocity through the air, u (3) m/s in body axes, of the body's point r (3) m from the geometric
// centre
template <class T, class C> void air_velocity(const FlightState<T> &s, const C *r, T *u) {
  T air[3];
  for (int i = 0; i < 3; i++) air[i] = s.velocity[i] - s.wind[i];
  for (int i = 0; i < 3; i++) {
    int j = (i + 1) % 3, k = (i + 2) % 3;
    u[i] = s.rotation[0][i] * air[0] + s.rotation[1][i] * air[1] + s.rotation[2][i] * air[2] +
           s.rate[j] * r[k] - s.rate[k] * r[j];
  }
}

// Add a force f (3) N in body axes at the body's point r (3) m from the geometric centre
template <class T, class C>
void add_force_at(const VehicleNumbers<C> &v, const FlightState<T> &s, const C *r, const T *f,
                  Wrench<T> &w) {
  C x = r[0] - v.com[0], y = r[1] - v.com[1], z = r[2] - v.com[2];
  for (int i = 0; i < 3; i++)
    w.force[i] += s.rotation[i][0] * f[0] + s.rotation[i][1] * f[1] + s.rotation[i][2] * f[2];
  w.torque[0] += y * f[2] - z * f[1];
  w.torque[1] += z * f[0] - x * f[2];
  w.torque[2] += x * f[1] - y * f[0];
}

// Add the thrust that rotors gain near a level plane at `height` m; c: strength, central; side: +1
// where they are above the plane and -1 below; there: whether there is one. The distance is no less
// than where thrust doubles
template <class T, class C>
void lift_near_plane(const C *c, const VehicleNumbers<C> &v, const FlightState<T> &s, Wrench<T> &w,
                     C height, Single<T> side, Answer<C> there) {
  using S = Single<T>;
  C radius = S(0.25) * v.rotor_radius, scale = c[0] * (radius * radius), r[3];
  T total = {}, half = T{} + S(0.5);
  for (int i = 0; i < 4; i++) {
    rotor_place(v, i, c[1], r);
    T away = s.position[2] - height;
    away += s.rotation[2][0] * r[0] + s.rotation[2][1] * r[1] + s.rotation[2][2] * r[2];
    away *= side;
    T ratio = choose(away > T{} + S(1e-3), smaller(scale / (away * away), half), half);
    T extra = choose(there, s.thrust[i] * ratio / (S(1) - ratio), T{});
    w.torque[0] += (r[1] - v.com[1]) * extra;
    w.torque[1] -= (r[0] - v.com[0]) * extra;
    total += extra;
  }
  for (int i = 0; i < 3; i++) w.force[i] += s.rotation[i][2] * total;
}

// Turn a quaternion about the world's axes by the rotation vector (rx, ry, rz) rad
template <class T> void turn_attitude(T *q, T rx, T ry, T rz) {
  using S = Single<T>;
  T angle = root(rx * rx + ry * ry + rz * rz), half = S(0.5) * angle, turned[4];
  T scale = choose(angle > T{} + S(1e-12), sine(half) / angle, T{} + S(0.5));
  T turn[4] = {cosine(half), scale * rx, scale * ry, scale * rz};
  multiply(turn, q, turned);
  for (int i = 0; i < 4; i++) q[i] = turned[i];
}

// One lane of an array of numbers
template <class S> struct Strided {
  S *first;
  int stride;
  S &operator[](int i) const { return first[i * stride]; }
  Strided from(int i) const { return {first + i * stride, stride}; }
};
template <class T> Strided<Single<T>> lane_of(T *array, int i) {
  return {reinterpret_cast<Single<T> *>(array) + i, lanes_of<T>};
}
template <class T> Single<T> number_of(T a, int i) {
  if constexpr (is_single<T>) {
    return a;
  } else {
    return a[i];
  }
}

// Put in place of `width` numbers the ones of `wanted` s ago.
//
// memory, the delay line: how many entries, s since the last new one (summed by the caller), and
// the entries: the newest is first, each an age and its numbers. Between entries runs the cubic
// through the nearest four, within their range. A line between two would damp noise by its distance
// from both. The best fit of a noisy log would be the delay with most damping. Four unevenly spaced
// entries get a line; before the oldest the value is held. A delay line fed faster than 200 Hz
// keeps at most 200 entries a second.
template <class S>
void delay(Strided<S> memory, int width, int capacity, S wanted, Strided<S> values) {
  const S spacing = S(0.0045);  // s, least time between two kept entries
  const S even = S(2.5);        // largest ratio of steps for a cubic through all four
  int size = width + 1, count = int(memory[0]);
  for (int j = 0; j < count; j++) memory[2 + j * size] += memory[1];
  memory[1] = S(0);
  if (count < 2 || memory[2 + size] >= spacing) {
    count = count + 1 < capacity ? count + 1 : capacity;
    for (int i = count * size - 1; i >= size; i--) memory[2 + i] = memory[2 + i - size];
    memory[0] = S(count);
  }
  memory[2] = S(0);
  for (int i = 0; i < width; i++) memory[3 + i] = values[i];
  int j = 0;
  while (j < count - 1 && memory[2 + j * size] < wanted) j++;
  Strided<S> here = memory.from(2 + j * size);
  S share = S(0);
  if (j > 0 && here[0] >= wanted) share = (here[0] - wanted) / (here[0] - here[-size]);
  int nearest = j < 2 ? 0 : j - 2, last = count < 4 ? 0 : count - 4;
  Strided<S> e = memory.from(2 + (nearest < last ? nearest : last) * size);
  S weight[4] = {};
  bool cubic = share > S(0) && count >= 4;
  if (cubic) {
    S age[4], longest = S(0), shortest = S(0);
    for (int k = 0; k < 4; k++) age[k] = e[k * size];
    for (int k = 0; k < 3; k++) {
      S step = age[k + 1] - age[k];
      longest = k == 0 ? step : larger(longest, step);
      shortest = k == 0 ? step : smaller(shortest, step);
    }
    cubic = longest <= even * shortest;
    for (int k = 0; k < 4; k++) {  // Lagrange's weights
      S above = S(1), below = S(1);
      for (int other = 0; other < 4; other++)
        if (other != k) {
          above *= wanted - age[other];
          below *= age[k] - age[other];
        }
      weight[k] = above / below;
    }
  }
  for (int i = 0; i < width; i++) {
    S late = here[1 + i];
    if (cubic) {
      S value = S(0), least = e[1 + i], most = least;
      for (int k = 0; k < 4; k++) {
        S known = e[k * size + 1 + i];
        value += weight[k] * known;
        least = smaller(least, known);
        most = larger(most, known);
      }
      values[i] = smaller(larger(value, least), most);
    } else {
      values[i] = share == S(0) ? late : late + share * (here[1 + i - size] - late);
    }
  }
}

}  // namespace windwrench
