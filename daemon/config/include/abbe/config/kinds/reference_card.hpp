#pragma once
/// [reference]: a second card that latches the counts of the counted axes at their reference marks.
/// These axes are not referenced until `abbe reference` has found the positions at which their
/// counters started. Pure data.

#include "abbe/config/reference_marks.hpp"
#include "abbe/config/usb_card.hpp"

namespace abbe::daemon {

struct ConfigKind;

struct ReferenceConfig {
  static const ConfigKind kKind;
  UsbCardConfig card{.name = "reference_card"};  ///< its axes are in the order of `marks`
  ReferenceMarks marks;
};

}  // namespace abbe::daemon
