#pragma once
/// Decimation: outputs every n-th scan and keeps the flags and losses of the skipped scans. Used by
/// the device and by replay. Real time, one thread.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <utility>

#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

class ScanDecimation {
 public:
  explicit ScanDecimation(std::size_t every) noexcept : every_(every) {}

  /// Returns every n-th scan, with the flags and the lost scans of those skipped before it; nullopt
  /// for a scan that is skipped.
  [[nodiscard]] std::optional<protocol::AxisSample> take(const protocol::AxisSample& scan) ABBE_RT {
    if (++skipped_ < every_) {
      flags_ |= scan.head.flags;
      lost_ += scan.head.lost_before;
      return std::nullopt;
    }
    skipped_ = 0;
    protocol::AxisSample sample = scan;
    sample.head.flags |= std::exchange(flags_, protocol::SampleFlags{0});
    sample.head.lost_before += std::exchange(lost_, 0u);
    return sample;
  }

 private:
  std::size_t every_;
  std::size_t skipped_ = 0;
  protocol::SampleFlags flags_ = 0;
  std::uint32_t lost_ = 0;
};

}  // namespace abbe::drivers
