// Any bytes as each message of USB/IP: refused, or read and written again to the same message.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "abbe/protocol/usb/descriptors.hpp"
#include "abbe/protocol/usbip/operations.hpp"
#include "abbe/protocol/usbip/urb.hpp"

namespace {

using namespace abbe::protocol;

void require(bool holds) {
  if (!holds) std::abort();
}

void operations(std::span<const std::byte> bytes) {
  std::array<std::byte, usbip::kImportReplySize> out{};
  if (const auto head = usbip::decode_op_head(bytes); !head)
    require(*to_text(head.error()) != '\0');

  if (const auto bus_id = usbip::decode_import_request(bytes)) {
    const auto size = usbip::encode_import_request(usbip::BusId{bus_id->view()}, out);
    require(usbip::decode_import_request(std::span{out}.first(size))->view() ==
            bus_id->view().substr(0, 31));
  }

  if (const auto reply = usbip::decode_import_reply(bytes)) {
    const bool granted = reply->status == usbip::OpStatus::Ok;
    const auto size =
        usbip::encode_import_reply(reply->status, granted ? &reply->device : nullptr, out);
    require(usbip::decode_import_reply(std::span{out}.first(size)) == reply);
  }
}

void transfers(std::span<const std::byte> bytes) {
  if (bytes.size() < usbip::kUrbHeaderSize) return;
  const auto urb = usbip::decode_urb(bytes.first<usbip::kUrbHeaderSize>());
  if (!urb) return require(*to_text(urb.error()) != '\0');
  require(usbip::decode_urb(usbip::encode(*urb)) == *urb);
}

void descriptors(std::span<const std::byte> bytes) {
  if (const auto device = usb::decode_device_descriptor(bytes)) {
    require(usb::decode_device_descriptor(usb::encode(*device)) == *device);
  }

  if (const auto text = usb::decode_string(bytes)) {
    std::array<std::byte, usb::kMaxDescriptor> out{};
    const auto size = usb::encode_string(text->view(), out);
    require(usb::decode_string(std::span{out}.first(size))->view() == text->view());
  }

  if (const auto packet = usb::find_endpoint(bytes, 0x82)) require(*packet <= 0x07FF);
  if (bytes.size() >= usb::kSetupSize) {
    const auto setup = bytes.first<usb::kSetupSize>();
    require(std::ranges::equal(usb::encode(usb::decode_setup(setup)), setup));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span{data, size});
  operations(bytes);
  transfers(bytes);
  descriptors(bytes);
  return 0;
}
