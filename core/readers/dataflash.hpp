// The messages of an ArduPilot log (DataFlash .BIN): each begins with A3 95 and its type's number,
// and messages of type 128, FMT, state the lengths of the others.
#pragma once
#include <cstdint>

namespace windwrench::dataflash {

constexpr int64_t HEAD = 3, FMT = 128, FMT_LENGTH = 89;  // bytes, type, bytes

struct Count {
  int64_t messages, bytes;
};

// Note the places and types of all messages; other bytes are passed one by one
inline Count walk(const uint8_t *data, int64_t size, int32_t *places, uint8_t *kinds) {
  int64_t lengths[256] = {};
  lengths[FMT] = FMT_LENGTH;
  Count n = {0, 0};
  for (int64_t place = 0; place + HEAD <= size;) {
    uint8_t kind = data[place + 2];
    int64_t length = lengths[kind];
    bool is_begin = data[place] == 0xA3 && data[place + 1] == 0x95;
    if (!is_begin || length < HEAD || place + length > size) {
      place++;
      continue;
    }
    if (kind == FMT) {
      lengths[data[place + 3]] = data[place + 4];
      lengths[FMT] = FMT_LENGTH;
    }
    places[n.messages] = int32_t(place);
    kinds[n.messages++] = kind;
    place += length;
    n.bytes += length;
  }
  return n;
}

}  // namespace windwrench::dataflash
