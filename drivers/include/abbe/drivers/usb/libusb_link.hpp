#pragma once
/// A USB device on this computer through libusb: asynchronous transfers, hot-plug. Removal of the
/// device gives UsbLost. It is detected in one of two ways: transfers end with "no device", or they
/// fail and the hot-plug event follows. Without a running udev there is no hot-plug event; then the
/// next request detects the removal.

#include <memory>

#include "abbe/drivers/time_source.hpp"
#include "abbe/drivers/usb/usb_link.hpp"

namespace abbe::drivers {

class LibusbLink final : public UsbLink {
 public:
  /// `time` must outlive the link. open() claims interface 0 of the device and detaches a kernel
  /// driver from it.
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
