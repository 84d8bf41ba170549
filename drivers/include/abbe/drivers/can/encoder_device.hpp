#pragma once
/// All encoders of one CAN bus as a Device: configures the nodes, produces the SYNC, and converts
/// the answers to one AxisSample per SYNC. The sample is output as soon as the last axis has
/// answered, or later if EncoderReceiver holds it because an axis may answer a second time.
///
/// The device listens before it sends (ForeignSync): on a bus with another SYNC producer it sends
/// nothing. With SyncSource::External it never sends: the machine produces the SYNC and configures
/// the nodes.
///
/// SYNC number n is due at start + n x period on the host clock, so the period does not drift. A
/// SYNC that is late by a period or more is skipped and counted, and the next sample is marked with
/// a gap. The SYNC runs while at least one node is configured and the bus is not off. With
/// SyncSource::Kernel a timer of the kernel sends the SYNC. On SocketCAN the time of a SYNC is the
/// time of its echo, with SyncSource::Thread and with Kernel: on most controllers the end of its
/// transmission.
///
/// States:
///   "closed"
///   "listening"
///   "foreign SYNC"  another SYNC producer is on the bus: nothing is sent
///   "no SYNC"       SyncSource::External only
///   "configuring"
///   "silent"        no node answers
///   "degraded"      some axes are missing
///   "streaming"     all axes are current
///   "bus off"
/// Time-outs are checked only after all frames that have arrived were read.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/drivers/can/axis_presence.hpp"
#include "abbe/drivers/can/bundle_detector.hpp"
#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/drivers/can/emergency_reports.hpp"
#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/drivers/can/encoder_supervisor.hpp"
#include "abbe/drivers/can/foreign_sync.hpp"
#include "abbe/drivers/can/pending_sync.hpp"
#include "abbe/drivers/device.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::drivers {

enum class SyncSource {
  /// The device thread sends the SYNC, on any transport. On a transport without echoes the time of
  /// the SYNC is read immediately before send().
  Thread,
  Kernel,  ///< CAN_BCM sends the SYNC, independently of the thread; SocketCAN only
  /// The machine sends the SYNC and configures the nodes; this device sends nothing.
  External,
};

struct EncoderDeviceOptions {
  std::string name = "encoders";
  EncoderReceiverOptions receiver;
  SupervisorOptions supervisor;
  SyncSource sync = SyncSource::Thread;
  /// wait before the bus is opened again after a failure of the transport
  std::chrono::nanoseconds reopen_after = std::chrono::milliseconds{250};
  /// Text for the fault "answers to several SYNCs come at once": the likely cause and the remedy.
  std::string delay_advice =
      "the tunnel delays frames (cannelloni: set -t, in us, well below the SYNC period)";
  std::size_t sample_capacity = 8192;  ///< 8 s at 1 kHz
  std::size_t raw_capacity_blocks = 8192;
};

class EncoderDevice final : public Device {
 public:
  /// `time` must outlive the device. Error BadConfiguration: check() refuses the options, or
  /// SyncSource::Kernel with a `bus` that has no cyclic transmission. The first wait() opens the
  /// bus.
  [[nodiscard]] static Result<std::unique_ptr<EncoderDevice>> create(
      const EncoderDeviceOptions& options, std::unique_ptr<CanBus> bus, const TimeSource& time);

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// Each ring has one reader.
  [[nodiscard]] SampleRing<protocol::AxisSample>& samples() noexcept { return samples_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }
  /// The receiver. To be used by the device thread only.
  [[nodiscard]] const EncoderReceiver& receiver() const noexcept { return receiver_; }

 private:
  EncoderDevice(const EncoderDeviceOptions& options, std::unique_ptr<CanBus> bus,
                const TimeSource& time);

  [[nodiscard]] bool ensure_open(std::chrono::nanoseconds at_most);
  void close_bus(const Error& error);
  void follow_bus_off(protocol::HostTime now);
  [[nodiscard]] bool bus_off() const { return receiver_.bus_off() && !reopened_; }
  [[nodiscard]] bool external() const { return options_.sync == SyncSource::External; }
  [[nodiscard]] bool is_behind(protocol::HostTime now) const;
  void check_timeouts(protocol::HostTime now);
  void stop_sending();
  void follow_foreign_sync(protocol::HostTime now);
  void follow_external_sync(protocol::HostTime now);
  void send_sync();
  void follow_kernel_sync();
  /// The latest fault of a kind that can occur with every frame. It is reported at most once a
  /// second, with its count.
  struct Reported {
    std::uint64_t count = 0;
    std::optional<protocol::HostTime> at;
  };
  void report_count(std::uint64_t count, Reported& reported, std::string_view what,
                    protocol::HostTime now);
  void report_late_answers(protocol::HostTime now);
  void report_many_late(protocol::HostTime now);
  void send_configuration();
  [[nodiscard]] bool send(const can::CanFrame& frame);
  void read_batch(protocol::HostTime now, std::chrono::nanoseconds at_most);
  void dispatch(const ReceivedFrame& received);
  void account(protocol::HostTime now);
  void show_state(protocol::HostTime now);
  void show_condition(protocol::HostTime now);
  [[nodiscard]] const char* state_text(protocol::HostTime now) const;
  [[nodiscard]] bool syncing() const;

  void record_frames(std::span<const ReceivedFrame> frames) ABBE_RT;
  void record(protocol::HostTime time, protocol::RawBlock::Direction direction,
              std::span<const can::CanFrame> frames) ABBE_RT;
  void push(std::span<const protocol::AxisSample> samples) ABBE_RT;

  EncoderDeviceOptions options_;
  std::unique_ptr<CanBus> bus_;
  const TimeSource& time_;
  SampleRing<protocol::AxisSample> samples_;
  RawRing raw_;
  StatusBoard board_;
  EncoderReceiver receiver_;
  EncoderSupervisor supervisor_;
  PendingSync pending_sync_;
  ForeignSync foreign_;
  AxisPresence presence_;
  EmergencyReports emergencies_;
  std::string condition_;  ///< the text last written to board_

  bool open_ = false;
  bool sending_ = false;  ///< the supervisor runs and may send
  bool bus_was_off_ = false;
  protocol::HostTime off_since_{};
  /// The bus was opened again after bus-off, which restarts the controller; receiver_ still reports
  /// bus-off until it receives a frame.
  bool reopened_ = false;
  bool caught_up_ = true;     ///< all frames that arrived before the latest SYNC were read
  bool unreachable_ = false;  ///< already reported
  std::string refusal_;       ///< reported reason why the bus could not be opened
  bool kernel_sync_ = false;  ///< the kernel sends the SYNC
  bool foreign_reported_ = false;
  bool no_sync_reported_ = false;
  bool period_reported_ = false;
  protocol::HostTime opened_at_{};
  protocol::HostTime reopen_at_{};
  std::optional<protocol::HostTime> next_sync_;
  protocol::HostTime last_heard_{};
  CanBusCounters bus_seen_;
  std::uint64_t missed_seen_ = 0;
  std::uint64_t withheld_syncs_ = 0;
  Reported withheld_reported_, shorts_reported_, duplicates_reported_, strangers_reported_,
      bundled_reported_, late_reported_;
  BundleDetector together_;

  std::array<ReceivedFrame, CanBus::kMostRead> came_{};       ///< read from the bus
  std::array<ReceivedFrame, CanBus::kMostRead + 1> batch_{};  ///< for the receiver
  std::size_t batch_count_ = 0;
  bool all_read_ = true;  ///< CanRead::all
  /// valid if all_read_: all frames that arrived earlier were read
  protocol::HostTime cycle_end_{};
  std::uint8_t raw_sequence_ = 0;
  std::array<std::byte, protocol::RawBlock::kCapacity> datagram_{};
};

}  // namespace abbe::drivers
