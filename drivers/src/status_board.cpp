#include "abbe/drivers/status_board.hpp"

#include <algorithm>
#include <cstring>
#include <utility>

namespace abbe::drivers {

FaultText::Read FaultText::read() const {
  std::array<std::uint64_t, kWords> words{};
  std::uint64_t length = 0;
  std::int64_t at_ns = 0;

  for (bool whole = false; !whole;) {
    // acquire: pairs with the last release in set()
    const std::uint64_t latest = complete_.load(std::memory_order_acquire);
    const Text& from = texts_[latest % 2];
    // acquire: pairs with the releases in set(); a reader of a newer word also sees the newer
    // begun_
    length = from.length.load(std::memory_order_acquire);
    at_ns = from.at_ns.load(std::memory_order_acquire);
    std::transform(from.words.begin(), from.words.end(), words.begin(),
                   [](const auto& w) { return w.load(std::memory_order_acquire); });
    whole = begun_.load(std::memory_order_relaxed) < latest + 2;
  }

  std::array<char, kCapacity> bytes{};
  std::memcpy(bytes.data(), words.data(), kCapacity);
  return {std::string(bytes.data(), length), protocol::HostTime{std::chrono::nanoseconds{at_ns}}};
}

DeviceStatus StatusBoard::read(std::string name, std::uint64_t dropped,
                               std::uint64_t raw_dropped) const {
  DeviceStatus s;
  s.name = std::move(name);

  // acquire: pairs with the release in set_state()
  s.state = state_.load(std::memory_order_acquire);
  s.connected = connected_.load(std::memory_order_relaxed);
  s.samples = samples.value();
  s.dropped = dropped;
  s.raw_dropped = raw_dropped;
  s.gaps = gaps.value();
  s.faults = faults.value();
  s.time_widened = time_widened.value();
  s.clock = {
      .settled = clock_settled_.load(std::memory_order_relaxed),
      .skew = clock_skew_.load(std::memory_order_relaxed),
      .residual = std::chrono::nanoseconds{clock_residual_ns_.load(std::memory_order_relaxed)},
      .u_time = std::chrono::nanoseconds{clock_u_time_ns_.load(std::memory_order_relaxed)},
      .restarts = clock_restarts_.load(std::memory_order_relaxed)};
  s.last_sample =
      protocol::HostTime{std::chrono::nanoseconds{last_sample_ns_.load(std::memory_order_relaxed)}};
  s.condition = condition_.read().text;
  auto [text, at] = fault_text_.read();
  s.last_fault = std::move(text);
  s.last_fault_at = at;

  return s;
}

}  // namespace abbe::drivers
