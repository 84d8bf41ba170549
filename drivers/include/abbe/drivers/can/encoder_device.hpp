#pragma once
/// All encoders of one CAN bus as a Device: configures the nodes, is the SYNC producer, and turns
/// their answers into one AxisSample per SYNC. The sample leaves as soon as the last axis has
/// answered.
///
/// Before it sends anything it listens (ForeignSync): on a bus with another SYNC producer it sends
/// nothing. With SyncSource::External it never sends anything: the SYNC and the configuration of
/// the nodes are the machine's own.
///
/// The SYNC runs on the host clock at start + n x period: no drift; a period that could not be
/// served is left out, counted, and marked as a gap on the next sample. It runs while at least one
/// node is configured and the bus is not off. With SyncSource::Kernel the SYNC comes from the
/// kernel's timer instead. On SocketCAN its echo is the time in both cases: on most controllers
/// when the frame was on the wire.
///
/// States: "closed", "listening", "foreign SYNC" (refused), "no SYNC" (External), "configuring",
/// "silent", "degraded" (some axes are missing), "streaming" (all axes are current), "bus off".
/// Time-outs are judged only when everything that had come was read.

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/drivers/can/axis_presence.hpp"
#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/drivers/can/emergency_reports.hpp"
#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/drivers/can/encoder_supervisor.hpp"
#include "abbe/drivers/can/foreign_sync.hpp"
#include "abbe/drivers/can/sync_under_way.hpp"
#include "abbe/drivers/can/together_arrivals.hpp"
#include "abbe/drivers/device.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::drivers {

enum class SyncSource {
  /// the device thread sends it, on any transport; without an echo its time is read just before
  Thread,
  Kernel,  ///< CAN_BCM sends it, whatever the thread does; SocketCAN only
  /// the machine sends it, and has configured the nodes: nothing at all is sent from here
  External,
};

struct EncoderDeviceOptions {
  std::string name = "encoders";
  EncoderReceiverOptions receiver;
  SupervisorOptions supervisor;
  SyncSource sync = SyncSource::Thread;
  /// after the transport failed
  std::chrono::nanoseconds reopen_after = std::chrono::milliseconds{250};
  std::size_t sample_capacity = 8192;  ///< 8 s at 1 kHz
  std::size_t raw_capacity_blocks = 8192;
};

class EncoderDevice final : public Device {
 public:
  /// `time` must outlive the device. BadConfiguration as check(), and for a SYNC that `bus` cannot
  /// send. The bus is opened by the first wait().
  [[nodiscard]] static Result<std::unique_ptr<EncoderDevice>> create(
      const EncoderDeviceOptions& options, std::unique_ptr<CanBus> bus, const TimeSource& time);

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// One reader each.
  [[nodiscard]] SampleRing<protocol::AxisSample>& samples() noexcept { return samples_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }
  /// The device thread's own view.
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
  void judge(protocol::HostTime now);
  void stop_sending();
  void follow_foreign_sync(protocol::HostTime now);
  void follow_external_sync(protocol::HostTime now);
  void send_sync();
  void follow_kernel_sync();
  /// Faults that come by the frame, told once a second.
  struct Told {
    std::uint64_t count = 0;
    std::optional<protocol::HostTime> at;
  };
  void tell_of(std::uint64_t count, Told& told, std::string_view what, protocol::HostTime now);
  void tell_of_late_answers(protocol::HostTime now);
  void tell_of_many_late(protocol::HostTime now);
  void send_configuration();
  [[nodiscard]] bool send(const can::CanFrame& frame);
  void read_batch(protocol::HostTime now, std::chrono::nanoseconds at_most);
  void look_at(const ReceivedFrame& received);
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
  SyncUnderWay sync_under_way_;
  ForeignSync foreign_;
  AxisPresence presence_;
  EmergencyReports emergencies_;
  std::string condition_;  ///< as shown

  bool open_ = false;
  bool sending_ = false;  ///< the supervisor runs
  bool bus_was_off_ = false;
  protocol::HostTime off_since_{};
  /// since the bus went off: its controller was started again, whoever heard it
  bool reopened_ = false;
  bool caught_up_ = true;     ///< everything that came before this SYNC is read
  bool unreachable_ = false;  ///< told already
  std::string refusal_;       ///< why it could not be opened, as told already
  bool kernel_sync_ = false;  ///< runs
  bool foreign_told_ = false;
  bool no_sync_told_ = false;
  bool period_told_ = false;
  protocol::HostTime opened_at_{};
  protocol::HostTime reopen_at_{};
  std::optional<protocol::HostTime> next_sync_;
  protocol::HostTime last_heard_{};
  CanBusCounters bus_seen_;
  std::uint64_t missed_seen_ = 0;
  std::uint64_t samples_seen_ = 0;
  std::uint64_t kept_back_ = 0;  ///< SYNCs
  Told kept_back_told_, shorts_told_, duplicates_told_, strangers_told_, bundled_told_, late_told_;
  TogetherArrivals together_;

  std::array<ReceivedFrame, CanBus::kMostRead> came_{};
  std::array<ReceivedFrame, CanBus::kMostRead + 1> batch_{};  ///< what the receiver sees of it
  std::size_t batch_count_ = 0;
  bool all_read_ = true;            ///< nothing else came
  protocol::HostTime cycle_end_{};  ///< what came before is read, if all_read_
  std::uint8_t raw_sequence_ = 0;
  std::array<std::byte, protocol::RawBlock::kCapacity> datagram_{};
};

}  // namespace abbe::drivers
