#pragma once
/// [reference]: a second card that latches the axis counts at the reference marks of the scales.
/// With this table the axes are not referenced until `abbe reference` has found, for each axis, the
/// position at which its counter started. Pure data.

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
