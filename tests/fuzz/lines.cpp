// Any bytes, read as lines of a sender: nothing may read past an end, and a point that decodes is
// finite. The first two bytes choose separator, decimal sign, columns and the size of the reads.
// libFuzzer: -max_len=2048
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <memory>
#include <span>

#include "abbe/drivers/lines/receiver.hpp"

namespace {

namespace lines = abbe::protocol::lines;
using lines::Column;

lines::LineFormat format_of(std::uint8_t choice) {
  lines::LineFormat format;
  const bool spherical = (choice & 1u) != 0;
  format.columns =
      spherical
          ? std::array<Column, lines::LineFormat::kMostColumns>{Column::Time, Column::Range,
                                                                Column::Azimuth, Column::Zenith,
                                                                Column::Status}
          : std::array<Column, lines::LineFormat::kMostColumns>{Column::X, Column::Y, Column::Z,
                                                                Column::Ignored, Column::Time};
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

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  abbe::drivers::LineReceiverOptions options;
  options.format = format_of(data[0]);
  options.datagrams = (data[1] & 1u) != 0;
  options.begins_anywhere = (data[1] & 2u) != 0;
  options.time_separation = std::chrono::milliseconds{2};
  const auto receiver = std::make_unique<abbe::drivers::LineReceiver>(options);
  const std::size_t most = 1 + (data[1] >> 2u) * 8u;
  auto bytes = std::as_bytes(std::span{data + 2, size - 2});
  abbe::protocol::HostTime arrival{std::chrono::hours{1}};
  receiver->push({}, arrival);

  while (!bytes.empty()) {
    const auto part = bytes.first(std::min(bytes.size(), most));
    bytes = bytes.subspan(part.size());
    receiver->push(part, arrival += std::chrono::milliseconds{2});
    for (auto points = receiver->next(); !points.empty(); points = receiver->next())
      for (const auto& point : points)
        for (const double p : point.p_tracker_m)
          check(std::abs(p) <= lines::kLargestCoordinate_m * (1.0 + 1e-12));
  }
  check(receiver->unreadable().text().size() <= receiver->unreadable().begin.size());
  return 0;
}
