#include "abbe/drivers/sampling/mark_watcher.hpp"

#include <span>
#include <utility>

namespace abbe::drivers {

using protocol::SampleFlag;

template bool SampleRing<MarkCrossing>::try_push(const MarkCrossing&) ABBE_RT;
template std::size_t SampleRing<MarkCrossing>::pop(std::span<MarkCrossing>) ABBE_RT;

void MarkWatcher::on_scan(const CounterScan& scan) ABBE_RT {
  if (has(scan.axes.head.flags, SampleFlag::Restarted)) {
    restarted_ = restarted_ || known_;
    known_ = false;
  }
  for (std::uint8_t axis = 0; known_ && axis < scan.axes.axis_count; ++axis) {
    const bool latches = ((scan.index_latched_mask >> axis) & 1u) != 0;
    if (!latches || scan.axes.count[axis] == count_[axis]) continue;
    MarkCrossing crossing{scan.axes.head, last_, axis, scan.axes.count[axis]};
    crossing.head.flags &= ~static_cast<protocol::SampleFlags>(SampleFlag::Restarted);
    if (std::exchange(restarted_, false)) crossing.head.flags |= SampleFlag::Restarted;
    crossings_.try_push(crossing);
  }

  known_ = true;
  last_ = scan.axes.head.time;
  count_ = scan.axes.count;
}

}  // namespace abbe::drivers
