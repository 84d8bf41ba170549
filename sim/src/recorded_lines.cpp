#include "abbe/sim/recorded_lines.hpp"

#include <algorithm>
#include <utility>

namespace abbe::sim {

RecordedLines::RecordedLines(const RecordedDevice& device, ReplayTimeline& timeline, bool leads)
    : timeline_(timeline), leads_(leads) {
  for (const RecordedBlock& block : device.blocks) {
    if (block.connects() || connections_.empty()) connections_.push_back({block.time, {}});
    if (block.connects() || (block.to_device && !block.lost())) continue;
    connections_.back().blocks.push_back(block);
  }
  if (connections_.empty()) connections_.emplace_back();
}

void RecordedLines::connected(HostTime now) {
  if (std::exchange(played_, true)) connection_ = (connection_ + 1) % connections_.size();
  connected_ = true;
  next_ = 0;
  if (leads_) timeline_.restart(connection().began, now);
}

void RecordedLines::disconnected() {
  connected_ = false;
  out_.clear();
  if (leads_ && connection_ + 1 == connections_.size()) timeline_.rewind();
}

HostTime RecordedLines::next_due() const {
  if (!connected_ || next_ >= connection().blocks.size()) return HostTime::max();
  return timeline_.due(connection().blocks[next_].time);
}

void RecordedLines::advance(HostTime now) {
  while (next_due() <= now) {
    const RecordedBlock& block = connection().blocks[next_++];
    if (block.lost()) hang_up_ = true;
    if (leads_ || now - timeline_.due(block.time) <= kOutOfStep)
      print(block);
    else
      within_line_ = true;
  }
  const bool last = connection_ + 1 == connections_.size();
  finished_ = finished_ || (played_ && last && next_ >= connection().blocks.size());
}

/// From the beginning of a line on.
void RecordedLines::print(const RecordedBlock& block) {
  auto from = block.bytes.begin();
  if (within_line_) {
    from = std::ranges::find(block.bytes, std::byte{'\n'});
    if (from == block.bytes.end()) return;
    ++from;
    within_line_ = false;
  }
  std::transform(from, block.bytes.end(), std::back_inserter(out_),
                 [](std::byte b) { return static_cast<char>(b); });
}

std::string RecordedLines::take_output() {
  return std::exchange(out_, {});
}

bool RecordedLines::take_hang_up() {
  return std::exchange(hang_up_, false);
}

std::size_t RecordedLines::reads() const {
  std::size_t reads = 0;
  for (const Connection& connection : connections_)
    reads += static_cast<std::size_t>(std::ranges::count_if(
        connection.blocks, [](const RecordedBlock& block) { return !block.bytes.empty(); }));
  return reads;
}

}  // namespace abbe::sim
