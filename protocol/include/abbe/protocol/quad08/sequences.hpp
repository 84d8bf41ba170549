#pragma once
/// Sequences of register writes and reads for each operation of the card, in the order of the
/// manufacturer's library [MCC uldaq, MIT]. A driver sends the steps one by one. No allocation.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/protocol/quad08/channel.hpp"
#include "abbe/protocol/quad08/scan_list.hpp"

namespace abbe::protocol::quad08 {

/// Required answer of a read.
enum class Expect : std::uint8_t {
  Nothing,
  LowByte,  ///< the low byte equals `value`
  AtLeast,  ///< the word is not below `value`
};
struct Step {
  usb::Setup setup;
  Expect expect = Expect::Nothing;
  std::uint16_t value = 0;
};
[[nodiscard]] bool fulfilled(const Step& step, std::uint16_t answer) ABBE_RT;

/// A list of steps; its capacity is sufficient for the longest sequence.
class Sequence {
 public:
  static constexpr std::size_t kCapacity = 256;
  void add(const Step& step) ABBE_RT {
    if (size_ < kCapacity) steps_[size_++] = step;
  }
  void add(const usb::Setup& setup) ABBE_RT { add(Step{setup}); }
  void add(Register where, std::uint16_t value) ABBE_RT { add(write(where, value)); }
  [[nodiscard]] std::span<const Step> steps() const ABBE_RT {
    return std::span{steps_}.first(size_);
  }

 private:
  std::array<Step, kCapacity> steps_{};
  std::size_t size_ = 0;
};

/// Reads the firmware version, tests the registers, and disarms all functions.
[[nodiscard]] Sequence open_sequence() ABBE_RT;

enum class Timer : std::uint8_t { Timer0, Timer1 };
/// The timer output of the card as a clock: one period is `divisor` periods of 48 MHz, with a duty
/// cycle of 50 %.
[[nodiscard]] Sequence timer_stop(Timer timer) ABBE_RT;
[[nodiscard]] Sequence timer_start(Timer timer, std::uint32_t divisor) ABBE_RT;

/// Stops pacer, scan list and data transfer; the counters continue.
[[nodiscard]] Sequence stop_sequence() ABBE_RT;
/// Loads the scan list and the divisor; the last step resets the endpoint. Start the bulk transfers
/// afterwards.
[[nodiscard]] Sequence load_sequence(const ScanLayout& layout, std::uint64_t divisor) ABBE_RT;
/// Enables the data transfer and starts the list. Wait for Status::ready() afterwards.
[[nodiscard]] Sequence arm_sequence() ABBE_RT;
/// Starts the pacer, and thereby the scans.
[[nodiscard]] constexpr usb::Setup start_pacer() noexcept {
  return write(Register::Acquisition, acquisition::kPacerInternal);
}

}  // namespace abbe::protocol::quad08
