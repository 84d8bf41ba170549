#include "abbe/subscriber/sequence_window.hpp"

#include <algorithm>

#include "rtps_fields.hpp"

namespace abbe::dds {

void SequenceWindow::sent(std::span<const std::uint8_t> message) {
  using namespace rtps_message;
  constexpr std::size_t kWriterAt = 4, kBaseAt = 8, kShortest = 16;
  WriterGuid writer{};
  bool addressed = false;

  for (std::size_t at = kHeaderBytes; at + kSubmessageHeaderBytes <= message.size();) {
    const std::uint8_t kind = message[at];
    const bool little_endian = (message[at + 1] & kLittleEndian) != 0;
    std::size_t length = FieldReader(message, little_endian).u16(at + 2);
    at += kSubmessageHeaderBytes;
    if (length == 0 && kind != kPad && kind != kInfoTimestamp) length = message.size() - at;
    if (length > message.size() - at) return;
    const auto body = message.subspan(at, length);
    at += length;

    if (kind == kInfoDestination && length >= kPrefixBytes) {
      std::copy_n(body.begin(), kPrefixBytes, writer.begin());
      addressed = true;
    }
    if (kind != kAckNack || !addressed || length < kShortest) continue;
    // base 0 means that the reader does not know yet which numbers exist
    const auto base = FieldReader(body, little_endian).sequence_number(kBaseAt);
    if (base == 0) continue;
    std::copy_n(body.begin() + kWriterAt, 4, writer.begin() + kPrefixBytes);
    const std::lock_guard lock(mutex_);
    const auto [entry, is_new] = next_.insert_or_assign(writer, base);
    if (!is_new) continue;
    order_.push_back(writer);
    if (order_.size() <= kMostWriters) continue;
    next_.erase(order_.front());
    order_.pop_front();
  }
}

std::optional<std::uint64_t> SequenceWindow::next_of(const WriterGuid& writer) const {
  const std::lock_guard lock(mutex_);
  const auto found = next_.find(writer);
  return found == next_.end() ? std::nullopt : std::optional{found->second};
}

std::uint64_t SequenceWindow::take_skip(std::uint64_t wanted) const {
  if (wanted <= kShortSkip) return wanted;
  const auto now = std::chrono::steady_clock::now();
  const std::lock_guard lock(mutex_);
  if (now - skips_since_ >= std::chrono::seconds{1}) {
    skips_since_ = now;
    skips_left_ = kLongestSkip;
  }
  const std::uint64_t taken = std::min(wanted, skips_left_);
  skips_left_ -= taken;
  return std::max(taken, kShortSkip);
}

}  // namespace abbe::dds
