// Numbers of a text table, as a program writes them: fields between separators, decimal points.
#pragma once
#include <cmath>
#include <cstdint>

namespace windwrench::text_table {

constexpr int MOST_DIGITS = 19;    // of a whole number in 64 bits
constexpr int MOST_EXPONENT = 27;  // of a power of 5 in 63 bits
using Wide = unsigned __int128;

struct Count {
  int64_t rows, bytes;
};

inline int bits_of(Wide x) {
  uint64_t high = uint64_t(x >> 64), low = uint64_t(x);
  return high ? 128 - __builtin_clzll(high) : low ? 64 - __builtin_clzll(low) : 0;
}

// digits * 10^exponent, rounded to the nearest, ties to even, as Python's float
inline double scaled(uint64_t digits, int exponent) {
  uint64_t power = 1;
  for (int i = 0; i < (exponent < 0 ? -exponent : exponent); i++) power *= 5;
  Wide value;
  int shift = exponent;
  bool is_more = false;  // beyond the bits of value
  if (exponent >= 0) {
    value = Wide(digits) * power;
  } else {
    int up = 127 - bits_of(digits);
    Wide top = Wide(digits) << up;
    value = top / power;
    is_more = value * power != top;
    shift -= up;
  }
  int over = bits_of(value) - 53;
  if (over > 0) {
    Wide rest = value & ((Wide(1) << over) - 1), half = Wide(1) << (over - 1);
    value >>= over;
    shift += over;
    value += rest > half || (rest == half && (is_more || (value & 1)));
  }
  return std::ldexp(double(uint64_t(value)), shift);
}

// Read a field, up to `end`; false: no plain number. An empty field and nan are NaN
inline bool number(const uint8_t *at, const uint8_t *end, double *out) {
  static const double TENS[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
  while (at < end && *at == ' ') at++;
  while (at < end && end[-1] == ' ') end--;
  if (at == end ||
      (end - at == 3 && (at[0] | 32) == 'n' && (at[1] | 32) == 'a' && (at[2] | 32) == 'n')) {
    *out = std::nan("");
    return true;
  }
  bool is_negative = *at == '-', has_digit = false, is_behind = false;
  if (*at == '-' || *at == '+') at++;
  uint64_t digits = 0;
  int count = 0, exponent = 0;
  for (; at < end; at++) {
    if (*at == '.' && !is_behind) {
      is_behind = true;
      continue;
    }
    if (*at < '0' || *at > '9') break;
    has_digit = true;
    count += count || *at != '0';
    if (count > MOST_DIGITS) return false;
    digits = 10 * digits + (*at - '0');
    exponent -= is_behind;
  }
  if (!has_digit) return false;
  if (at < end) {
    if ((*at | 32) != 'e' || ++at == end) return false;
    bool is_below = *at == '-';
    if (*at == '-' || *at == '+') at++;
    if (at == end || end - at > 3) return false;
    int stated = 0;
    for (; at < end; at++) {
      if (*at < '0' || *at > '9') return false;
      stated = 10 * stated + (*at - '0');
    }
    exponent += is_below ? -stated : stated;
  }
  double value;
  if (!digits) value = 0.0;
  else if (exponent < -MOST_EXPONENT || exponent > MOST_EXPONENT) return false;
  else if (digits >> 53 == 0 && exponent >= -22 && exponent <= 22)
    value = exponent < 0 ? double(digits) / TENS[-exponent] : double(digits) * TENS[exponent];
  else value = scaled(digits, exponent);
  *out = is_negative ? -value : value;
  return true;
}

// Read whole lines of `width` fields: field i into out[slots[i] * stride + row], none below 0. End
// behind `most` rows, or before the first line of another form
inline Count read(const uint8_t *data, int64_t size, uint8_t separator, const int64_t *slots,
                  int64_t width, double *out, int64_t stride, int64_t most) {
  Count done = {0, 0};
  while (done.bytes < size && done.rows < most) {
    const uint8_t *at = data + done.bytes, *end = data + size;
    int64_t field = 0;
    bool is_blank = true;
    for (bool is_last = false; !is_last; field++) {
      const uint8_t *begin = at;
      while (at < end && *at != separator && *at != '\n' && *at != '"') at++;
      if ((at < end && *at == '"') || field >= width) return done;
      is_last = at == end || *at == '\n';
      for (const uint8_t *x = begin; is_blank && x < at; x++) is_blank = *x <= ' ';
      if (is_last && (field + 1 < width || is_blank)) return done;
      int64_t slot = slots[field];
      if (slot >= 0 && !number(begin, at, out + slot * stride + done.rows)) return done;
      at += at < end;
    }
    done.bytes = at - data;
    done.rows++;
  }
  return done;
}

}  // namespace windwrench::text_table
