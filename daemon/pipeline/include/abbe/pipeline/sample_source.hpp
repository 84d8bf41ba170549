#pragma once
/// Where the hub's samples come from: the devices, or what a test puts in their place. The hub's
/// thread only.

#include <array>
#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/drivers/counter_card/progress.hpp"
#include "abbe/drivers/device.hpp"
#include "abbe/drivers/ippdme/session.hpp"
#include "abbe/drivers/tracker/order.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/stream_health.hpp"

namespace abbe::daemon {

/// Where a measuring machine reported its tip last, and how long ago (host time).
struct TipPlace {
  std::array<double, 3> at_m{};
  std::chrono::nanoseconds age{};
};

class SampleSource {
 public:
  SampleSource() = default;
  virtual ~SampleSource() = default;

  /// Appends everything that came since the last call to `batch`.
  virtual void drain(Batch& batch) = 0;
  /// Rates are those since the previous call.
  [[nodiscard]] virtual std::vector<StreamHealth> health(protocol::HostTime now) = 0;

  /// Moves the measuring machine and touches; the touches come with drain(). Without one: nothing.
  virtual void measure(std::span<const drivers::ProbePoint>) {}
  /// Stops a motion of the measuring machine (AbortE) and forgets all points that were asked for.
  virtual void stop_machine() {}
  /// Why nothing moves before a person has released the measuring machine; none: it needs no
  /// release.
  [[nodiscard]] virtual std::optional<std::string> release_awaited() const { return std::nullopt; }
  /// Errors are cleared and the session begins anew. Refused when no release is awaited.
  [[nodiscard]] virtual Result<void> release_machine() {
    return fail(ErrorCode::Refused,
                "machine: there is no measuring machine, [cmm], in the configuration");
  }
  /// Also while the machine is not ready; none: it never reported it.
  [[nodiscard]] virtual std::optional<TipPlace> tip_place() const { return std::nullopt; }
  /// How many of those points are neither done nor given up. 0: the touches of all that were begun
  /// come with the next drain().
  [[nodiscard]] virtual std::size_t points_left() const { return 0; }
  /// Where the measuring machine stands, m, as it said within the last second. Refused, with the
  /// reason, while it is not ready to move.
  [[nodiscard]] virtual Result<std::array<double, 3>> machine_position() const {
    return fail(ErrorCode::Refused, "there is no measuring machine");
  }

  /// How far the counter card had come, the latest that drain() met after its samples; at most once
  /// each.
  [[nodiscard]] virtual std::optional<drivers::CounterCardProgress> card_progress() {
    return std::nullopt;
  }

  /// As it is now; none: no tracker is configured.
  [[nodiscard]] virtual std::optional<drivers::DeviceStatus> tracker_status() const {
    return std::nullopt;
  }
  /// What comes of it is among the tracker_reports(). Without a tracker: nothing.
  virtual void order_tracker(drivers::TrackerOrder) {}
  /// Since the last call.
  [[nodiscard]] virtual std::vector<drivers::TrackerOrderReport> tracker_reports() { return {}; }

 protected:
  SampleSource(const SampleSource&) = default;
  SampleSource& operator=(const SampleSource&) = default;
  SampleSource(SampleSource&&) = default;
  SampleSource& operator=(SampleSource&&) = default;
};

}  // namespace abbe::daemon
