#include "second_samples.hpp"

#include <chrono>
#include <string_view>
#include <utility>
#include <vector>

namespace abbe::daemon {
namespace {

// A recorded second sample of an instant is at most this much later than the first: its answer
// arrived within one SYNC period, but the hub of a busy computer may have taken it later.
constexpr auto kLatestSecond = std::chrono::seconds{10};

}  // namespace

SecondSamples::SecondSamples(const RecordingReader& recording)
    : ahead_(recording.messages()), next_(ahead_.next()) {
  sink_.axis_sample = [this](const auto& sample, std::string_view) { take(sample); };
}

void SecondSamples::take(const protocol::AxisSample& sample) {
  if (!latest_ || latest_->head.time != sample.head.time) {
    latest_ = sample;
    return;
  }

  latest_->missing_mask |= sample.missing_mask;
  latest_->head.flags |= sample.head.flags;
  auto& combined = combined_.try_emplace(sample.head.time, Combined{*latest_, 1}).first->second;
  combined.sample = *latest_;
  ++combined.left;
}

void SecondSamples::combine(Batch& batch) {
  for (; next_ && next_->taken <= batch.taken + kLatestSecond; next_ = ahead_.next())
    (void)deliver(*next_, sink_);
  if (combined_.empty()) return;

  std::erase_if(batch.axes, [this](protocol::AxisSample& sample) {
    const auto found = combined_.find(sample.head.time);
    if (found == combined_.end()) return false;
    sample = found->second.sample;
    const bool was_replayed = std::exchange(found->second.replayed, true);
    if (--found->second.left == 0) combined_.erase(found);
    return was_replayed;
  });
}

}  // namespace abbe::daemon
