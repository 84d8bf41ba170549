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

using can::ControlCause;

constexpr std::size_t kDatagramBytes = 128;

can::NodeId node_of(const EncoderBusOptions& options, std::size_t joint) {
  return static_cast<can::NodeId>(static_cast<std::size_t>(options.first_node) + joint);
}

double count_of(const ServoSample& sample, std::size_t joint, const EncoderBusOptions& options) {
  return std::round(sample.reading_mm(joint) / options.step_mm);
}

}  // namespace

Causes causes_of(const ServoSample& sample, const EncoderBusOptions& options) {
  Causes causes;
  for (std::size_t joint = 0; joint < kEncoderJoints; ++joint) {
    // the comparison is also false for NaN
    const bool fits = std::abs(count_of(sample, joint, options)) <=
                      double{std::numeric_limits<std::int32_t>::max()};
    if (!sample.homed) {
      causes[joint] = ControlCause::NotHomed;
    } else if (!fits) {
      causes[joint] = ControlCause::NoPosition;
    }
  }
  return causes;
}

std::string describe(const Causes& causes) {
  std::string text;
  for (std::size_t joint = 0; joint < causes.size(); ++joint) {
    if (!causes[joint]) continue;
    // Homing is a state of the whole control, so one text is enough.
    if (causes[joint] == ControlCause::NotHomed)
      return std::string(can::to_text(ControlCause::NotHomed)) + ": abbed receives no positions";
    text += (text.empty() ? "joint " : "; joint ") + std::to_string(joint) + ": " +
            can::to_text(*causes[joint]);
  }
  return text.empty() ? "LinuxCNC is homed: abbed receives its positions" : text;
}

std::vector<std::byte> encoder_datagram(const ServoSample& sample, std::uint8_t sequence,
                                        const EncoderBusOptions& options, Emergencies emergencies) {
  std::array<std::byte, kDatagramBytes> buffer{};
  can::DatagramWriter writer(buffer, sequence);
  can::CanFrame sync;
  sync.id = can::cob::kSync;
  bool fits = writer.add(sync);

  const Causes causes = causes_of(sample, options);
  for (std::size_t joint = 0; joint < kEncoderJoints; ++joint) {
    const can::NodeId node = node_of(options, joint);
    if (emergencies == Emergencies::Included)
      fits = writer.add(can::encode_emergency(can::control_emergency(node, causes[joint]))) && fits;
    if (causes[joint]) continue;
    const auto count = static_cast<std::int64_t>(count_of(sample, joint, options));
    fits = writer.add(
               can::encode_position(can::cob::tpdo(1, node), can::PositionType::Signed32, count)) &&
           fits;
  }
  if (!fits) return {};

  const auto bytes = writer.finish();
  return {bytes.begin(), bytes.end()};
}

Emergencies EmergencySchedule::choose(std::uint32_t number, const Causes& causes) {
  // The difference is unsigned, because the number of a servo cycle may wrap.
  if (causes_ == causes && number - sent_ < kRepeatCycles) return Emergencies::Omitted;
  causes_ = causes;
  sent_ = number;
  return Emergencies::Included;
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
      due.reset();  // a newer sample is already waiting
      ++late_;
    }
    if (sample.number % every_ == 0) due = sample;
  }
  return due;
}

}  // namespace abbe::linuxcnc
