#pragma once
/// Source of the hub's samples: the devices, or a substitute in a test. Functions may be called
/// only from the hub's thread unless their comment states otherwise.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/drivers/device.hpp"
#include "abbe/drivers/ippdme/session.hpp"
#include "abbe/drivers/tracker/order.hpp"
#include "abbe/pipeline/batch.hpp"
#include "abbe/pipeline/counting_progress.hpp"
#include "abbe/pipeline/stream_health.hpp"

namespace abbe::daemon {

/// Latest tip position reported by a measuring machine, and its age (host time).
struct TipPlace {
  std::array<double, 3> at_m{};
  std::chrono::nanoseconds age{};
};

class SampleSource {
 public:
  SampleSource() = default;
  virtual ~SampleSource() = default;

  /// Appends everything that arrived since the last call to `batch`.
  virtual void drain(Batch& batch) = 0;
  /// Status of all streams. The rates are means over the time since the previous call.
  [[nodiscard]] virtual std::vector<StreamHealth> health(protocol::HostTime now) = 0;

  /// Starts to touch the points with the measuring machine; the touches arrive in drain(). No
  /// effect without a measuring machine.
  virtual void measure(std::span<const drivers::ProbePoint>) {}
  /// Stops a motion of the measuring machine (AbortE) and discards all requested points. Returns
  /// the number of the request; machine_stop() has its outcome. May be called from any thread;
  /// takes no lock. Refused without a measuring machine.
  [[nodiscard]] virtual Result<std::uint64_t> stop_machine() {
    return fail(ErrorCode::Refused, "machine: there is no measuring machine, " +
                                        tables_with(Capability::Motion) + ", in the configuration");
  }
  /// The latest request to stop that the machine's driver has received, and its outcome. May be
  /// called from any thread.
  [[nodiscard]] virtual drivers::IppStop machine_stop() const { return {}; }
  /// The reason why the measuring machine does not move until the operator releases it; nullopt:
  /// the machine awaits no release.
  [[nodiscard]] virtual std::optional<std::string> release_awaited() const { return std::nullopt; }
  /// Releases the measuring machine: clears its errors and starts a new session with its server.
  /// Refused if no release is awaited.
  [[nodiscard]] virtual Result<void> release_machine() {
    return fail(ErrorCode::Refused, "machine: there is no measuring machine, " +
                                        tables_with(Capability::Motion) + ", in the configuration");
  }
  /// The latest reported tip position, also while the machine is not ready to move; nullopt: none
  /// was reported yet.
  [[nodiscard]] virtual std::optional<TipPlace> tip_place() const { return std::nullopt; }
  /// Number of requested points that are neither touched nor discarded. When it is 0, the next
  /// drain() returns the last touches.
  [[nodiscard]] virtual std::size_t points_left() const { return 0; }
  /// Position of the measuring machine, m, reported within the last second. Refused, with the
  /// reason, if there is no such position or the machine is not ready to move.
  [[nodiscard]] virtual Result<std::array<double, 3>> machine_position() const {
    return fail(ErrorCode::Refused, "there is no measuring machine");
  }

  /// The latest state of the card's counters that drain() has read. The samples up to this state
  /// are already in the batch of that drain(). Each state is returned at most once.
  [[nodiscard]] virtual std::optional<CountingProgress> card_progress() { return std::nullopt; }

  /// Current status; nullopt: no tracker is configured.
  [[nodiscard]] virtual std::optional<drivers::DeviceStatus> tracker_status() const {
    return std::nullopt;
  }
  /// Sends an order to the tracker; tracker_reports() reports its outcome. No effect without a
  /// tracker.
  virtual void order_tracker(drivers::TrackerOrder) {}
  /// Reports since the last call.
  [[nodiscard]] virtual std::vector<drivers::TrackerOrderReport> tracker_reports() { return {}; }

 protected:
  SampleSource(const SampleSource&) = default;
  SampleSource& operator=(const SampleSource&) = default;
  SampleSource(SampleSource&&) = default;
  SampleSource& operator=(SampleSource&&) = default;
};

}  // namespace abbe::daemon
