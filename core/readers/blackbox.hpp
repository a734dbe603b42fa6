// The frames of a blackbox of Betaflight, INAV or Cleanflight ("Blackbox logging internals" of
// Betaflight's documentation). A frame is a letter and its fields: I stands alone, P builds on the
// two main frames before it; S, G, H and events E are passed over. Undecodable bytes are passed one
// by one, and P frames count again after the next I frame.
#pragma once
#include <cstdint>
#include <cstring>
#include <vector>

namespace windwrench::blackbox {

constexpr int64_t LONGEST = 1024;           // bytes of a frame
constexpr int64_t TOO_DAMAGED = 1'000'000;  // undecodable frames, at most, in a log
constexpr const char LETTERS[] = "IPSGHE";
enum { EVENT = 5 };  // kind of an event, by its place in LETTERS
enum Verdict { FRAME, END, UNKNOWN };

// What a log's header says of its frames; I and P frames have the same fields
struct Layout {
  const int64_t *encodings, *predictors;  // (5, fields) of I, P, S, G and H frames
  const int64_t *counts;                  // (5) fields of each
  const int64_t *intervals;               // (3) of I frames, and fraction of P frames, in loops
  const int64_t *constants;               // (257) what each predictor adds
  const int64_t *places;                  // (3) fields loopIteration, time and motor[0]; -1: none
  int64_t fields;
};

// Spoiled bytes may let numbers grow beyond any bound: they wrap around
inline int64_t plus(int64_t a, int64_t b) { return int64_t(uint64_t(a) + uint64_t(b)); }
inline int64_t minus(int64_t a, int64_t b) { return int64_t(uint64_t(a) - uint64_t(b)); }

inline int64_t with_sign(int64_t value, int bits) {
  return value & (int64_t(1) << (bits - 1)) ? value - (int64_t(1) << bits) : value;
}

inline int kind_of(uint8_t letter) {
  const char *found = letter ? std::strchr(LETTERS, letter) : nullptr;
  return found ? int(found - LETTERS) : -1;
}

struct Bytes {
  const uint8_t *data;
  int64_t size, at;

  // the next byte; behind the end 0, and the place goes on, as a mark
  int64_t byte() {
    int64_t place = at++;
    return place < size ? data[place] : 0;
  }
  int64_t variable() {  // of up to 32 bits, seven a byte
    uint64_t out = 0;
    for (int shift = 0; shift < 35; shift += 7) {
      uint64_t next = uint64_t(byte());
      out |= (next & 0x7F) << shift;
      if (next < 128) return int64_t(out & 0xFFFFFFFF);
    }
    at = size + 1;  // more than 32 bits: no number
    return 0;
  }
  int64_t signed_variable() {
    int64_t value = variable();
    return (value >> 1) ^ -(value & 1);
  }
};

// three fields together, by the first two bits: further bytes, lowest bits, widths in bits
constexpr int EQUAL[3][7] = {{0, 4, 2, 0, 2, 2, 2}, {1, 8, 4, 0, 4, 4, 4}, {2, 16, 8, 0, 6, 6, 6}};
constexpr int VARIABLE[3][7] = {
    {0, 4, 2, 0, 2, 2, 2}, {1, 9, 4, 0, 5, 5, 4}, {2, 14, 7, 0, 8, 7, 7}};

// Three fields, packed as one of three layouts, or of whole bytes each
inline void read_three(Bytes &b, const int layouts[3][7], int64_t *out) {
  int64_t packed = b.byte();
  int kind = int(packed >> 6);
  if (kind == 3) {
    for (int i = 0; i < 3; i++) {
      int width = int((packed >> (2 * i)) & 3) + 1;
      out[i] = 0;
      for (int k = 0; k < width; k++) out[i] |= b.byte() << (8 * k);
      out[i] = with_sign(out[i], 8 * width);
    }
    return;
  }
  const int *of = layouts[kind];
  for (int k = 0; k < of[0]; k++) packed = packed << 8 | b.byte();
  for (int i = 0; i < 3; i++)
    out[i] = with_sign((packed >> of[1 + i]) & ((1 << of[4 + i]) - 1), of[4 + i]);
}

// Four fields of 0, 4, 8 or 16 bits, packed by half bytes
inline void read_four(Bytes &b, int64_t *out) {
  int64_t selector = b.byte(), held = 0;  // held: the byte of which half is left
  bool is_left = false;
  for (int i = 0; i < 4; i++) {
    int halves = (1 << ((selector >> (2 * i)) & 3)) >> 1;
    out[i] = 0;
    for (int k = 0; k < halves; k++) {
      if (!is_left) held = b.byte();
      out[i] = out[i] << 4 | (is_left ? held & 15 : held >> 4);
      is_left = !is_left;
    }
    if (halves) out[i] = with_sign(out[i], 4 * halves);
  }
}

// The fields of a frame as they are coded, alone or in groups
inline void read_fields(Bytes &b, const int64_t *encodings, int64_t count, int64_t *out) {
  for (int64_t i = 0, size; i < count && b.at <= b.size; i += size) {
    int64_t encoding = encodings[i], group[8] = {};
    size = 1;
    if (encoding == 0) group[0] = b.signed_variable();
    else if (encoding == 1) group[0] = b.variable();
    else if (encoding == 3) group[0] = -with_sign(b.variable() & 0x3FFF, 14);
    else if (encoding == 6) {
      while (size < 8 && i + size < count && encodings[i + size] == 6) size++;
      int64_t there = size > 1 ? b.byte() : 1;
      for (int k = 0; k < size; k++) group[k] = there & (1 << k) ? b.signed_variable() : 0;
    } else if (encoding == 7 || encoding == 10) {
      read_three(b, encoding == 10 ? VARIABLE : EQUAL, group);
      size = 3;
    } else if (encoding == 8) {
      read_four(b, group);
      size = 4;
    }
    for (int64_t k = 0; k < size && i + k < count; k++) out[i + k] = group[k];
  }
}

// How many loops after one were not to be recorded
inline int64_t passed_over(int64_t before, const int64_t *intervals) {
  int64_t count = 0;
  for (; count < 1000; count++) {
    int64_t k = plus(before, 1 + count) % intervals[0];
    if (k < 0) k += intervals[0];
    if ((k + intervals[1] - 1) % intervals[2] < intervals[1]) break;
  }
  return count;
}

// Add the predictions to the fields of a main frame
inline void add_predictions(const Layout &of, int kind, const int64_t *before, const int64_t *older,
                            int64_t *out) {
  for (int64_t i = 0; i < of.counts[kind]; i++) {
    int64_t predictor = of.predictors[kind * of.fields + i], said = of.constants[predictor];
    if (predictor == 1) said = before[i];
    else if (predictor == 2) said = minus(plus(before[i], before[i]), older[i]);
    else if (predictor == 3) said = plus(before[i], older[i]) / 2;
    else if (predictor == 5 && of.places[2] >= 0) said = out[of.places[2]];
    else if (predictor == 6) {
      out[i] = 0;
      said = plus(before[i], 1 + passed_over(before[of.places[0]], of.intervals));
    }
    out[i] = plus(out[i], said);
  }
}

inline Verdict pass_event(Bytes &b) {
  int64_t kind = b.byte();
  if (kind == 0 || kind == 15 || kind == 40) {  // beep, disarmed, sensor failure
    b.variable();
  } else if (kind == 14 || kind == 30) {  // recording goes on, flight mode
    b.variable();
    b.variable();
  } else if (kind == 13) {  // adjustment in flight
    if (b.byte() < 128) b.signed_variable();
    else b.at += 4;
  } else {
    return kind == 255 ? END : UNKNOWN;
  }
  return FRAME;
}

struct Count {
  int64_t decoded, lost;  // frames
};

// Decode the main frames of the bytes from b.at on, the wanted fields `keep` (kept) of each into
// `rows` (most, kept)
inline Count decode(Bytes b, const Layout &of, const int64_t *keep, int64_t kept, int64_t *rows,
                    int64_t most) {
  const std::size_t fields = std::size_t(of.fields);
  std::vector<int64_t> out(fields), before(fields), older(fields);
  Count n = {0, 0};
  int64_t place = b.at;
  bool based = false;
  while (place < b.size && n.decoded < most && n.lost < TOO_DAMAGED) {
    int kind = kind_of(b.data[place]);
    Verdict said = FRAME;
    b.at = place + 1;
    if (kind == EVENT) said = pass_event(b);
    else if (kind >= 0 && of.counts[kind] > 0)
      read_fields(b, of.encodings + kind * of.fields, of.counts[kind], out.data());
    else said = UNKNOWN;
    bool good = said != UNKNOWN && b.at <= b.size && b.at - place <= LONGEST;
    if (good && said == FRAME && b.at < b.size)
      good = kind_of(b.data[b.at]) >= 0;  // another frame must follow
    if (!good) {
      n.lost++;
      based = false;
      do place++;
      while (place < b.size && kind_of(b.data[place]) < 0);
      continue;
    }
    if (said == END) break;
    if (kind == 0 || (kind == 1 && based)) {
      add_predictions(of, kind, before.data(), older.data(), out.data());
      older = kind == 0 ? out : before;
      before = out;
      based = true;
      for (int64_t k = 0; k < kept; k++) rows[n.decoded * kept + k] = out[keep[k]];
      n.decoded++;
    } else if (kind == 1) {
      n.lost++;
    }
    place = b.at;
  }
  return n;
}

}  // namespace windwrench::blackbox
