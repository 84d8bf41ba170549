// SPDX-License-Identifier: GPL-2.0-or-later
#include "encoder_frames.hpp"

#include <cmath>
#include <limits>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/can/pdo.hpp"
#include "abbe/protocol/can/udp_framing.hpp"

namespace abbe::linuxcnc {
namespace {

namespace can = protocol::can;

constexpr std::size_t kDatagramBytes = 128;

}  // namespace

std::vector<std::byte> encoder_datagram(const ServoSample& sample, std::uint8_t sequence,
                                        const EncoderBusOptions& options) {
  std::array<std::byte, kDatagramBytes> buffer{};
  can::DatagramWriter writer(buffer, sequence);
  can::CanFrame sync;
  sync.id = can::cob::kSync;
  bool fits = writer.add(sync);

  for (std::size_t joint = 0; joint < kEncoderJoints && sample.homed; ++joint) {
    const double count = std::round(sample.reading_mm(joint) / options.step_mm);
    // NaN is not within the range either.
    if (!(std::abs(count) <= std::numeric_limits<std::int32_t>::max())) continue;
    const auto node =
        static_cast<std::uint32_t>(options.first_node) + static_cast<std::uint32_t>(joint);
    fits = writer.add(can::encode_position(can::cob::kTpdo1 + node, can::PositionType::Signed32,
                                           static_cast<std::int64_t>(count))) &&
           fits;
  }
  if (!fits) return {};

  const auto bytes = writer.finish();
  return {bytes.begin(), bytes.end()};
}

protocol::PositionRecord position_record(const ServoSample& sample, std::uint32_t period_ns) {
  protocol::PositionRecord record{
      .homed = sample.homed, .cycle = sample.number, .period_ns = period_ns, .position_m = {}};
  for (std::size_t joint = 0; joint < kEncoderJoints; ++joint) {
    const double reading_m = 1e-3 * sample.reading_mm(joint);
    record.homed = record.homed && std::isfinite(reading_m);
    record.position_m[joint] = std::isfinite(reading_m) ? reading_m : 0.0;
  }
  return record;
}

std::optional<ServoSample> Decimation::choose(std::span<const ServoSample> read) {
  std::optional<ServoSample> due;
  for (const ServoSample& sample : read) {
    if (due) {
      due.reset();  // a newer sample was waiting already
      ++late_;
    }
    if (sample.number % every_ == 0) due = sample;
  }
  return due;
}

}  // namespace abbe::linuxcnc
