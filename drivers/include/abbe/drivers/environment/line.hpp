#pragma once
/// The Modbus devices of one serial line, or behind one gateway, as one Device with one thread:
/// requests go out one after the other over one connection, the device that has waited longest
/// first. Each has its own rounds, time-outs, faults and status. A device that does not answer
/// costs the others its answer_timeout, and as long again for an answer that comes too late, once
/// in its period; the connection is closed only when no other device has answered on it meanwhile.

#include <memory>
#include <vector>

#include "abbe/drivers/environment/device.hpp"
#include "abbe/drivers/environment/link.hpp"

namespace abbe::drivers {

class EnvironmentLine final : public Device {
 public:
  /// `time` must outlive the line. BadConfiguration as EnvironmentDevice::create(), for no device,
  /// and for devices that are not on one line with the same settings.
  [[nodiscard]] static Result<std::unique_ptr<EnvironmentLine>> create(
      const std::vector<EnvironmentDeviceOptions>& options, const TimeSource& time);

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  /// Of the first device; each has its own.
  [[nodiscard]] DeviceStatus status() const override { return devices_.front()->status(); }

  /// In the order of the options.
  [[nodiscard]] EnvironmentDevice& device(std::size_t i) noexcept { return *devices_[i]; }

 private:
  EnvironmentLine(std::chrono::nanoseconds silence, const TimeSource& time)
      : silence_(silence), time_(time) {}

  [[nodiscard]] EnvironmentDevice& next();
  [[nodiscard]] bool must_be_quiet();
  void throw_away(EnvironmentDevice& device, std::chrono::nanoseconds at_most);

  std::chrono::nanoseconds silence_;
  const TimeSource& time_;
  EnvironmentLink link_;
  std::vector<std::unique_ptr<EnvironmentDevice>> devices_;
  EnvironmentDevice* active_ = nullptr;  ///< from wait() to the next one, same thread
  std::size_t last_ = 0;                 ///< index of the device that was chosen last
  std::uint64_t answers_seen_ = 0;
};

}  // namespace abbe::drivers
