#pragma once
/// Detects crossings of reference marks in the scans of a counter card whose axes are latched on
/// their index. A CounterScanSink; real time. A crossing is a change of the latched count. A mark
/// that latches the same count as the previous crossing is not detected: it can only be the same
/// mark, crossed in the other direction.

#include <array>
#include <cstddef>
#include <cstdint>

#include "abbe/drivers/counter_card/scan.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

struct MarkCrossing {
  /// Head of the scan that shows the crossing. Flag Restarted: the card's counts restarted since
  /// the previous crossing.
  protocol::SampleHead head;
  protocol::HostTime not_before{};  ///< time of the scan before `head`
  std::uint8_t axis = 0;            ///< index in the sample
  std::int64_t count = 0;           ///< count of the latching card at the mark
};

class MarkWatcher final : public CounterScanSink {
 public:
  /// Allocates.
  explicit MarkWatcher(std::size_t capacity = 1024) : crossings_(capacity) {}

  void on_scan(const CounterScan& scan) ABBE_RT override;

  /// One reader.
  [[nodiscard]] SampleRing<MarkCrossing>& crossings() noexcept { return crossings_; }

 private:
  SampleRing<MarkCrossing> crossings_;
  bool known_ = false;
  bool restarted_ = false;  ///< a restart must be reported with the next crossing
  protocol::HostTime last_{};
  std::array<std::int64_t, protocol::kMaxAxes> count_{};
};

}  // namespace abbe::drivers
