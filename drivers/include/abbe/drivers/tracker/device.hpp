#pragma once
/// A laser tracker with an emScon controller, as a Device: TrackerReceiver and TrackerSession over
/// one TCP connection. wait() connects, sends the commands of the session, and reads bytes.
/// receive() converts bytes to points, weather and raw blocks. The arrival time is the user-space
/// time at which the read returned; a kernel stamp would improve it by far less than the delay of a
/// burst. States: those of TrackerState.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/mailbox.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/session_over_tcp.hpp"
#include "abbe/drivers/tracker/receiver.hpp"
#include "abbe/drivers/tracker/session.hpp"

namespace abbe::drivers {

struct TrackerDeviceOptions {
  std::string name = "tracker";
  std::string host = "192.168.0.1";  ///< factory setting of the manufacturer
  std::uint16_t port = emscon::kPort;
  TrackerSessionOptions session;  ///< `peer` is made from name, host and port
  ClockModelOptions clock;
  /// Advice in the fault text for a tracker whose clock runs too fast or too slowly.
  std::string clock_advice = "have the tracker serviced";
  std::size_t point_capacity = 16384;  ///< 32 s at 500 points per second
  std::size_t environment_capacity = 256;
  std::size_t raw_capacity_blocks = 4096;
};

/// Options of the receiver of this device; a replay needs the same ones.
[[nodiscard]] TrackerReceiverOptions receiver_options(const TrackerDeviceOptions& options);

/// Parameter `Words` of SessionOverTcp.
struct TrackerWords {
  using Session = TrackerSession;
  using Input = TrackerInput;
  using Action = TrackerAction;
  using Open = TrackerOpen;
  using Send = TrackerSend;
  using Close = TrackerClose;
  using Connected = TrackerConnected;
  using ConnectionLost = TrackerConnectionLost;
  using Message = std::variant<TrackerPointsArrived, emscon::Answer, emscon::ErrorResponse,
                               emscon::StatusChange, TrackerProtocolError>;
  static constexpr std::size_t kInbox = 128;
  static constexpr std::size_t kMostRead = emscon::kMaxPacketSize;
};

class TrackerDevice final : public Device, private SessionOverTcp<TrackerDevice, TrackerWords> {
 public:
  /// `time` must outlive the device. Error BadConfiguration as check(). The first wait() opens the
  /// connection.
  [[nodiscard]] static Result<std::unique_ptr<TrackerDevice>> create(
      const TrackerDeviceOptions& options, const TimeSource& time);
  /// Stops the measurement and restores the settings that abbe changed. Takes at most
  /// TrackerSessionOptions::leave_within.
  ~TrackerDevice() override;

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;
  /// Device thread. Stops the measurement and restores the settings that abbe changed. True when
  /// that is complete; until then call wait(), receive() and finish() again.
  [[nodiscard]] bool finish();

  /// Any thread. Requests an order. One order is carried out at a time; an order that cannot be
  /// carried out gets the report Refused.
  void order(TrackerOrder order) { orders_.put(std::move(order)); }
  /// Any thread. The reports of the orders that have ended since the last call; one report per
  /// order.
  [[nodiscard]] std::vector<TrackerOrderReport> reports() { return reports_.take(); }

  /// One reader thread for each ring.
  [[nodiscard]] SampleRing<protocol::TrackerPoint>& points() noexcept { return points_; }
  [[nodiscard]] SampleRing<protocol::EnvironmentSample>& environment() noexcept {
    return environment_;
  }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }

 private:
  friend class SessionOverTcp<TrackerDevice, TrackerWords>;

  TrackerDevice(const TrackerDeviceOptions& options, TcpPeer peer, const TimeSource& time);

  [[nodiscard]] std::span<const std::byte> encode(const TrackerSend& command);
  void connected() { began_ = true; }
  void disconnected() { began_ = false; }
  void handle_orders();
  void keep_report();
  void restore_settings();
  void report_clock();
  void report_cause();
  void report_times();

  void take(const TrackerBurst& burst) ABBE_RT;
  void take(const protocol::EnvironmentSample& sample) ABBE_RT { environment_.try_push(sample); }
  template <class M>
  void take(const M& message) ABBE_RT {
    post(message);
  }
  void take(const TrackerPointsArrived& arrived) ABBE_RT;

  TrackerDeviceOptions options_;
  SampleRing<protocol::TrackerPoint> points_;
  SampleRing<protocol::EnvironmentSample> environment_;
  RawRing raw_;
  TrackerReceiver receiver_;
  Mailbox<TrackerOrder> orders_;
  Mailbox<TrackerOrderReport> reports_;

  bool clock_reported_ = false;
  std::string cause_reported_;
  std::uint64_t gaps_seen_ = 0;
  std::uint64_t times_refused_seen_ = 0;
  std::uint64_t time_jumps_seen_ = 0;
  bool began_ = false;  ///< there is a new connection for which the receiver is not yet reset
  std::array<std::byte, emscon::kMaxRequestSize> command_{};
};

}  // namespace abbe::drivers
