#pragma once
/// Tracks which axes deliver current positions. An axis is absent
///  - before the first sample that contains it, and
///  - while it is missing in all samples of the last 150 ms, and in at least the last three.
/// The 150 ms are counted in samples: while the device thread is delayed there are no samples, and
/// no axis becomes absent. Real time; one thread.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

class AxisPresence {
 public:
  static constexpr std::chrono::nanoseconds kMissingFor = std::chrono::milliseconds{150};
  static constexpr std::int64_t kFewestSamples = 3;

  AxisPresence(std::size_t axes, std::chrono::nanoseconds sync_period)
      : axes_(std::min<std::size_t>(axes, protocol::kMaxAxes)),
        limit_(std::max(kMissingFor / sync_period, kFewestSamples)) {
    forget();
  }

  /// Call it when the bus was closed: no axis is then current.
  void forget() ABBE_RT { missed_.fill(limit_); }
  void on_sample(const protocol::AxisSample& sample) ABBE_RT {
    for (std::size_t i = 0; i < axes_; ++i) {
      const bool missing = ((sample.missing_mask >> i) & 1u) != 0;
      missed_[i] = missing ? std::min(missed_[i] + 1, limit_) : 0;
    }
  }
  [[nodiscard]] std::uint8_t absent() const ABBE_RT {
    unsigned mask = 0;
    for (std::size_t i = 0; i < axes_; ++i) mask |= missed_[i] >= limit_ ? 1u << i : 0u;
    return static_cast<std::uint8_t>(mask);
  }

 private:
  std::size_t axes_;
  std::int64_t limit_;
  std::array<std::int64_t, protocol::kMaxAxes> missed_{};  ///< consecutive samples without axis i
};

}  // namespace abbe::drivers
