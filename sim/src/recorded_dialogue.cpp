#include "abbe/sim/recorded_dialogue.hpp"

#include <algorithm>
#include <utility>

namespace abbe::sim {

RecordedDialogue::RecordedDialogue(const RecordedDevice& device, const DialogueWire& wire)
    : wire_(wire), serial_(device.kind == RecordedKind::ModbusRtu) {
  for (const RecordedBlock& block : device.blocks) take(block);
  if (connections_.empty()) connections_.emplace_back();
  // A last request without an answer is removed, because the recording may have ended before the
  // answer.
  auto& last = connections_.back().exchanges;
  if (!last.empty() && last.back().answer.empty()) last.pop_back();
  index();
}

void RecordedDialogue::take(const RecordedBlock& block) {
  if ((block.connects() && !serial_) || connections_.empty()) {
    connections_.emplace_back().exchanges.push_back({{}, block.time, {}});
  }
  auto& exchanges = connections_.back().exchanges;
  if (block.to_device && !block.lost()) {
    exchanges.push_back({block.bytes, block.time, {}});
  } else if (!block.connects()) {
    exchanges.back().answer.push_back(
        {block.time - exchanges.back().time, block.bytes, block.lost()});
  }
}

void RecordedDialogue::index() {
  for (Connection& connection : connections_) {
    for (std::size_t i = 0; i < connection.exchanges.size(); ++i) {
      const auto& request = connection.exchanges[i].request;
      if (!request.empty()) connection.by_meaning[meaning_of(request)].push_back(i);
    }
  }
}

std::string RecordedDialogue::meaning_of(std::span<const std::byte> request) const {
  const auto meaning = wire_.meaning(request);
  return {reinterpret_cast<const char*>(meaning.data()), meaning.size()};
}

std::size_t RecordedDialogue::requests() const {
  std::size_t sum = 0;
  for (const Connection& connection : connections_)
    for (const auto& [meaning, places] : connection.by_meaning) sum += places.size();
  return sum;
}

void RecordedDialogue::connected(HostTime now) {
  if (std::exchange(played_, true) && !serial_)
    connection_ = (connection_ + 1) % connections_.size();
  const auto& exchanges = connections_[connection_].exchanges;
  if (!exchanges.empty() && exchanges.front().request.empty()) schedule(exchanges.front(), {}, now);
}

void RecordedDialogue::disconnected() {
  if (!serial_) answered_.clear();
  incoming_.clear();
  due_.clear();
  out_.clear();
  wants_close_ = false;
}

void RecordedDialogue::receive(std::span<const std::byte> bytes, HostTime now) {
  incoming_.insert(incoming_.end(), bytes.begin(), bytes.end());
  while (const std::size_t size = wire_.request_size(incoming_)) {
    const std::vector<std::byte> request(incoming_.begin(),
                                         incoming_.begin() + static_cast<std::ptrdiff_t>(size));
    incoming_.erase(incoming_.begin(), incoming_.begin() + static_cast<std::ptrdiff_t>(size));
    answer(request, now);
  }
}

void RecordedDialogue::answer(std::span<const std::byte> request, HostTime now) {
  const Connection& connection = connections_[connection_];
  const std::string meaning = meaning_of(request);
  const auto known = connection.by_meaning.find(meaning);
  if (known == connection.by_meaning.end()) {
    due_.push_back({now, wire_.refusal(request)});
    return;
  }
  const std::size_t repetition = answered_[meaning]++;
  schedule(connection.exchanges[known->second[std::min(repetition, known->second.size() - 1)]],
           request, now);
}

/// Schedules the pieces of a recorded answer. They are renumbered as a whole, because a number may
/// be split between two pieces.
void RecordedDialogue::schedule(const Exchange& exchange, std::span<const std::byte> request,
                                HostTime now) {
  std::vector<std::byte> whole;
  for (const Piece& piece : exchange.answer)
    whole.insert(whole.end(), piece.bytes.begin(), piece.bytes.end());
  if (!request.empty()) wire_.renumber(whole, exchange.request, request);
  auto rest = whole.begin();

  for (const Piece& piece : exchange.answer) {
    const auto end = rest + static_cast<std::ptrdiff_t>(piece.bytes.size());
    due_.push_back({now + piece.delay, {rest, end}, piece.breaks});
    rest = end;
  }

  const bool last = connection_ + 1 == connections_.size() &&
                    &exchange == &connections_[connection_].exchanges.back();
  if (last && !exchange.answer.empty()) due_.back().last = true;
}

void RecordedDialogue::advance(HostTime now) {
  for (; !due_.empty() && due_.front().time <= now; due_.pop_front()) {
    out_.insert(out_.end(), due_.front().bytes.begin(), due_.front().bytes.end());
    wants_close_ = wants_close_ || due_.front().breaks;
    finished_ = finished_ || due_.front().last;
  }
}

HostTime RecordedDialogue::next_due() const {
  return due_.empty() ? HostTime::max() : due_.front().time;
}

std::vector<std::byte> RecordedDialogue::take_output() {
  return std::exchange(out_, {});
}

}  // namespace abbe::sim
