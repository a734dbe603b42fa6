// Readers of flight logs for Python.
#include "../readers/blackbox.hpp"
#include "../readers/dataflash.hpp"
#include "../readers/text_table.hpp"
#include "filter.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using namespace windwrench;

namespace {

using Bytes = Array<const std::uint8_t, nb::shape<-1>>;
template <class... Shape> using Ints = Array<const std::int64_t, Shape...>;
using Pair = nb::typed<nb::tuple, std::int64_t, std::int64_t>;

Pair decode_blackbox(Bytes data, std::int64_t begin, Ints<nb::shape<6, -1>> encodings,
                     Ints<nb::shape<6, -1>> predictors, Ints<nb::shape<5>> counts,
                     Ints<nb::shape<3>> intervals, Ints<nb::shape<257>> constants,
                     Ints<nb::shape<3>> places, Ints<nb::shape<-1>> keep,
                     Array<std::int64_t, nb::shape<-1, -1>> rows) {
  std::int64_t fields = std::int64_t(encodings.shape(1)), kept = std::int64_t(keep.size());
  if (predictors.shape(1) != encodings.shape(1) || rows.shape(1) != keep.size())
    throw nb::value_error("blackbox: expected a column for each field");
  const blackbox::Layout layout = {
      encodings.data(), predictors.data(), counts.data(), intervals.data(),
      constants.data(), places.data(),     fields};
  blackbox::Count n = blackbox::decode({data.data(), std::int64_t(data.size()), begin}, layout,
                                       keep.data(), kept, rows.data(), std::int64_t(rows.shape(0)));
  return Pair(nb::make_tuple(n.decoded, n.lost));
}

Pair walk_dataflash(Bytes data, Array<std::int32_t, nb::shape<-1>> places,
                    Array<std::uint8_t, nb::shape<-1>> kinds) {
  dataflash::Count n =
      dataflash::walk(data.data(), std::int64_t(data.size()), places.data(), kinds.data());
  return Pair(nb::make_tuple(n.messages, n.bytes));
}

Pair read_text_rows(nb::bytes text, std::int64_t begin, char separator, Ints<nb::shape<-1>> slots,
                    Array<double, nb::shape<-1, -1>> columns, std::int64_t row) {
  std::int64_t size = std::int64_t(text.size()), rows = std::int64_t(columns.shape(1));
  if (begin < 0 || begin > size || row < 0 || row > rows)
    throw nb::value_error("text: expected a place in the text, and a row of the columns");
  for (std::size_t i = 0; i < slots.size(); i++)
    if (slots.data()[i] >= std::int64_t(columns.shape(0)))
      throw nb::value_error("text: expected a column for each slot");
  text_table::Count n =
      text_table::read(reinterpret_cast<const std::uint8_t *>(text.c_str()) + begin, size - begin,
                       std::uint8_t(separator), slots.data(), std::int64_t(slots.size()),
                       columns.data() + row, rows, rows - row);
  return Pair(nb::make_tuple(n.rows, n.bytes));
}

}  // namespace

void bind_readers(nb::module_ &m) {
  m.def("decode_blackbox", &decode_blackbox, "data"_a, "begin"_a, "encodings"_a, "predictors"_a,
        "counts"_a, "intervals"_a, "constants"_a, "places"_a, "keep"_a, "rows"_a,
        "Decode the main frames of a blackbox, its bytes up to the log's end, from `begin` on.\n\n"
        "Of F fields: encodings and predictors (6, F) of I, P, S, G, H and no frames, "
        "their counts of\n"
        "fields (5,), intervals (3,) of I frames and of P frames as a fraction, in loops; the\n"
        "constants (257,) of the predictors; the places (3,) of the fields loopIteration, time "
        "and\n"
        "motor[0], -1 for none. The wanted fields, `keep` (K,), are written into rows (N, K).\n"
        "Return how many frames, of N at most, were decoded, and how many were not.");
  m.def("walk_dataflash", &walk_dataflash, "data"_a, "places"_a, "kinds"_a,
        "Write the places and types of all messages of a DataFlash log, at most one for each "
        "three\n"
        "bytes. Return how many they are, and how many bytes they take.");
  m.def("read_text_rows", &read_text_rows, "text"_a, "begin"_a, "separator"_a, "slots"_a,
        "columns"_a, "row"_a,
        "Read the lines of a text table from byte `begin` on: field i of a line is put into\n"
        "columns (K, N), line slots[i] of them, from row `row` on; none below 0. Reading ends\n"
        "before a line of another number of fields, with quotation marks, without any number, or\n"
        "with a field that is no plain number. Return how many rows and bytes were read.");
}
