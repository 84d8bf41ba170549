#pragma once
/// The options of the encoder driver. A live device and its replay use the same ones. Pure.

#include "abbe/config/kinds/encoder.hpp"
#include "abbe/drivers/can/encoder_device.hpp"

namespace abbe::daemon {

/// Time-outs are multiplied by `speed`; see stretched().
[[nodiscard]] drivers::EncoderDeviceOptions device_options(const EncoderConfig& config,
                                                           double speed);

}  // namespace abbe::daemon
