#pragma once
/// How far the counters of a card had come at one scan: what a later run of the program needs to
/// see that they went on counting. Counts are those of CounterScan.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <type_traits>

#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

struct CounterCardProgress {
  protocol::SampleHead head;  ///< `time`: host time of the scan, by a clock model that was settled
  std::int64_t clock_count = 0;
  std::uint8_t axis_count = 0;
  std::array<std::int64_t, protocol::kMaxAxes> count{};
  std::array<char, 64>
      serial{};  ///< USB serial number, cut off at 63 characters; empty: the card has none

  [[nodiscard]] std::string_view serial_number() const noexcept { return serial.data(); }
  void set_serial_number(std::string_view text) noexcept {
    serial = {};
    text.substr(0, serial.size() - 1).copy(serial.data(), serial.size() - 1);
  }
};
static_assert(std::is_trivially_copyable_v<CounterCardProgress>);

}  // namespace abbe::drivers
