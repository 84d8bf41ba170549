#include "abbe/protocol/position_record.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/protocol/bytes.hpp"

namespace abbe::protocol {
namespace {

constexpr std::uint32_t kMagic = 0x50424241;  // "ABBP"
constexpr std::uint16_t kVersion = 1, kHomed = 1;
constexpr std::uint32_t kShortest_ns = 10'000, kLongest_ns = 100'000'000;

}  // namespace

std::array<std::byte, kPositionRecordBytes> encode(const PositionRecord& record) {
  std::array<std::byte, kPositionRecordBytes> datagram{};
  ByteWriter out(datagram);
  out.little(kMagic);
  out.little(kVersion);
  out.little(static_cast<std::uint16_t>(record.homed ? kHomed : 0));
  out.little(record.cycle);
  out.little(record.period_ns);
  for (const double position_m : record.position_m) out.little(position_m);
  return datagram;
}

std::optional<PositionRecord> decode_position_record(std::span<const std::byte> datagram) {
  ByteReader in(datagram);
  const auto magic = in.little<std::uint32_t>();
  const auto version = in.little<std::uint16_t>(), flags = in.little<std::uint16_t>();
  PositionRecord record{.homed = (flags & kHomed) != 0};
  record.cycle = in.little<std::uint32_t>();
  record.period_ns = in.little<std::uint32_t>();
  for (double& position_m : record.position_m) position_m = in.little<double>();

  const bool sound =
      in.ok() && in.remaining() == 0 && magic == kMagic && version == kVersion &&
      (flags & ~kHomed) == 0 && record.period_ns >= kShortest_ns &&
      record.period_ns <= kLongest_ns &&
      std::ranges::all_of(record.position_m, [](double p_m) { return std::isfinite(p_m); });
  return sound ? std::optional(record) : std::nullopt;
}

}  // namespace abbe::protocol
