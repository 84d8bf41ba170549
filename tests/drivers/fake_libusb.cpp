#include "fake_libusb.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

#include "abbe/protocol/quad08/channel.hpp"
#include "abbe/protocol/quad08/registers.hpp"

using abbe::tests::fake_bus;

namespace {
bool is_submitted(const libusb_transfer* transfer) {
  return std::ranges::find(fake_bus.submitted, transfer) != fake_bus.submitted.end();
}
}  // namespace

extern "C" {

int libusb_init(libusb_context** context) {
  static char any;
  *context = reinterpret_cast<libusb_context*>(&any);
  return 0;
}
void libusb_exit(libusb_context*) {}
const char* libusb_strerror(int) {
  return "fake";
}
int libusb_hotplug_register_callback(libusb_context*, int, int, int, int, int,
                                     libusb_hotplug_callback_fn, void*,
                                     libusb_hotplug_callback_handle*) {
  return 0;
}
libusb_transfer* libusb_alloc_transfer(int) {
  return fake_bus.transfers.emplace_back(std::make_unique<libusb_transfer>()).get();
}
void libusb_free_transfer(libusb_transfer* transfer) {
  if (is_submitted(transfer)) ++fake_bus.freed;
  std::erase_if(fake_bus.transfers, [&](const auto& t) { return t.get() == transfer; });
}

ssize_t libusb_get_device_list(libusb_context*, libusb_device*** list) {
  *list = new libusb_device* [fake_bus.devices.size() + 1] {};
  std::ranges::copy(fake_bus.devices, *list);
  return static_cast<ssize_t>(fake_bus.devices.size());
}
void libusb_free_device_list(libusb_device** list, int) {
  delete[] list;
}
int libusb_get_device_descriptor(libusb_device*, libusb_device_descriptor* descriptor) {
  descriptor->idVendor = abbe::protocol::quad08::kVendor;
  descriptor->idProduct = abbe::protocol::quad08::kProduct;
  descriptor->iSerialNumber = 3;
  return 0;
}
std::uint8_t libusb_get_bus_number(libusb_device*) {
  return 1;
}
std::uint8_t libusb_get_device_address(libusb_device* device) {
  return device->address;
}
int libusb_open(libusb_device* device, libusb_device_handle** handle) {
  ++device->opened;
  *handle = fake_bus.handles.emplace_back(std::make_unique<libusb_device_handle>()).get();
  (*handle)->device = device;
  return 0;
}
void libusb_close(libusb_device_handle* handle) {
  std::erase_if(fake_bus.handles, [&](const auto& h) { return h.get() == handle; });
}
libusb_device* libusb_get_device(libusb_device_handle* handle) {
  return handle->device;
}
int libusb_get_string_descriptor_ascii(libusb_device_handle* handle, std::uint8_t,
                                       unsigned char* data, int) {
  std::memcpy(data, handle->device->serial.data(), handle->device->serial.size());
  return static_cast<int>(handle->device->serial.size());
}
int libusb_set_auto_detach_kernel_driver(libusb_device_handle*, int) {
  return 0;
}
int libusb_get_configuration(libusb_device_handle*, int* configuration) {
  *configuration = 1;
  return 0;
}
int libusb_set_configuration(libusb_device_handle*, int) {
  return 0;
}
int libusb_claim_interface(libusb_device_handle*, int) {
  return 0;
}
int libusb_release_interface(libusb_device_handle*, int) {
  return 0;
}
int libusb_get_max_packet_size(libusb_device*, unsigned char) {
  return 512;
}
int libusb_clear_halt(libusb_device_handle*, unsigned char) {
  return 0;
}

int libusb_submit_transfer(libusb_transfer* transfer) {
  fake_bus.submitted.push_back(transfer);
  return 0;
}
int libusb_cancel_transfer(libusb_transfer* transfer) {
  if (is_submitted(transfer)) fake_bus.cancelled.push_back(transfer);
  return 0;
}
int libusb_handle_events_timeout_completed(libusb_context*, timeval*, int*) {
  if (fake_bus.keeps_cancelled) return 0;
  for (auto* transfer : std::exchange(fake_bus.cancelled, {})) {
    std::erase(fake_bus.submitted, transfer);
    transfer->status = LIBUSB_TRANSFER_CANCELLED;
    transfer->callback(transfer);
  }
  return 0;
}
}
