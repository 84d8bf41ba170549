#pragma once
/// What hangs on which counter of the card. One counter always counts a clock: the time base of
/// every scan, by which lost scans are seen. The probe hangs on the index input of a second counter
/// of the same clock (time of the edge to one clock period) and, if there is one to spare, on the
/// phase A input of a third (number of edges).
///
/// ASSUMPTION, to be verified on hardware: in a scan, a counter that is set up with latch-on-index
/// gives its count at the latest index edge, and 0 before the first. Everything about latch
/// channels and about axes with `latch_on_index` rests on it; set `latch_verified` once it has been
/// seen on the card in use.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "abbe/drivers/error.hpp"
#include "abbe/protocol/quad08/channel.hpp"
#include "abbe/protocol/quad08/scan_list.hpp"
#include "abbe/protocol/quad08/stream.hpp"

namespace abbe::drivers {

namespace quad08 = protocol::quad08;

struct CounterAxis {
  std::string name;  ///< "X"; for messages
  std::uint8_t channel = 0;
  double scale = 0.0;  ///< m or rad per count, four counts a signal period; negative reverses
  /// m or rad: the reading at count 0, which is where the axis stood when it was set up
  double offset = 0.0;
  /// for reference marks: the count at the latest index pulse, no live reading
  bool latch_on_index = false;
  quad08::Debounce debounce{};  ///< of phases and index
};

enum class ClockSource : std::uint8_t {
  /// a clock of its own. Where the latch channel's count stands against it is learned from edges
  External,
  /// the card's timer output 0, wired to the clock inputs: both counters begin with it, in step
  Timer0,
  Timer1,
};

struct CounterCardWiring {
  std::vector<CounterAxis>
      axes;  ///< in the order of the sample; 1 to 7, at most as many as a sample holds
  std::uint8_t clock_channel = 5;
  ClockSource clock_source = ClockSource::External;
  double clock_hz = 10e6;  ///< with a timer: 48 MHz divided by a whole number
  std::optional<std::uint8_t> latch_channel;
  std::optional<std::uint8_t> edge_channel;
  quad08::Debounce latch_debounce{};  ///< of the index input of the latch channel
  quad08::Debounce edge_debounce{};
  bool latch_verified = false;  ///< the assumption above was tried on this card
  quad08::CountWidth width = quad08::CountWidth::Bits32;
  double scan_rate_hz = 100e3 / 3.0;  ///< asked for; scan_rate() is what comes of it
};

/// BadConfiguration names the axis or channel and what is wrong: scale zero, two uses of one
/// channel, two channels for one axis, a clock too slow to count scans by, ...
[[nodiscard]] Result<void> check(const CounterCardWiring& wiring);

// All below: for a wiring that passed check().

/// Channels in use, ascending.
[[nodiscard]] quad08::ScanLayout layout_of(const CounterCardWiring& wiring);
[[nodiscard]] std::uint64_t divisor_of(const CounterCardWiring& wiring);
/// Scans per second the pacer really gives.
[[nodiscard]] double scan_rate_hz(const CounterCardWiring& wiring);
[[nodiscard]] double clock_counts_per_scan(const CounterCardWiring& wiring);
/// Periods of 48 MHz in one of the clock; only for a timer.
[[nodiscard]] std::uint32_t timer_divisor(const CounterCardWiring& wiring);
/// True if something of the wiring rests on the assumption above and was not verified: to be said
/// at start.
[[nodiscard]] bool rests_on_assumption(const CounterCardWiring& wiring);

}  // namespace abbe::drivers
