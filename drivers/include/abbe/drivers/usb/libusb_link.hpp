#pragma once
/// A USB device on this computer through libusb: asynchronous transfers, hot-plug. An unplug shows
/// itself in one of two ways, both of which end in UsbLost: transfers end with "no device", or they
/// fail first and the hot-plug notice comes after. Without a running udev there is no notice; then
/// the next request says it.

#include <memory>

#include "abbe/drivers/time_source.hpp"
#include "abbe/drivers/usb/usb_link.hpp"

namespace abbe::drivers {

class LibusbLink final : public UsbLink {
 public:
  /// `time` must outlive the link. The interface 0 of the device is claimed, a kernel driver on it
  /// detached.
  LibusbLink(const UsbIdentity& identity, const TimeSource& time);
  ~LibusbLink() override;

  void open() override;
  void close() noexcept override;
  void control(const usb::Setup& setup) override;
  void start_bulk_in(const UsbBulkStream& stream) override;
  void stop_bulk_in() override;
  [[nodiscard]] std::span<const UsbEvent> wait(std::chrono::nanoseconds wall) override;
  [[nodiscard]] std::string name() const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace abbe::drivers
