#pragma once
/// USB/IP operations before the transfers: listing the exported devices of a server, and importing
/// one. Big-endian, TCP port 3240, version 1.1.1 [Linux Documentation/usb/usbip_protocol.rst].
/// After a successful import the connection carries a stream of transfers (urb.hpp). The decoders
/// accept any bytes and need the whole message. Pure, no allocation.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <tl/expected.hpp>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::usbip {

inline constexpr std::uint16_t kPort = 3240;
inline constexpr std::uint16_t kVersion = 0x0111;

enum class OpCode : std::uint16_t {
  DeviceListRequest = 0x8005,
  DeviceListReply = 0x0005,
  ImportRequest = 0x8003,
  ImportReply = 0x0003,
};
enum class OpStatus : std::uint32_t {
  Ok = 0,
  Refused = 1,
  Busy = 2,
  DeviceError = 3,
  NoDevice = 4,
  Unexpected = 5
};

enum class OpError : std::uint8_t {
  Truncated,    ///< fewer bytes than the message needs
  BadVersion,   ///< not USB/IP 1.1.1
  UnknownCode,  ///< not the expected message
};
[[nodiscard]] const char* to_text(OpError error) noexcept;

enum class Speed : std::uint32_t {
  Unknown = 0,
  Low = 1,
  Full = 2,
  High = 3,
  Wireless = 4,
  Super = 5
};

/// Text of fixed width on the wire, padded with zeros; longer text is truncated.
template <std::size_t N>
struct FixedText {
  std::array<char, N> characters{};
  constexpr FixedText() = default;
  constexpr explicit FixedText(std::string_view text) noexcept {
    for (std::size_t i = 0; i < text.size() && i + 1 < N; ++i) characters[i] = text[i];
  }
  [[nodiscard]] constexpr std::string_view view() const noexcept {
    const std::string_view all{characters.data(), N};
    return all.substr(0, all.find('\0'));
  }
  friend bool operator==(const FixedText&, const FixedText&) = default;
};
using BusId = FixedText<32>;

struct ExportedDevice {
  FixedText<256> path;
  BusId bus_id;  ///< "1-1"
  std::uint32_t bus = 0;
  std::uint32_t number = 0;
  Speed speed = Speed::High;
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::uint16_t version = 0;
  std::uint8_t device_class = 0;
  std::uint8_t device_subclass = 0;
  std::uint8_t device_protocol = 0;
  std::uint8_t configuration = 0;  ///< the active one, 0: none
  std::uint8_t configurations = 1;
  std::uint8_t interfaces = 1;
  friend bool operator==(const ExportedDevice&, const ExportedDevice&) = default;
};

/// Field "devid" of the transfers.
[[nodiscard]] constexpr std::uint32_t device_id(const ExportedDevice& device) noexcept {
  return device.bus << 16 | (device.number & 0xFFFFu);
}

struct ExportedInterface {
  std::uint8_t interface_class = 0;
  std::uint8_t interface_subclass = 0;
  std::uint8_t interface_protocol = 0;
  friend bool operator==(const ExportedInterface&, const ExportedInterface&) = default;
};

struct OpHead {
  std::uint16_t version = kVersion;
  OpCode code = OpCode::ImportRequest;
  OpStatus status = OpStatus::Ok;
  friend bool operator==(const OpHead&, const OpHead&) = default;
};

inline constexpr std::size_t kOpHeadSize = 8;
inline constexpr std::size_t kExportedDeviceSize = 312;
inline constexpr std::size_t kImportRequestSize = kOpHeadSize + 32;
inline constexpr std::size_t kImportReplySize = kOpHeadSize + kExportedDeviceSize;

/// Decodes the head of any operation; error UnknownCode for a code that is not in OpCode.
[[nodiscard]] tl::expected<OpHead, OpError> decode_op_head(
    std::span<const std::byte> bytes) ABBE_RT;

// Each encoder returns the number of bytes written, 0 if `out` is too small.
std::size_t encode_import_request(const BusId& bus_id, std::span<std::byte> out) ABBE_RT;
/// Encodes the reply to an import request. A refusal (`device` null) consists of the head only.
std::size_t encode_import_reply(OpStatus status, const ExportedDevice* device,
                                std::span<std::byte> out) ABBE_RT;
[[nodiscard]] tl::expected<BusId, OpError> decode_import_request(
    std::span<const std::byte> bytes) ABBE_RT;

struct ImportReply {
  OpStatus status = OpStatus::Ok;
  ExportedDevice device;  ///< only with status Ok
  friend bool operator==(const ImportReply&, const ImportReply&) = default;
};
[[nodiscard]] tl::expected<ImportReply, OpError> decode_import_reply(
    std::span<const std::byte> bytes) ABBE_RT;

/// Writes a device list: the head, then each device with its interfaces.
class DeviceListWriter {
 public:
  DeviceListWriter(std::span<std::byte> out, std::uint32_t devices) ABBE_RT;
  /// False if it does not fit.
  bool add(const ExportedDevice& device, std::span<const ExportedInterface> interfaces) ABBE_RT;
  [[nodiscard]] std::span<const std::byte> written() const ABBE_RT { return out_.first(size_); }

 private:
  std::span<std::byte> out_;
  std::size_t size_ = 0;
};

}  // namespace abbe::protocol::usbip
