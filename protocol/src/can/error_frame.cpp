#include "abbe/protocol/can/error_frame.hpp"

#include <array>

namespace abbe::protocol::can {

namespace {

// linux/can/error.h: class bits in the identifier, controller detail in data[1], counters in
// data[6..7].
struct Bit {
  std::uint32_t wire;
  BusCondition condition;
};
constexpr std::array kClassBits{
    Bit{0x001, BusCondition::TransmitTimeout}, Bit{0x002, BusCondition::LostArbitration},
    Bit{0x008, BusCondition::Protocol},        Bit{0x010, BusCondition::Transceiver},
    Bit{0x020, BusCondition::NoAcknowledge},   Bit{0x040, BusCondition::BusOff},
    Bit{0x080, BusCondition::BusError},        Bit{0x100, BusCondition::Restarted},
};
constexpr std::array kControllerBits{
    Bit{0x01, BusCondition::ReceiveOverflow}, Bit{0x02, BusCondition::TransmitOverflow},
    Bit{0x04, BusCondition::Warning},         Bit{0x08, BusCondition::Warning},
    Bit{0x10, BusCondition::Passive},         Bit{0x20, BusCondition::Passive},
    Bit{0x40, BusCondition::Active},
};
constexpr std::uint32_t kClassController = 0x004;
constexpr std::uint32_t kClassCounters = 0x200;

}  // namespace

std::optional<BusReport> decode_error_frame(const CanFrame& frame) ABBE_RT {
  if (!frame.is(FrameFlag::Error)) return std::nullopt;
  BusReport report;
  for (const auto& bit : kClassBits) {
    if ((frame.id & bit.wire) != 0) report.conditions |= static_cast<BusConditions>(bit.condition);
  }
  if ((frame.id & kClassController) != 0 && frame.length >= 2) {
    for (const auto& bit : kControllerBits) {
      if ((frame.byte(1) & bit.wire) != 0)
        report.conditions |= static_cast<BusConditions>(bit.condition);
    }
  }

  if ((frame.id & kClassCounters) != 0 && frame.length >= 8) {
    report.has_counters = true;
    report.transmit_errors = frame.byte(6);
    report.receive_errors = frame.byte(7);
  }

  return report;
}

CanFrame encode_error_frame(const BusReport& report) ABBE_RT {
  CanFrame frame;
  frame.set(FrameFlag::Error);
  frame.length = 8;
  for (const auto& bit : kClassBits) {
    if (has(report.conditions, bit.condition)) frame.id |= bit.wire;
  }
  std::uint32_t detail = 0;
  for (const auto& bit : kControllerBits) {
    if (has(report.conditions, bit.condition)) detail |= bit.wire;
  }

  if (detail != 0) frame.id |= kClassController;
  frame.data[1] = static_cast<std::byte>(detail);
  if (report.has_counters) {
    frame.id |= kClassCounters;
    frame.data[6] = std::byte{report.transmit_errors};
    frame.data[7] = std::byte{report.receive_errors};
  }

  return frame;
}

}  // namespace abbe::protocol::can
