#pragma once
/// The configured devices with their rings and threads, as one thing the hub can drain. The
/// devices' threads are theirs; every function here but end_machine() is for the hub's thread.

#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/config.hpp"
#include "abbe/drivers/ippdme/session.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/pipeline/sample_source.hpp"
#include "abbe/pipeline/stream_health.hpp"

namespace abbe::daemon {

class DeviceSet final : public SampleSource {
 public:
  /// Creates the devices and starts their threads. Io when the system refuses what real-time mode
  /// `enforce` asks for, BadInput for a device that cannot be opened as configured. `time` must
  /// outlive the set. `left`: how far an earlier run left the counters of [counter_card], which
  /// then go on if the card did.
  [[nodiscard]] static Result<DeviceSet> start(
      const Config& config, const drivers::TimeSource& time,
      const std::optional<drivers::CounterCardProgress>& left = std::nullopt);
  ~DeviceSet() override;  ///< stops all threads
  DeviceSet(DeviceSet&&) noexcept;
  DeviceSet& operator=(DeviceSet&&) noexcept;

  void drain(Batch& batch) override;
  [[nodiscard]] std::vector<StreamHealth> health(protocol::HostTime now) override;
  /// What the system refused in real-time mode `ignore`, one sentence each.
  [[nodiscard]] std::vector<std::string> warnings() const;
  [[nodiscard]] std::optional<drivers::CounterCardProgress> card_progress() override;
  /// One of the devices moves and touches by itself.
  [[nodiscard]] bool moves() const;
  void measure(std::span<const drivers::ProbePoint> points) override;
  void stop_machine() override;
  /// Any thread, takes no lock: a motion of the measuring machine is stopped and its session ends,
  /// whether or not this is ever destroyed. No release is awaited.
  void end_machine();
  [[nodiscard]] std::optional<std::string> release_awaited() const override;
  [[nodiscard]] Result<void> release_machine() override;
  [[nodiscard]] std::optional<TipPlace> tip_place() const override;
  [[nodiscard]] std::size_t points_left() const override;
  [[nodiscard]] Result<std::array<double, 3>> machine_position() const override;
  [[nodiscard]] std::optional<drivers::DeviceStatus> tracker_status() const override;
  void order_tracker(drivers::TrackerOrder order) override;
  [[nodiscard]] std::vector<drivers::TrackerOrderReport> tracker_reports() override;

 private:
  struct State;
  explicit DeviceSet(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
