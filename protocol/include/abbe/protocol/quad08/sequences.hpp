#pragma once
/// The register writes and reads of each thing one does with the card, in the order of the maker's
/// library [MCC uldaq, MIT], as lists a driver sends one by one. No allocation.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/protocol/quad08/channel.hpp"
#include "abbe/protocol/quad08/scan_list.hpp"

namespace abbe::protocol::quad08 {

/// What the answer of a read must be.
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

/// A list with room for the longest sequence.
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

/// Firmware version, self-test of the registers, everything disarmed.
[[nodiscard]] Sequence open_sequence() ABBE_RT;

enum class Timer : std::uint8_t { Timer0, Timer1 };
/// The card's own timer output as a clock: `divisor` periods of 48 MHz per period, half of them
/// high.
[[nodiscard]] Sequence timer_stop(Timer timer) ABBE_RT;
[[nodiscard]] Sequence timer_start(Timer timer, std::uint32_t divisor) ABBE_RT;

/// Pacer, scan list and data transfer stopped; counters go on.
[[nodiscard]] Sequence stop_sequence() ABBE_RT;
/// Loads the list and the divisor; ends with the endpoint reset. Then the bulk transfers are
/// started.
[[nodiscard]] Sequence load_sequence(const ScanLayout& layout, std::uint64_t divisor) ABBE_RT;
/// Data transfer on, list started. Then Status::ready() is waited for.
[[nodiscard]] Sequence arm_sequence() ABBE_RT;
/// The pacer runs: scans come.
[[nodiscard]] constexpr usb::Setup start_pacer() noexcept {
  return write(Register::Acquisition, acquisition::kPacerInternal);
}

}  // namespace abbe::protocol::quad08
