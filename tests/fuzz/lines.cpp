// Any bytes, read as lines of a sender: nothing may read past an end, and a value that decodes is
// finite and within its limit. The first two bytes choose separator, decimal sign, columns, content
// and the size of the reads.
// libFuzzer: -max_len=2048
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>

#include "abbe/drivers/lines/receiver.hpp"

namespace {

namespace drivers = abbe::drivers;
namespace lines = abbe::protocol::lines;
using lines::Column;
using lines::ColumnUse;

constexpr double kLargestPosition = 10.0;

void set_columns(std::uint8_t choice, lines::LineFormat& format) {
  const bool spherical = (choice & 1u) != 0;
  format.columns =
      spherical
          ? std::array<Column, lines::LineFormat::kMostColumns>{Column::Time, Column::Range,
                                                                Column::Azimuth, Column::Zenith,
                                                                Column::Status}
          : std::array<Column, lines::LineFormat::kMostColumns>{Column::X, Column::Y, Column::Z,
                                                                Column::Ignored, Column::Time};
}

/// With a time and a status, or with neither; the word "-" is no value.
void set_columns(std::uint8_t choice, lines::ValueFormat& format) {
  for (std::uint8_t i = 0; i < 3; ++i)
    format.columns[1u + i] = {.use = ColumnUse::Value,
                              .value = i,
                              .scale = -1e-3,
                              .offset = 0.5,
                              .limit = kLargestPosition};
  if ((choice & 1u) != 0) {
    format.columns[0].use = ColumnUse::Time;
    format.columns[4].use = ColumnUse::Status;
  }
  format.value_count = 3;
  format.no_value[0] = lines::StatusWord::from("-").value();
  format.no_value_count = 1;
}

template <class Format>
Format format_of(std::uint8_t choice) {
  Format format;
  set_columns(choice, format);
  format.column_count = 5;
  constexpr std::array<char, 4> kSeparators{' ', ';', ',', '\t'};
  format.separator = kSeparators[(choice >> 1u) % 4];
  format.decimal_sign = (choice & 8u) != 0 && format.separator != ',' ? ',' : '.';
  format.time_unit = static_cast<lines::TimeUnit>((choice >> 4u) % 4);
  format.valid_status[0] = lines::StatusWord::from("0").value();
  format.valid_status_count = 1;
  return format;
}

void check(bool holds) {
  if (!holds) std::abort();
}

void check_sample(const abbe::protocol::TrackerPoint& point) {
  for (const double p : point.p_tracker_m)
    check(std::abs(p) <= lines::kLargestCoordinate_m * (1.0 + 1e-12));
}
void check_sample(const abbe::protocol::AxisSample& sample) {
  for (const double p : sample.position) check(std::abs(p) <= kLargestPosition);
}

template <class Content>
void receive(std::uint8_t choice, std::uint8_t reads, std::span<const std::byte> bytes) {
  drivers::LineReceiverOptionsOf<Content> options;
  options.format = format_of<typename Content::Format>(choice);
  options.datagrams = (reads & 1u) != 0;
  options.begins_anywhere = (reads & 2u) != 0;
  options.time_separation = std::chrono::milliseconds{2};
  const auto receiver = std::make_unique<drivers::LineReceiverOf<Content>>(options);
  const std::size_t most = 1 + (reads >> 2u) * 8u;
  abbe::protocol::HostTime arrival{std::chrono::hours{1}};
  receiver->push({}, arrival);

  while (!bytes.empty()) {
    const auto part = bytes.first(std::min(bytes.size(), most));
    bytes = bytes.subspan(part.size());
    receiver->push(part, arrival += std::chrono::milliseconds{2});
    for (auto samples = receiver->next(); !samples.empty(); samples = receiver->next())
      for (const auto& sample : samples) check_sample(sample);
  }
  check(receiver->unreadable().text().size() <= receiver->unreadable().begin.size());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const auto bytes = std::as_bytes(std::span{data + 2, size - 2});
  if ((data[0] & 64u) != 0)
    receive<drivers::LineAxes>(data[0], data[1], bytes);
  else
    receive<drivers::LinePoints>(data[0], data[1], bytes);
  return 0;
}
