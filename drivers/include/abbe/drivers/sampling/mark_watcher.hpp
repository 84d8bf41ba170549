#pragma once
/// Crossings of reference marks out of the scans of a counter card whose axes are latched on their
/// index. A CounterScanSink; real time. A mark that latches the very count that is latched already
/// is not seen: it can only be the same mark, crossed back.

#include <array>
#include <cstddef>
#include <cstdint>

#include "abbe/drivers/counter_card/scan.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

struct MarkCrossing {
  protocol::SampleHead
      head;  ///< of the scan in which it was seen; Restarted: the card's counts began anew
  protocol::HostTime not_before{};  ///< the scan before that
  std::uint8_t axis = 0;            ///< place in the sample
  std::int64_t count = 0;           ///< of the latching card at the mark
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
  bool restarted_ = false;  ///< not yet told
  protocol::HostTime last_{};
  std::array<std::int64_t, protocol::kMaxAxes> count_{};
};

}  // namespace abbe::drivers
