#pragma once
/// A Modbus device that measures the environment, as a Device: EnvironmentReceiver around one
/// ModbusLine. wait(): opens, asks one question, blocks for its answer. receive(): bytes to samples
/// and raw blocks. Whatever goes wrong ends the connection (one that others use as well, see
/// EnvironmentLine, when none of them has answered meanwhile); the device then begins with the
/// proving registers, so that one that was exchanged is found. States: "closed", "proving",
/// "reading", "refused" (wrong device or map: tried again every `refused_retry`).

#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <string_view>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/environment/link.hpp"
#include "abbe/drivers/environment/modbus_line.hpp"
#include "abbe/drivers/environment/receiver.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::drivers {

struct EnvironmentDeviceOptions {
  std::string name = "environment";
  ModbusAddress address;
  RegisterMap map;
  std::chrono::nanoseconds period = std::chrono::seconds{1};  ///< of the rounds, on a grid
  std::chrono::nanoseconds answer_timeout = std::chrono::milliseconds{500};
  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{1};  ///< wall time
  std::chrono::nanoseconds retry = std::chrono::milliseconds{250};     ///< after a fault
  std::chrono::nanoseconds refused_retry = std::chrono::seconds{10};
  std::size_t sample_capacity = 64;
  std::size_t raw_capacity_blocks = 256;
};

class EnvironmentDevice final : public Device {
 public:
  /// `time` must outlive the device. BadConfiguration as check(RegisterMap), or without host or
  /// path. The line is opened by the first wait().
  [[nodiscard]] static Result<std::unique_ptr<EnvironmentDevice>> create(
      const EnvironmentDeviceOptions& options, const TimeSource& time);
  /// Over a connection that others use as well; it must outlive the device.
  [[nodiscard]] static Result<std::unique_ptr<EnvironmentDevice>> create(
      const EnvironmentDeviceOptions& options, const TimeSource& time, EnvironmentLink& link);

  /// Device thread: an answer is under way, or there and not looked at.
  [[nodiscard]] bool busy() const noexcept;
  /// Device thread: has begun on the connection as it is now.
  [[nodiscard]] bool on_line() const noexcept {
    return link_.line.is_open() && opening_ == link_.openings;
  }
  /// Device thread: the connection has gone, and not by us.
  void lose(std::string_view what);
  /// Device thread: somebody else found that the connection has gone, and reports it.
  void line_closed() noexcept;
  /// Device thread: when it next asks or opens.
  [[nodiscard]] protocol::HostTime due() const noexcept;

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// One reader each.
  [[nodiscard]] SampleRing<protocol::EnvironmentSample>& samples() noexcept { return samples_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }

 private:
  using Progress = EnvironmentReceiver::Progress;

  EnvironmentDevice(const EnvironmentDeviceOptions& options, const TimeSource& time,
                    EnvironmentLink& link);

  void heed_progress(protocol::HostTime now);
  [[nodiscard]] bool ensure_open(std::chrono::nanoseconds at_most);
  void ask();
  void listen(std::chrono::nanoseconds at_most);
  void plan_next_round(protocol::HostTime now);
  [[nodiscard]] bool open_line();
  [[nodiscard]] bool others_answered() noexcept;
  void leave_line(std::chrono::nanoseconds retry, std::chrono::nanoseconds quiet);
  /// `quiet`: how long an answer to what was asked may still come.
  void fail(std::string_view what, std::chrono::nanoseconds retry, const char* state = "closed",
            std::chrono::nanoseconds quiet = std::chrono::milliseconds{50});

  EnvironmentDeviceOptions options_;
  const TimeSource& time_;
  SampleRing<protocol::EnvironmentSample> samples_;
  RawRing raw_;
  StatusBoard board_;
  EnvironmentReceiver receiver_;
  std::unique_ptr<EnvironmentLink> own_link_;  ///< empty: shared
  EnvironmentLink& link_;
  std::uint64_t opening_ = 0;  ///< of the link; 0: not begun on it
  std::uint64_t answers_ = 0;
  std::uint64_t others_at_fault_ = 0;  ///< answers of the others at the latest fault

  protocol::HostTime open_at_{};
  protocol::HostTime next_round_{};
  protocol::HostTime answer_due_{};
  protocol::HostTime arrival_{};
  std::uint64_t implausible_seen_ = 0;
  Progress progress_ = Progress::Waiting;  ///< from receive() to the next wait(), same thread
  std::size_t filled_ = 0;
  std::array<std::byte, modbus::kMaxAduSize> buffer_{};
};

}  // namespace abbe::drivers
