#pragma once
/// All encoders of one CAN bus as a Device: configures the nodes, is the SYNC producer, and turns their
/// answers into one AxisSample per SYNC. The sample leaves as soon as the last axis has answered.
///
/// The SYNC runs on the host clock at start + n x period: no drift; a period that could not be served is left
/// out, counted, and marked as a gap on the next sample. It runs while at least one node is configured and
/// the bus is not off. With SyncSource::Kernel the SYNC comes from the kernel's timer instead. On SocketCAN
/// its echo is the time in both cases: on most controllers when the frame was on the wire. States:
/// "closed", "configuring", "silent", "degraded" (some nodes), "streaming" (all nodes), "bus off".

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/drivers/can/encoder_supervisor.hpp"
#include "abbe/drivers/can/sync_under_way.hpp"
#include "abbe/drivers/device.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::drivers {

enum class SyncSource {
  Thread,  ///< the device thread sends it, on any transport; without an echo its time is read just before
  Kernel,  ///< CAN_BCM sends it, whatever the thread does; SocketCAN only
};

struct EncoderDeviceOptions {
  std::string name = "encoders";
  EncoderReceiverOptions receiver;
  SupervisorOptions supervisor;
  SyncSource sync = SyncSource::Thread;
  std::chrono::nanoseconds reopen_after = std::chrono::milliseconds{250};  ///< after the transport failed
  std::size_t sample_capacity = 8192;                                      ///< 8 s at 1 kHz
  std::size_t raw_capacity_blocks = 8192;
};

class EncoderDevice final : public Device {
 public:
  /// `time` must outlive the device. BadConfiguration as check(), and for a SYNC that `bus` cannot send. The
  /// bus is opened by the first wait().
  [[nodiscard]] static Result<std::unique_ptr<EncoderDevice>> create(const EncoderDeviceOptions& options,
                                                                     std::unique_ptr<CanBus> bus,
                                                                     const TimeSource& time);

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// One reader each.
  [[nodiscard]] SampleRing<protocol::AxisSample>& samples() noexcept { return samples_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }
  /// The device thread's own view.
  [[nodiscard]] const EncoderReceiver& receiver() const noexcept { return receiver_; }

 private:
  EncoderDevice(const EncoderDeviceOptions& options, std::unique_ptr<CanBus> bus, const TimeSource& time);

  [[nodiscard]] bool ensure_open(std::chrono::nanoseconds at_most);
  void close_bus(const Error& error);
  void follow_bus_off(protocol::HostTime now);
  void send_sync();
  void follow_kernel_sync();
  /// Faults that come by the frame, told once a second.
  struct Told {
    std::uint64_t count = 0;
    std::optional<protocol::HostTime> at;
  };
  void tell_of(std::uint64_t count, Told& told, std::string_view what, protocol::HostTime now);
  void send_configuration();
  [[nodiscard]] bool send(const can::CanFrame& frame);
  void read_batch(protocol::HostTime now, std::chrono::nanoseconds at_most);
  void account(protocol::HostTime now);
  void show_state(protocol::HostTime now);
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

  bool open_ = false;
  bool bus_was_off_ = false;
  bool unreachable_ = false;  ///< told already
  std::string refusal_;       ///< why it could not be opened, as told already
  bool kernel_sync_ = false;  ///< runs
  bool rival_told_ = false;   ///< that somebody else sends SYNCs, too
  protocol::HostTime reopen_at_{};
  std::optional<protocol::HostTime> next_sync_;
  protocol::HostTime last_heard_{};
  CanBusCounters bus_seen_;
  std::uint64_t missed_seen_ = 0;
  std::uint64_t samples_seen_ = 0;
  std::uint64_t kept_back_ = 0;  ///< SYNCs
  Told kept_back_told_, shorts_told_, duplicates_told_;

  std::array<ReceivedFrame, CanBus::kMostRead> came_{};
  std::array<ReceivedFrame, CanBus::kMostRead + 1> batch_{};  ///< what the receiver sees of it
  std::size_t batch_count_ = 0;
  bool all_read_ = true;           ///< nothing else came
  protocol::HostTime turn_end_{};  ///< when the latest read returned
  std::uint8_t raw_sequence_ = 0;
  std::array<std::byte, protocol::RawBlock::kCapacity> datagram_{};
};

}  // namespace abbe::drivers
