#pragma once
/// The options of the encoder driver, the same for a live device and for its replay. Pure.

#include "abbe/config/kinds/encoder.hpp"
#include "abbe/drivers/can/encoder_device.hpp"

namespace abbe::daemon {

/// Options for `config`. `speed`: host seconds per second; time-outs are multiplied by it, see
/// stretched().
[[nodiscard]] drivers::EncoderDeviceOptions device_options(const EncoderConfig& config,
                                                           double speed);

}  // namespace abbe::daemon
