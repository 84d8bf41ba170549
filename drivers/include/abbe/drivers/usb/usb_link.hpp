#pragma once
/// Interface to one USB device: one control transfer at a time, many bulk-in transfers in flight,
/// and notification of its removal. Two implementations: LibusbLink (libusb) and UsbipLink (a
/// USB/IP client in this process). All calls from one thread, not in the RT path; only wait()
/// blocks. Errors are reported as events.

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

/// Identity of the device that a link must open. A different device is refused; the error names
/// both.
struct UsbIdentity {
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::string serial;              ///< empty: exactly one such device must be connected
  std::uint8_t configuration = 1;  ///< selected when the device is opened
  std::uint8_t bulk_endpoint = 0;  ///< must exist; address including the direction bit
};

struct UsbBulkStream {
  std::size_t transfer_bytes = 2048;  ///< a multiple of the endpoint's packet
  std::size_t in_flight = 32;         ///< number of pending requests
};

enum class UsbOutcome : std::uint8_t {
  Done,
  Stalled,  ///< refused by the device; a bulk endpoint stays stalled until its halt is cleared
  Failed,   ///< any other failure with the device still connected
};

/// Event: the device is open, its identity matches, and its configuration is selected.
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
/// Event: a bulk-in transfer has ended; its request is submitted again automatically. `bytes` are
/// valid until the next wait().
struct UsbBulkIn {
  std::span<const std::byte> bytes;
  protocol::HostTime arrival{};
  UsbOutcome outcome = UsbOutcome::Done;
};
/// Event after stop_bulk_in(): no transfer is in flight any more.
struct UsbBulkStopped {};
/// Event: the link is closed, because the device was removed, was refused, or was not found. open()
/// tries again.
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

  /// Starts to open the device; UsbOpened or UsbLost follows.
  virtual void open() = 0;
  /// Closes immediately and without an event.
  virtual void close() noexcept = 0;
  /// Starts a control transfer; only one may be pending. UsbControlDone follows; no event if the
  /// device does not answer. Writes have no data stage. usb::clear_halt() also clears the halt
  /// state in the host.
  virtual void control(const usb::Setup& setup) = 0;
  /// Submits `in_flight` requests to the bulk endpoint of the identity and keeps this number
  /// pending.
  virtual void start_bulk_in(const UsbBulkStream& stream) = 0;
  /// Cancels all bulk requests; UsbBulkStopped follows.
  virtual void stop_bulk_in() = 0;
  /// Waits for at most `wall` of the operating system's time. The events are valid until the next
  /// call.
  [[nodiscard]] virtual std::span<const UsbEvent> wait(std::chrono::nanoseconds wall) = 0;
  /// Name of the device for messages: "USB 09DB:00CA", "USB/IP 127.0.0.1:3240 1-1".
  [[nodiscard]] virtual std::string name() const = 0;
};

/// Text such as "it is 1209:0001, configured is 09DB:00CA"; empty if the IDs match.
[[nodiscard]] std::string wrong_ids(const UsbIdentity& wanted, std::uint16_t vendor,
                                    std::uint16_t product);
/// Text such as "its serial number is A, configured is B"; empty if the numbers match or none is
/// configured.
[[nodiscard]] std::string wrong_serial(const UsbIdentity& wanted, std::string_view serial);

}  // namespace abbe::drivers
