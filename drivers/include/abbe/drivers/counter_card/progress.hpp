#pragma once
/// State of a card's counters at one scan. A later run of the program uses it to detect whether the
/// counters have continued. Counts are unwrapped as in CounterScan.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

struct CounterCardProgress {
  /// `time` is the host time of the scan, converted by a settled clock model
  protocol::SampleHead head;
  std::int64_t clock_count = 0;
  std::uint8_t axis_count = 0;
  std::array<std::int64_t, protocol::kMaxAxes> count{};
  /// USB serial number, cut off at 63 characters; empty: the card has none.
  std::array<char, 64> serial{};

  [[nodiscard]] std::string_view serial_number() const noexcept { return serial.data(); }
  void set_serial_number(std::string_view text) noexcept {
    serial = {};
    text.substr(0, serial.size() - 1).copy(serial.data(), serial.size() - 1);
  }
};
static_assert(std::is_trivially_copyable_v<CounterCardProgress>);

}  // namespace abbe::drivers
