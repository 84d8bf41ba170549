#pragma once
/// Converts the configuration to the drivers' options. A live device and its replay use the same
/// conversion, so that they decode alike. Pure. Time-outs are host time in the drivers; with
/// simulated devices at `speed` > 1 host time runs faster than wall time, so they are multiplied by
/// `speed`: the latency of the operating system does not become shorter.

#include "abbe/config/config.hpp"
#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/drivers/counter_card/device.hpp"
#include "abbe/drivers/environment/device.hpp"
#include "abbe/drivers/ippdme/device.hpp"
#include "abbe/drivers/tracker/device.hpp"

namespace abbe::daemon {

[[nodiscard]] drivers::TrackerDeviceOptions device_options(const TrackerConfig& config,
                                                           double speed);
/// Longest host time until the tracker driver reports the outcome of an order; 0 without a tracker.
[[nodiscard]] std::chrono::nanoseconds longest_tracker_order(const Config& config);
[[nodiscard]] drivers::EncoderDeviceOptions device_options(const EncoderConfig& config,
                                                           double speed);
[[nodiscard]] drivers::CounterCardOptions device_options(const UsbCardConfig& config, double speed);
[[nodiscard]] drivers::CounterCardOptions device_options(const CounterCardConfig& config,
                                                         double speed);
[[nodiscard]] drivers::EnvironmentDeviceOptions device_options(const EnvironmentConfig& config,
                                                               double speed);
[[nodiscard]] drivers::IppDeviceOptions device_options(const CmmConfig& config, double speed);

}  // namespace abbe::daemon
