#include "abbe/protocol/usb/descriptors.hpp"

#include <algorithm>

#include "abbe/protocol/bytes.hpp"
#include "abbe/protocol/usb/setup.hpp"

namespace abbe::protocol::usb {
namespace {

constexpr auto kDevice = static_cast<std::uint8_t>(DescriptorType::Device);
constexpr auto kString = static_cast<std::uint8_t>(DescriptorType::String);
constexpr auto kEndpoint = static_cast<std::uint8_t>(DescriptorType::Endpoint);
constexpr std::size_t kHead = 2;  // length, type
constexpr std::uint16_t kPacketSizeBits = 0x07FF;

bool printable(std::uint16_t unit) ABBE_RT {
  return unit >= 0x20 && unit < 0x7F;
}

}  // namespace

std::array<std::byte, kDeviceDescriptorSize> encode(const DeviceDescriptor& d) ABBE_RT {
  std::array<std::byte, kDeviceDescriptorSize> bytes{};
  ByteWriter out{bytes};
  out.little(static_cast<std::uint8_t>(kDeviceDescriptorSize));
  out.little(kDevice);
  out.little(d.usb_version);
  out.little(d.device_class);
  out.little(d.device_subclass);
  out.little(d.device_protocol);
  out.little(d.packet_size0);
  out.little(d.vendor);
  out.little(d.product);
  out.little(d.device_version);
  out.little(d.manufacturer_string);
  out.little(d.product_string);
  out.little(d.serial_string);
  out.little(d.configurations);
  return bytes;
}

std::optional<DeviceDescriptor> decode_device_descriptor(std::span<const std::byte> bytes) ABBE_RT {
  ByteReader in{bytes};
  const auto length = in.little<std::uint8_t>();
  const auto type = in.little<std::uint8_t>();

  DeviceDescriptor d;
  d.usb_version = in.little<std::uint16_t>();
  d.device_class = in.little<std::uint8_t>();
  d.device_subclass = in.little<std::uint8_t>();
  d.device_protocol = in.little<std::uint8_t>();
  d.packet_size0 = in.little<std::uint8_t>();
  d.vendor = in.little<std::uint16_t>();
  d.product = in.little<std::uint16_t>();
  d.device_version = in.little<std::uint16_t>();
  d.manufacturer_string = in.little<std::uint8_t>();
  d.product_string = in.little<std::uint8_t>();
  d.serial_string = in.little<std::uint8_t>();
  d.configurations = in.little<std::uint8_t>();

  if (!in.ok() || length < kDeviceDescriptorSize || type != kDevice) return std::nullopt;
  return d;
}

std::optional<DescriptorText> decode_string(std::span<const std::byte> bytes) ABBE_RT {
  ByteReader in{bytes};
  const auto length = in.little<std::uint8_t>();
  const auto type = in.little<std::uint8_t>();
  if (!in.ok() || type != kString || length < kHead || length > bytes.size()) return std::nullopt;
  DescriptorText text;
  for (std::size_t i = 0; i < (length - kHead) / 2u; ++i) {
    const auto unit = in.little<std::uint16_t>();
    text.characters[text.length++] = printable(unit) ? static_cast<char>(unit) : '?';
  }
  return text;
}

std::size_t encode_string(std::string_view ascii,
                          std::span<std::byte, kMaxDescriptor> out) ABBE_RT {
  const std::size_t characters = std::min(ascii.size(), DescriptorText::kCapacity);
  ByteWriter writer{out};
  writer.little(static_cast<std::uint8_t>(kHead + 2 * characters));
  writer.little(kString);
  for (std::size_t i = 0; i < characters; ++i)
    writer.little(static_cast<std::uint16_t>(static_cast<unsigned char>(ascii[i])));
  return writer.size();
}

std::optional<std::uint16_t> find_endpoint(std::span<const std::byte> configuration,
                                           std::uint8_t address) ABBE_RT {
  while (configuration.size() >= kHead) {
    const auto length = std::to_integer<std::size_t>(configuration[0]);
    if (length < kHead || length > configuration.size()) return std::nullopt;
    ByteReader in{configuration.first(length)};
    in.skip(1);
    const bool endpoint = in.little<std::uint8_t>() == kEndpoint;
    const bool this_one = in.little<std::uint8_t>() == address;
    in.skip(1);  // kind of transfer
    const auto packet = in.little<std::uint16_t>();
    if (endpoint && this_one && in.ok())
      return static_cast<std::uint16_t>(packet & kPacketSizeBits);
    configuration = configuration.subspan(length);
  }
  return std::nullopt;
}

}  // namespace abbe::protocol::usb
