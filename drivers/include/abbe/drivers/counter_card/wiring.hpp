#pragma once
/// Assignment of signals to the counters of the card.
///   Clock channel  counts a clock: the time base of every scan, which also reveals lost scans
///   Latch channel  counts the same clock; the probe is connected to its index input: time of the
///                  edge, resolution one clock period
///   Edge channel   optional; the probe is connected to its phase A input: number of edges
///
/// ASSUMPTION, to be verified on hardware: in a scan, a counter with latch-on-index delivers its
/// count at the latest index edge, and 0 before the first one. Latch channels and axes with
/// `latch_on_index` depend on it. Set `latch_verified` once it was verified on the card in use.

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
  double scale = 0.0;  ///< m or rad per count, four counts per signal period; negative reverses
  /// m or rad: the reading at count 0, the axis position at the set-up of the counter
  double offset = 0.0;
  /// true: the counter delivers its count at the latest index pulse instead of its live count. For
  /// reference marks.
  bool latch_on_index = false;
  quad08::Debounce debounce{};  ///< debounce of phases and index
};

enum class ClockSource : std::uint8_t {
  /// A clock outside the card. The offset between the counts of latch channel and clock channel is
  /// estimated from probe edges.
  External,
  /// The card's timer output 0, wired to both clock inputs: both counters start with it, from a
  /// common zero.
  Timer0,
  Timer1,
};

struct CounterCardWiring {
  /// Axes in the order of the sample: 1 to 7, and at most as many as a sample holds.
  std::vector<CounterAxis> axes;
  std::uint8_t clock_channel = 5;
  ClockSource clock_source = ClockSource::External;
  double clock_hz = 10e6;  ///< clock frequency; for a timer, 48 MHz divided by an integer
  std::optional<std::uint8_t> latch_channel;
  std::optional<std::uint8_t> edge_channel;
  quad08::Debounce latch_debounce{};  ///< debounce of the index input of the latch channel
  quad08::Debounce edge_debounce{};
  /// the ASSUMPTION at the top of this file was verified on this card
  bool latch_verified = false;
  quad08::CountWidth width = quad08::CountWidth::Bits32;
  double scan_rate_hz = 100e3 / 3.0;  ///< requested; the actual rate is scan_rate_hz()
};

/// Error BadConfiguration names the axis or channel and the fault: scale zero, two uses of one
/// channel, two channels for one axis, a clock too slow to detect lost scans, ...
[[nodiscard]] Result<void> check(const CounterCardWiring& wiring);

// The functions below require a wiring that has passed check().

/// Channels in use, ascending.
[[nodiscard]] quad08::ScanLayout layout_of(const CounterCardWiring& wiring);
[[nodiscard]] std::uint64_t divisor_of(const CounterCardWiring& wiring);
/// Scans per second that the pacer (the timer of the scans) actually gives.
[[nodiscard]] double scan_rate_hz(const CounterCardWiring& wiring);
[[nodiscard]] double clock_counts_per_scan(const CounterCardWiring& wiring);
/// Periods of the card's 48 MHz oscillator in one period of the counted clock. Precondition: the
/// clock source is a timer.
[[nodiscard]] std::uint32_t timer_divisor(const CounterCardWiring& wiring);
/// True if the wiring relies on the assumption at the top of this file without `latch_verified`.
/// The device then reports the assumption at start.
[[nodiscard]] bool rests_on_assumption(const CounterCardWiring& wiring);

}  // namespace abbe::drivers
