#pragma once
/// The configuration as the drivers' options: one place, so that a live device and its replay
/// decode alike. Pure. Time-outs are host time in the drivers; with simulated devices at
/// `speed` > 1 they are stretched by it, because the peer's answer still takes the operating
/// system's time.

#include "abbe/config/config.hpp"
#include "abbe/drivers/can/encoder_device.hpp"
#include "abbe/drivers/counter_card/device.hpp"
#include "abbe/drivers/environment/device.hpp"
#include "abbe/drivers/ippdme/device.hpp"
#include "abbe/drivers/tracker/device.hpp"

namespace abbe::daemon {

[[nodiscard]] drivers::TrackerDeviceOptions device_options(const TrackerConfig& config,
                                                           double speed);
/// Host time after which an order to the tracker has been reported; 0 without a tracker.
[[nodiscard]] std::chrono::nanoseconds longest_tracker_order(const Config& config);
[[nodiscard]] drivers::EncoderDeviceOptions device_options(const EncoderConfig& config,
                                                           double speed);
[[nodiscard]] drivers::CounterCardOptions device_options(const CounterCardConfig& config,
                                                         double speed);
[[nodiscard]] drivers::EnvironmentDeviceOptions device_options(const EnvironmentConfig& config,
                                                               double speed);
[[nodiscard]] drivers::IppDeviceOptions device_options(const CmmConfig& config, double speed);

}  // namespace abbe::daemon
