#pragma once
/// One USB device as a driver needs it: control transfers one at a time, many bulk-in transfers in
/// flight, and word of its going. Two back-ends: libusb (LibusbLink) and a USB/IP client in the
/// process (UsbipLink). All calls from one thread, in the ordinary world; nothing blocks but
/// wait(). What goes wrong is an event.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <variant>

#include "abbe/drivers/error.hpp"
#include "abbe/protocol/time.hpp"
#include "abbe/protocol/usb/setup.hpp"

namespace abbe::drivers {

namespace usb = protocol::usb;

/// Which device: another one on the same port is refused by name.
struct UsbIdentity {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string serial;              ///< empty: the only one there is
  std::uint8_t configuration = 1;  ///< selected when opened
  std::uint8_t bulk_endpoint = 0;  ///< must exist; address with direction bit
};

struct UsbBulkStream {
  std::size_t transfer_bytes = 2048;  ///< a multiple of the endpoint's packet
  std::size_t in_flight = 32;         ///< requests the device always has to answer
};

enum class UsbOutcome : std::uint8_t {
  Done,
  Stalled,  ///< refused by the device; a bulk endpoint stays so until its halt is cleared
  Failed,   ///< anything else that leaves the device there
};

/// Opened: it is the configured device and its configuration is selected.
struct UsbOpened {
  std::string serial;  ///< empty: the device has none
};
struct UsbControlDone {
  static constexpr std::size_t kCapacity = 64;
  usb::Setup setup;
  UsbOutcome outcome = UsbOutcome::Done;
  std::array<std::byte, kCapacity> data{};
  std::size_t length = 0;
  [[nodiscard]] std::span<const std::byte> bytes() const noexcept {
    return std::span{data}.first(length);
  }
};
/// One transfer that ended; its request goes out again by itself. The bytes are lent until the next
/// wait().
struct UsbBulkIn {
  std::span<const std::byte> bytes;
  protocol::HostTime arrival{};
  UsbOutcome outcome = UsbOutcome::Done;
};
/// After stop_bulk_in(): none is in flight any more.
struct UsbBulkStopped {};
/// Closed: unplugged, refused, never there. open() tries again.
struct UsbLost {
  Error error;
};
using UsbEvent = std::variant<UsbOpened, UsbControlDone, UsbBulkIn, UsbBulkStopped, UsbLost>;

class UsbLink {
 public:
  UsbLink() = default;
  UsbLink(const UsbLink&) = delete;
  UsbLink& operator=(const UsbLink&) = delete;
  virtual ~UsbLink() = default;

  /// Begins to open; UsbOpened or UsbLost follows.
  virtual void open() = 0;
  /// At once and without an event.
  virtual void close() noexcept = 0;
  /// One at a time; UsbControlDone follows, or nothing ever if the device does not answer. Writes
  /// have no data. usb::clear_halt() also clears the host's side of it.
  virtual void control(const usb::Setup& setup) = 0;
  /// Requests from the bulk endpoint of the identity, always `in_flight` of them.
  virtual void start_bulk_in(const UsbBulkStream& stream) = 0;
  /// Takes all requests back; UsbBulkStopped follows.
  virtual void stop_bulk_in() = 0;
  /// Waits for at most `wall` of the operating system's time. The events are valid until the next
  /// call.
  [[nodiscard]] virtual std::span<const UsbEvent> wait(std::chrono::nanoseconds wall) = 0;
  /// For messages: "USB 09DB:00CA", "USB/IP 127.0.0.1:3240 1-1".
  [[nodiscard]] virtual std::string name() const = 0;
};

/// "it is 1209:0001, configured is 09DB:00CA"; empty if it is the right one.
[[nodiscard]] std::string wrong_ids(const UsbIdentity& wanted, std::uint16_t vendor,
                                    std::uint16_t product);
/// "its serial number is A, configured is B"; empty if it is the right one or none is configured.
[[nodiscard]] std::string wrong_serial(const UsbIdentity& wanted, std::string_view serial);

}  // namespace abbe::drivers
