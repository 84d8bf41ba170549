#pragma once
/// The Modbus devices of one serial line, or behind one gateway, as one Device with one thread.
/// Requests are sent one at a time over one connection; the device that has waited longest is next.
/// Each device has its own rounds, time-outs, faults and status.
/// A device that does not answer delays the others once per period: by its answer_timeout, and by
/// the same time again, in which a late answer is discarded. The fault of a device closes the
/// connection only if no other device has answered since the previous fault of that device.

#include <memory>
#include <vector>

#include "abbe/drivers/environment/device.hpp"
#include "abbe/drivers/environment/link.hpp"

namespace abbe::drivers {

class EnvironmentLine final : public Device {
 public:
  /// `time` must outlive the line. Error BadConfiguration as EnvironmentDevice::create(), if
  /// `options` is empty, and if the devices have different addresses or line settings.
  [[nodiscard]] static Result<std::unique_ptr<EnvironmentLine>> create(
      const std::vector<EnvironmentDeviceOptions>& options, const TimeSource& time);

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  /// Status of the first device. For the others use device(i).status().
  [[nodiscard]] DeviceStatus status() const override { return devices_.front()->status(); }

  /// The devices in the order of the options.
  [[nodiscard]] EnvironmentDevice& device(std::size_t i) noexcept { return *devices_[i]; }

 private:
  EnvironmentLine(std::chrono::nanoseconds silence, const TimeSource& time)
      : silence_(silence), time_(time) {}

  [[nodiscard]] EnvironmentDevice& next();
  [[nodiscard]] bool must_be_quiet();
  void discard_late_answer(EnvironmentDevice& device, std::chrono::nanoseconds at_most);

  std::chrono::nanoseconds silence_;
  const TimeSource& time_;
  EnvironmentLink link_;
  std::vector<std::unique_ptr<EnvironmentDevice>> devices_;
  EnvironmentDevice* active_ = nullptr;  ///< device of the latest wait(), for receive()
  std::size_t last_ = 0;                 ///< index of the device chosen last
  std::uint64_t answers_seen_ = 0;
};

}  // namespace abbe::drivers
