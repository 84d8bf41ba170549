#pragma once
/// [counter_card]: a USB-QUAD08 whose counters read the axes. Count 0 is the position of the axis
/// when the card was configured:
///
///   reading = offset + count * step
///
/// `step_nm` is the step of one count; a signal period has four counts. Pure data.

#include <cstdint>

#include "abbe/config/usb_card.hpp"

namespace abbe::daemon {

struct ConfigKind;

struct CounterCardConfig {
  static const ConfigKind kKind;
  UsbCardConfig card{.name = "counter_card"};
  std::uint32_t sample_every = 1;  ///< one axis sample per this number of scans
  bool axes_compensated = false;   ///< true: the control already corrects these readings
  /// True: when the card is configured for the first time, the position of an axis without
  /// reference marks is defined as its offset, so that the axis is referenced. If false, and always
  /// after the card restarted during operation, the axis is not referenced until `abbe reference
  /// --here`.
  bool zero_is_here = false;
};

}  // namespace abbe::daemon
