#pragma once
/// Stands in for libusb in this test program (the linker prefers the program's own functions):
/// cards on a bus that count how often they are opened, and a host controller that keeps cancelled
/// transfers.

#include <libusb-1.0/libusb.h>

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

struct libusb_device {
  std::string serial;
  std::uint8_t address = 1;
  int opened = 0;
};
struct libusb_device_handle {
  libusb_device* device = nullptr;
};

namespace abbe::tests {

struct FakeBus {
  std::vector<libusb_device*> devices;
  bool keeps_cancelled = false;
  std::vector<libusb_transfer*> submitted;
  std::deque<libusb_transfer*> cancelled;  ///< come back when events are handled
  std::vector<std::unique_ptr<libusb_device_handle>> handles;
  std::vector<std::unique_ptr<libusb_transfer>> transfers;
  int freed = 0;  ///< transfers that were freed while submitted
};
inline FakeBus fake_bus;

}  // namespace abbe::tests
