#pragma once
/// Where the hub's samples come from: the devices, or what a test puts in their place. The hub's thread only.

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "abbe/daemon/batch.hpp"
#include "abbe/daemon/error.hpp"
#include "abbe/daemon/publisher.hpp"
#include "abbe/drivers/ippdme/session.hpp"

namespace abbe::daemon {

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
  /// How many of those points are neither done nor given up. 0: the touches of all that were begun come with
  /// the next drain().
  [[nodiscard]] virtual std::size_t points_left() const { return 0; }
  /// Where the measuring machine stands, m, as it said within the last second. Refused, with the reason,
  /// while it is not ready to move.
  [[nodiscard]] virtual Result<std::array<double, 3>> machine_position() const {
    return fail(ErrorCode::Refused, "there is no measuring machine");
  }

 protected:
  SampleSource(const SampleSource&) = default;
  SampleSource& operator=(const SampleSource&) = default;
  SampleSource(SampleSource&&) = default;
  SampleSource& operator=(SampleSource&&) = default;
};

}  // namespace abbe::daemon
