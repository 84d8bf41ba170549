#pragma once
/// A Modbus device that measures the environment, as a Device: EnvironmentReceiver and one
/// ModbusLine. wait() opens the connection, sends one request and blocks for its answer. receive()
/// converts bytes to samples and raw blocks.
/// A fault closes the connection. Exception: a connection shared with other devices (see
/// EnvironmentLine) stays open if one of the others has answered since this device's previous
/// fault. After a fault the device reads the proving registers (register_map.hpp) again, so that an
/// exchanged device is detected.
/// States: "closed", "proving", "reading", "refused" (wrong device or map; retried every
/// `refused_retry`).

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
  std::chrono::nanoseconds period = std::chrono::seconds{1};  ///< between starts of rounds
  std::chrono::nanoseconds answer_timeout = std::chrono::milliseconds{500};
  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{1};  ///< wall time
  std::chrono::nanoseconds retry = std::chrono::milliseconds{250};     ///< pause after a fault
  std::chrono::nanoseconds refused_retry = std::chrono::seconds{10};
  std::size_t sample_capacity = 64;
  std::size_t raw_capacity_blocks = 256;
};

class EnvironmentDevice final : public Device {
 public:
  /// `time` must outlive the device. Error BadConfiguration as check(RegisterMap), for a missing
  /// host or path, or for a period not above 0. The first wait() opens the line.
  [[nodiscard]] static Result<std::unique_ptr<EnvironmentDevice>> create(
      const EnvironmentDeviceOptions& options, const TimeSource& time);
  /// Same as the create() above, but over a connection shared with other devices; `link` must
  /// outlive the device.
  [[nodiscard]] static Result<std::unique_ptr<EnvironmentDevice>> create(
      const EnvironmentDeviceOptions& options, const TimeSource& time, EnvironmentLink& link);

  /// Device thread: true if an answer is outstanding, or has arrived and is not yet handled.
  [[nodiscard]] bool busy() const noexcept;
  /// Device thread: the line is open, and this device has sent requests on the present connection.
  [[nodiscard]] bool on_line() const noexcept {
    return link_.line.is_open() && opening_ == link_.openings;
  }
  /// Device thread: to be called when the connection was lost; `what` is the reason.
  void lose(std::string_view what);
  /// Device thread: to be called when another device of the line has closed the connection, which
  /// also reports the fault.
  void line_closed() noexcept;
  /// Device thread: the time at which this device next sends a request or opens the line.
  [[nodiscard]] protocol::HostTime due() const noexcept;

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// One reader thread for each ring.
  [[nodiscard]] SampleRing<protocol::EnvironmentSample>& samples() noexcept { return samples_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }

 private:
  using Progress = EnvironmentReceiver::Progress;

  EnvironmentDevice(const EnvironmentDeviceOptions& options, const TimeSource& time,
                    EnvironmentLink& link);

  void handle_progress(protocol::HostTime now);
  [[nodiscard]] bool ensure_open(std::chrono::nanoseconds at_most);
  void send_request();
  void read_answer(std::chrono::nanoseconds at_most);
  void plan_next_round(protocol::HostTime now);
  [[nodiscard]] bool open_line();
  [[nodiscard]] bool others_answered() noexcept;
  void leave_line(std::chrono::nanoseconds retry, std::chrono::nanoseconds quiet);
  /// Handles a fault. `quiet`: for this long a late answer to the last request may still arrive.
  void fail(std::string_view what, std::chrono::nanoseconds retry, const char* state = "closed",
            std::chrono::nanoseconds quiet = std::chrono::milliseconds{50});

  EnvironmentDeviceOptions options_;
  const TimeSource& time_;
  SampleRing<protocol::EnvironmentSample> samples_;
  RawRing raw_;
  StatusBoard board_;
  EnvironmentReceiver receiver_;
  std::unique_ptr<EnvironmentLink> own_link_;  ///< null if the link is shared
  EnvironmentLink& link_;
  /// value of link_.openings when this device began reading; 0: not begun
  std::uint64_t opening_ = 0;
  std::uint64_t answers_ = 0;
  std::uint64_t others_at_fault_ = 0;  ///< answers of the other devices until the latest fault

  protocol::HostTime open_at_{};
  protocol::HostTime next_round_{};
  protocol::HostTime answer_due_{};
  protocol::HostTime arrival_{};
  std::uint64_t implausible_seen_ = 0;
  /// passed from receive() to the next wait(), same thread
  Progress progress_ = Progress::Waiting;
  std::size_t filled_ = 0;
  std::array<std::byte, modbus::kMaxAduSize> buffer_{};
};

}  // namespace abbe::drivers
