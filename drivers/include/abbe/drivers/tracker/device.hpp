#pragma once
/// A laser tracker that speaks emScon, as a Device: TrackerReceiver and TrackerSession around one TCP
/// connection. wait(): connects, sends what the session asks for, reads. receive(): bytes to points, weather
/// and raw blocks. An arrival is when the read returned, in user space: what a kernel stamp could add is far
/// below the delay of a burst. States: those of TrackerState.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <variant>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/drivers/tcp_client.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/drivers/tracker/receiver.hpp"
#include "abbe/drivers/tracker/session.hpp"

namespace abbe::drivers {

struct TrackerDeviceOptions {
  std::string name = "tracker";
  std::string host = "192.168.0.1";  ///< as delivered by the manufacturer
  std::uint16_t port = emscon::kPort;
  TrackerSessionOptions session;  ///< `peer` is made from name, host and port
  ClockModelOptions clock;
  std::size_t point_capacity = 16384;  ///< 32 s at 500 points per second
  std::size_t environment_capacity = 256;
  std::size_t raw_capacity_blocks = 4096;
};

/// What the receiver of this device is made with; replay needs the same.
[[nodiscard]] TrackerReceiverOptions receiver_options(const TrackerDeviceOptions& options);

class TrackerDevice final : public Device {
 public:
  /// `time` must outlive the device. BadConfiguration as check(). The connection is opened by the first
  /// wait().
  [[nodiscard]] static Result<std::unique_ptr<TrackerDevice>> create(const TrackerDeviceOptions& options,
                                                                     const TimeSource& time);
  /// Asks a measuring controller to stop, without waiting for its answer.
  ~TrackerDevice() override;

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// One reader each.
  [[nodiscard]] SampleRing<protocol::TrackerPoint>& points() noexcept { return points_; }
  [[nodiscard]] SampleRing<protocol::EnvironmentSample>& environment() noexcept { return environment_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }

 private:
  using Message = std::variant<TrackerPointsArrived, emscon::Answer, emscon::ErrorResponse,
                               emscon::StatusChange, TrackerNonsense>;
  static constexpr std::size_t kInbox = 128;

  TrackerDevice(const TrackerDeviceOptions& options, const TimeSource& time);

  void tell(const TrackerInput& input);
  [[nodiscard]] bool act(const TrackerAction& action, TrackerInput& next);
  [[nodiscard]] bool open(TrackerInput& next);
  [[nodiscard]] bool send(const emscon::Request& request, TrackerInput& next);
  void close();
  void read_mail();
  void poll(std::chrono::nanoseconds at_most);
  void read();
  void show();

  void take(const TrackerBurst& burst) ABBE_RT;
  void take(const protocol::EnvironmentSample& sample) ABBE_RT { environment_.try_push(sample); }
  template <class M>
  void take(const M& message) ABBE_RT {
    post(message);
  }
  void post(const Message& message) ABBE_RT;

  TrackerDeviceOptions options_;
  const TimeSource& time_;
  SampleRing<protocol::TrackerPoint> points_;
  SampleRing<protocol::EnvironmentSample> environment_;
  RawRing raw_;
  StatusBoard board_;
  TrackerReceiver receiver_;
  TrackerSession session_;
  TcpClient tcp_;

  std::uint64_t faults_seen_ = 0;
  std::uint64_t gaps_seen_ = 0;
  bool began_ = false;  ///< a new connection, not yet told to the receiver
  protocol::HostTime arrival_{};
  std::size_t filled_ = 0;
  std::array<std::byte, emscon::kMaxPacketSize> buffer_{};
  std::array<Message, kInbox> inbox_{};  ///< from receive() to the next wait(), same thread
  std::size_t inbox_count_ = 0;
  std::uint64_t inbox_lost_ = 0;
};

}  // namespace abbe::drivers
