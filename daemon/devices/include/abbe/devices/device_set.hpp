#pragma once
/// All configured devices with their rings and threads, as one sample source for the hub. Each
/// device runs its own thread. All functions except end_machine(), stop_machine() and
/// machine_stop() must be called from the hub's thread.

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
  /// Creates the devices and starts their threads. Io if the operating system refuses a setting
  /// that real-time mode `enforce` requires, BadInput for a device that cannot be opened as
  /// configured. `time` must outlive the set. `left`: state of the counters when abbed ended last;
  /// the driver continues from it if the card has kept counting since.
  [[nodiscard]] static Result<DeviceSet> start(
      const Config& config, const drivers::TimeSource& time,
      const std::optional<CountingProgress>& left = std::nullopt);
  ~DeviceSet() override;  ///< stops all threads
  DeviceSet(DeviceSet&&) noexcept;
  DeviceSet& operator=(DeviceSet&&) noexcept;

  void drain(Batch& batch) override;
  [[nodiscard]] std::vector<StreamHealth> health(protocol::HostTime now) override;
  /// One sentence for each real-time setting that the operating system refused (real-time mode
  /// `ignore`), and for each assumption of a driver.
  [[nodiscard]] std::vector<std::string> warnings() const;
  [[nodiscard]] std::optional<CountingProgress> card_progress() override;
  /// True if a device moves and probes under its own control (a measuring machine).
  [[nodiscard]] bool moves() const;
  void measure(std::span<const drivers::ProbePoint> points) override;
  [[nodiscard]] Result<std::uint64_t> stop_machine() override;
  [[nodiscard]] drivers::IppStop machine_stop() const override;
  /// Stops a motion of the measuring machine and ends its session, also if this object is never
  /// destroyed. The machine then needs no release (see release_machine()). May be called from any
  /// thread; takes no lock.
  void end_machine();
  /// Same as end_machine(), but waits until the machine is stopped or until it is known that the
  /// stop cannot be confirmed. No other function may be called afterwards. nullopt: no measuring
  /// machine.
  std::optional<drivers::IppStop> finish_machine();
  [[nodiscard]] std::optional<std::string> release_awaited() const override;
  [[nodiscard]] Result<void> release_machine() override;
  [[nodiscard]] std::optional<TipPlace> tip_place() const override;
  [[nodiscard]] std::size_t points_left() const override;
  [[nodiscard]] Result<std::array<double, 3>> machine_position() const override;
  [[nodiscard]] std::optional<drivers::DeviceStatus> tracker_status() const override;
  void order_tracker(drivers::TrackerOrder order) override;
  /// Longest host time from an order to the tracker to the report of its outcome; 0 without a
  /// tracker.
  [[nodiscard]] std::chrono::nanoseconds longest_tracker_order() const;
  [[nodiscard]] std::vector<drivers::TrackerOrderReport> tracker_reports() override;

 private:
  struct State;
  explicit DeviceSet(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace abbe::daemon
