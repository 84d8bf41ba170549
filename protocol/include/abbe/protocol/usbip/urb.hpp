#pragma once
/// USB/IP transfers. Each message is a header of 48 bytes, big-endian, then the data of an OUT
/// request or of an answer to an IN request [Linux Documentation/usb/usbip_protocol.rst]. A reply
/// usually does not contain direction and endpoint (Linux leaves them 0). The client must look up
/// its request by the sequence number to know whether data follow. No isochronous transfers. Pure,
/// no allocation, accepts any bytes.

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tl/expected.hpp>
#include <variant>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/usb/setup.hpp"

namespace abbe::protocol::usbip {

enum class Command : std::uint32_t { Submit = 1, Unlink = 2, SubmitReply = 3, UnlinkReply = 4 };
enum class Direction : std::uint32_t { Out = 0, In = 1 };

/// A status on the wire is a negative Linux error number.
enum class UrbStatus : std::int32_t {
  Ok = 0,
  NoDevice = -19,   ///< ENODEV
  Stalled = -32,    ///< EPIPE
  Overflow = -75,   ///< EOVERFLOW: more data than requested
  Unlinked = -104,  ///< ECONNRESET
  Shutdown = -108,  ///< ESHUTDOWN: the device is shutting down
};

struct UrbHead {
  std::uint32_t sequence = 0;
  std::uint32_t device = 0;  ///< device_id() of the import; 0 in replies
  Direction direction = Direction::Out;
  std::uint32_t endpoint = 0;  ///< number without the direction bit
  friend bool operator==(const UrbHead&, const UrbHead&) = default;
};

struct Submit {
  UrbHead head;
  std::uint32_t flags = 0;
  std::uint32_t length = 0;  ///< bytes that follow (OUT) or are requested (IN)
  std::uint32_t start_frame = 0;
  std::uint32_t interval = 0;
  usb::SetupBytes setup{};  ///< endpoint 0 only
  friend bool operator==(const Submit&, const Submit&) = default;
};

struct Unlink {
  UrbHead head;
  std::uint32_t victim = 0;  ///< sequence number of the request to cancel
  friend bool operator==(const Unlink&, const Unlink&) = default;
};

struct SubmitReply {
  UrbHead head;
  UrbStatus status = UrbStatus::Ok;
  std::uint32_t length = 0;  ///< bytes that follow (IN) or were accepted (OUT)
  std::uint32_t start_frame = 0;
  std::uint32_t errors = 0;
  friend bool operator==(const SubmitReply&, const SubmitReply&) = default;
};

struct UnlinkReply {
  UrbHead head;
  /// Unlinked: the request will not be answered. Ok: it was already answered.
  UrbStatus status = UrbStatus::Ok;
  friend bool operator==(const UnlinkReply&, const UnlinkReply&) = default;
};

using Urb = std::variant<Submit, Unlink, SubmitReply, UnlinkReply>;

enum class UrbError : std::uint8_t {
  UnknownCommand,
  BadDirection,
  Isochronous,
};
[[nodiscard]] const char* to_text(UrbError error) noexcept;

inline constexpr std::size_t kUrbHeaderSize = 48;
using UrbBytes = std::array<std::byte, kUrbHeaderSize>;

[[nodiscard]] UrbBytes encode(const Urb& urb) ABBE_RT;
[[nodiscard]] tl::expected<Urb, UrbError> decode_urb(
    std::span<const std::byte, kUrbHeaderSize> bytes) ABBE_RT;

}  // namespace abbe::protocol::usbip
