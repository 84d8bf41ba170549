#pragma once
/// A USB device behind a USB/IP server (TCP), without a kernel driver: for simulated devices, for
/// devices on another computer, and where no kernel module may be loaded. Servers: `usbipd`,
/// abbe-sim.

#include <cstdint>
#include <string>
#include <vector>

#include "abbe/drivers/tcp_client.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/drivers/usb/usb_link.hpp"
#include "abbe/protocol/usbip/operations.hpp"
#include "abbe/protocol/usbip/urb.hpp"

namespace abbe::drivers {

namespace usbip = protocol::usbip;

struct UsbipOptions {
  std::string host = "127.0.0.1";
  std::uint16_t port = usbip::kPort;
  std::string bus_id = "1-1";
  UsbIdentity identity;
};

class UsbipLink final : public UsbLink {
 public:
  /// `time` must outlive the link.
  UsbipLink(const UsbipOptions& options, const TimeSource& time);

  void open() override;
  void close() noexcept override;
  void control(const usb::Setup& setup) override;
  void start_bulk_in(const UsbBulkStream& stream) override;
  void stop_bulk_in() override;
  [[nodiscard]] std::span<const UsbEvent> wait(std::chrono::nanoseconds wall) override;
  [[nodiscard]] std::string name() const override;

 private:
  enum class State : std::uint8_t { Closed, Connecting, Importing, Inspecting, Open };
  /// Requests to the device before it is reported as opened, in this order.
  enum class Inspection : std::uint8_t { Device, Configuration, Serial, Select };
  struct Pending {
    std::uint32_t sequence;
    bool bulk;
    std::uint32_t length;  ///< maximum length of the answer, bytes
    std::uint32_t unlink;  ///< sequence number of the request that cancels this one; 0: none
  };

  void disconnect() noexcept;
  void lose(ErrorCode code, const std::string& seen);
  void send(std::span<const std::byte> bytes);
  std::uint32_t submit(const usbip::Submit& request, bool bulk);
  void submit_control(const usb::Setup& setup);
  void submit_bulk(std::size_t count);

  void make_room();
  void read();
  void parse();
  [[nodiscard]] bool parse_import();
  [[nodiscard]] bool parse_urb();
  [[nodiscard]] bool take(const usbip::SubmitReply& reply);
  [[nodiscard]] bool take(const usbip::UnlinkReply& reply);
  void finish(const Pending& pending, usbip::UrbStatus status, std::span<const std::byte> bytes);
  void finish_control(UsbOutcome outcome, std::span<const std::byte> bytes);
  void finish_bulk(UsbOutcome outcome, std::span<const std::byte> bytes);
  void inspect(std::span<const std::byte> bytes);
  void inspected_device(std::span<const std::byte> bytes);
  void request_next();
  void report_if_stopped();
  [[nodiscard]] std::span<const std::byte> unread() const {
    return std::span{buffer_}.subspan(begin_, end_ - begin_);
  }

  UsbipOptions options_;
  const TimeSource& time_;
  TcpClient tcp_;
  State state_ = State::Closed;
  Inspection inspection_ = Inspection::Device;
  std::uint32_t device_id_ = 0;
  std::uint8_t serial_string_ = 0;
  std::string serial_;
  std::uint32_t sequence_ = 0;
  usb::Setup control_setup_;
  std::vector<Pending> pending_;
  UsbBulkStream stream_;
  bool streaming_ = false;
  bool stopping_ = false;
  std::size_t resubmit_ = 0;  ///< transfers to submit again in the next wait()
  std::vector<UsbEvent> events_;
  std::vector<UsbEvent> pending_events_;  ///< for the next return of wait()
  std::vector<std::byte> outgoing_;
  std::vector<std::byte> buffer_;
  std::size_t begin_ = 0;
  std::size_t end_ = 0;
  protocol::HostTime arrival_{};
};

}  // namespace abbe::drivers
