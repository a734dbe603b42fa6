// Arithmetic on covariances: roots, sums of squares.
#pragma once
#include "numbers.hpp"

namespace windwrench {

// least pivot of a row with this variance: rounding may eat the smallest ones, and a tiny positive
// one keeps the filter alive and changes nothing
template <class T> T least_pivot(T variance) {
  using S = Single<T>;
  return S(1e-14) * variance + S(sizeof(S) == 8 ? 1e-300 : 1e-37);
}

// The sum of six products, in pairs
template <class T>
T paired(const T *a, const T *b0, const T *b1, const T *b2, const T *b3, const T *b4, const T *b5,
         int i) {
  return (a[0] * b0[i] + a[1] * b1[i]) + (a[2] * b2[i] + a[3] * b3[i]) +
         (a[4] * b4[i] + a[5] * b5[i]);
}

// Six rows: L out = rows, the diagonal of the lower triangular L being 1 / scales
template <int WIDTH, class T>
void substitute(const T L[6][6], const T *scales, const T rows[][WIDTH], T out[][WIDTH]) {
  for (int i = 0; i < WIDTH; i++) {
    T s0 = rows[0][i] * scales[0];
    T s1 = (rows[1][i] - L[1][0] * s0) * scales[1];
    T s2 = (rows[2][i] - L[2][0] * s0 - L[2][1] * s1) * scales[2];
    T s3 = (rows[3][i] - L[3][0] * s0 - L[3][1] * s1 - L[3][2] * s2) * scales[3];
    T s4 = (rows[4][i] - L[4][0] * s0 - L[4][1] * s1 - L[4][2] * s2 - L[4][3] * s3) * scales[4];
    T s5 = (rows[5][i] - L[5][0] * s0 - L[5][1] * s1 - L[5][2] * s2 - L[5][3] * s3 - L[5][4] * s4) *
           scales[5];
    out[0][i] = s0, out[1][i] = s1, out[2][i] = s2, out[3][i] = s3, out[4][i] = s4, out[5][i] = s5;
  }
}

// P += sign r' r for six rows (WIDTH) in the first SIZE rows and columns of P. Lanes work out half
// of it, and mirror: the other half is the same to the bit
template <int SIZE, int WIDTH, class T>
void add_squares(T P[WIDTH][WIDTH], const T rows[6][WIDTH], Single<T> sign) {
  for (int i = 0; i < SIZE; i++) {
    const T a[6] = {sign * rows[0][i], sign * rows[1][i], sign * rows[2][i],
                    sign * rows[3][i], sign * rows[4][i], sign * rows[5][i]};
    for (int j = is_single<T> ? 0 : i; j < SIZE; j++) {
      T sum = paired(a, rows[0], rows[1], rows[2], rows[3], rows[4], rows[5], j);
      P[i][j] += sum;
      if (!is_single<T> && j > i) P[j][i] += sum;
    }
  }
}

// rows and column i of P scaled down to a variance of `most` where it is larger
template <int WIDTH, class T> void bound_variance(T P[WIDTH][WIDTH], int i, Single<T> most) {
  auto wide = P[i][i] > T{} + most;
  if (any(wide)) {
    T scale = choose(wide, root(most / P[i][i]), T{} + Single<T>(1));
    for (int j = 0; j < WIDTH; j++) {
      P[i][j] *= scale;
      P[j][i] *= scale;
    }
  }
}

template <int WIDTH, class T> void symmetrise(T P[WIDTH][WIDTH]) {
  for (int i = 0; i < WIDTH; i++)
    for (int j = 0; j < i; j++) P[i][j] = P[j][i] = Single<T>(0.5) * (P[i][j] + P[j][i]);
}

// Lower root of P; a pivot eaten by rounding does no harm
template <int SIZE, class S> void root_of(const S P[SIZE][SIZE], S out[SIZE][SIZE]) {
  S column[SIZE];
  for (int j = 0; j < SIZE; j++) {
    for (int i = j; i < SIZE; i++) column[i] = P[i][j];
    for (int k = 0; k < j; k++)  // the columns so far, one a row
      for (int i = j; i < SIZE; i++) column[i] -= out[k][i] * out[k][j];
    out[j][j] = root(larger(column[j], least_pivot(P[j][j])));
    for (int i = j + 1; i < SIZE; i++) out[j][i] = column[i] / out[j][j];
  }
  for (int i = 0; i < SIZE; i++)
    for (int j = 0; j < i; j++) {
      out[i][j] = out[j][i];
      out[j][i] = S(0);
    }
}

// out += a' b, of the first LEFT columns of a, row after row: a column of `out` in a register
template <int ROWS, int LEFT, int RIGHT, class A, class B, class C>
void add_products(const A &a, const B &b, C &out) {
  for (int k = 0; k < ROWS; k++)
    for (int i = 0; i < LEFT; i++)
      for (int j = 0; j < RIGHT; j++) out[i][j] += a[k][i] * b[k][j];
}

// rows = lower^-1 rows
template <int SIZE, int WIDTH, class S>
void divide(const S lower[SIZE][SIZE], S rows[SIZE][WIDTH]) {
  for (int i = 0; i < SIZE; i++) {
    for (int k = 0; k < i; k++)
      for (int j = 0; j < WIDTH; j++) rows[i][j] -= lower[i][k] * rows[k][j];
    S inverse = S(1) / lower[i][i];
    for (int j = 0; j < WIDTH; j++) rows[i][j] *= inverse;
  }
}

// rows = lower'^-1 rows
template <int SIZE, int WIDTH, class S>
void divide_transposed(const S lower[SIZE][SIZE], S rows[SIZE][WIDTH]) {
  for (int i = SIZE - 1; i >= 0; i--) {
    for (int k = i + 1; k < SIZE; k++)
      for (int j = 0; j < WIDTH; j++) rows[i][j] -= lower[k][i] * rows[k][j];
    S inverse = S(1) / lower[i][i];
    for (int j = 0; j < WIDTH; j++) rows[i][j] *= inverse;
  }
}

}  // namespace windwrench
