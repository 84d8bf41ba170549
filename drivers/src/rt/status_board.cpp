#include "abbe/drivers/status_board.hpp"

#include <algorithm>
#include <cstring>
#include <string_view>

namespace abbe::drivers {

namespace {

/// Number of bytes kept of a text longer than kCapacity: it is cut between two UTF-8 characters.
std::size_t whole_code_points(std::string_view text) ABBE_RT {
  constexpr unsigned kContinuationMask = 0xC0, kContinuation = 0x80;
  std::size_t length = FaultText::kCapacity;
  while (length > 0 &&
         (static_cast<unsigned char>(text[length]) & kContinuationMask) == kContinuation)
    --length;
  return length;
}

}  // namespace

void FaultText::set(protocol::HostTime at, std::string_view text) ABBE_RT {
  std::array<char, kCapacity> bytes{};
  const std::size_t length = text.size() <= kCapacity ? text.size() : whole_code_points(text);
  std::copy_n(text.data(), length, bytes.data());
  std::array<std::uint64_t, kWords> words{};
  std::memcpy(words.data(), bytes.data(), kCapacity);

  const std::uint64_t next = begun_.load(std::memory_order_relaxed) + 1;  // only this thread writes
  begun_.store(next, std::memory_order_relaxed);  // made visible by the releases that follow
  Text& to = texts_[next % 2];
  // release: pairs with the acquires in read(); also publishes begun_
  to.length.store(length, std::memory_order_release);
  to.at_ns.store(at.time_since_epoch().count(), std::memory_order_release);
  for (std::size_t i = 0; i < kWords; ++i) to.words[i].store(words[i], std::memory_order_release);
  complete_.store(next,
                  std::memory_order_release);  // release: pairs with the first acquire in read()
}

void StatusBoard::set_clock(const ClockStatus& clock) ABBE_RT {
  clock_settled_.store(clock.settled, std::memory_order_relaxed);
  clock_skew_.store(clock.skew, std::memory_order_relaxed);
  clock_residual_ns_.store(clock.residual.count(), std::memory_order_relaxed);
  clock_u_time_ns_.store(clock.u_time.count(), std::memory_order_relaxed);
  clock_restarts_.store(clock.restarts, std::memory_order_relaxed);
}

}  // namespace abbe::drivers
