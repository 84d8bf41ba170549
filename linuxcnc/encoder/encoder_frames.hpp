// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// Sends the joints of LinuxCNC as CANopen encoders on CAN over UDP, for `[encoder] transport =
/// "udp"` and `sync = "external"` of abbed. Pure.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/protocol/can/control_emergency.hpp"
#include "abbe/protocol/position_record.hpp"

namespace abbe::linuxcnc {

inline constexpr std::size_t kEncoderJoints = 3;

/// One servo cycle, from the stream of LinuxCNC's `sampler`. Lengths in mm.
struct ServoSample {
  std::uint32_t number = 0;
  std::array<double, kEncoderJoints> motor_mm{};   ///< feedback of the motor, as read at the scale
  std::array<double, kEncoderJoints> offset_mm{};  ///< joint.N.motor-offset
  bool homed = false;

  /// The scale reading q in the coordinates of the joint, with the correction that is applied.
  [[nodiscard]] double reading_mm(std::size_t joint) const {
    return motor_mm[joint] - offset_mm[joint];
  }
};

struct EncoderBusOptions {
  int first_node = 1;      ///< node of joint 0; the other joints have the following nodes
  double step_mm = 10e-6;  ///< step of one count; this is step_nm = 10 in abbed.toml
};

/// For each joint: why it has no position to send; nullopt: it has one.
using Causes = std::array<std::optional<protocol::can::ControlCause>, kEncoderJoints>;
[[nodiscard]] Causes causes_of(const ServoSample& sample, const EncoderBusOptions& options);

/// The causes as text: "LinuxCNC is not homed: abbed receives no positions", "joint 1: ...", or
/// that abbed receives the positions.
[[nodiscard]] std::string describe(const Causes& causes);

enum class Emergencies { Omitted, Included };

/// One datagram: SYNC, and the answer of every node (TPDO 1: the position, 32 bits). Before homing,
/// and for a reading that is not finite or exceeds 32 bits, a node does not answer, and abbe marks
/// the axis as missing. With `emergencies` the datagram also contains one emergency of each node:
/// the cause, or error reset.
[[nodiscard]] std::vector<std::byte> encoder_datagram(const ServoSample& sample,
                                                      std::uint8_t sequence,
                                                      const EncoderBusOptions& options,
                                                      Emergencies emergencies);

/// Chooses the datagrams that contain emergencies: at every change of a cause, and again every
/// kRepeatCycles, because abbed may start later, and UDP may lose a datagram.
class EmergencySchedule {
 public:
  static constexpr std::uint32_t kRepeatCycles = 1000;  ///< servo cycles: 1 s at 1 kHz

  /// `number`: number of the servo cycle that is sent.
  [[nodiscard]] Emergencies choose(std::uint32_t number, const Causes& causes);

 private:
  std::optional<Causes> causes_;
  std::uint32_t sent_ = 0;  ///< servo cycle of the latest emergencies
};

/// The record of a servo cycle for abbe-sim. A reading that is not finite counts as not homed.
[[nodiscard]] protocol::PositionRecord position_record(const ServoSample& sample,
                                                       std::uint32_t period_ns);

/// Chooses the samples that are sent: every n-th sample, and of the samples read together only the
/// newest. The reason: abbed dates a SYNC by its arrival, so a sample that has waited must not be
/// sent as a new one.
class Decimation {
 public:
  explicit Decimation(std::uint32_t every) : every_(every) {}
  /// The sample to send, from the samples that one read returned; nullopt: none.
  [[nodiscard]] std::optional<ServoSample> choose(std::span<const ServoSample> read);
  /// Number of due samples that were not sent.
  [[nodiscard]] std::uint64_t late() const { return late_; }

 private:
  std::uint32_t every_;
  std::uint64_t late_ = 0;
};

}  // namespace abbe::linuxcnc
