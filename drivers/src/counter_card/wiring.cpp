#include "abbe/drivers/counter_card/wiring.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "abbe/protocol/samples.hpp"
#include "abbe/result/try.hpp"

namespace abbe::drivers {
namespace {

/// Fewer clock counts per scan could hide a lost scan: the counts of one scan must exceed the
/// rounding of the clock's count and its rate error relative to the pacer (the timer of the scans).
constexpr double kFewestCountsPerScan = 8.0;
/// With more clock counts per scan, a step of a 32-bit counter could not be distinguished from a
/// wrap.
constexpr double kMostCountsPerScan = 1e9;
constexpr double kFastestClock_hz = 24e6;  // half of the card's own 48 MHz

Result<void> refuse_wiring(std::string text) {
  return tl::unexpected(Error{ErrorCode::BadConfiguration, "counter card: " + std::move(text)});
}

Result<void> check_axis(const CounterAxis& axis) {
  const auto name = fmt::format("axis {} (channel {})", axis.name, axis.channel);
  if (axis.scale == 0.0 || !std::isfinite(axis.scale))
    return refuse_wiring(fmt::format("{}: scale {} per count is not possible", name, axis.scale));
  if (!std::isfinite(axis.offset))
    return refuse_wiring(fmt::format("{}: offset {} must be finite", name, axis.offset));
  return {};
}

Result<void> check_axes(const CounterCardWiring& wiring) {
  if (wiring.axes.empty() || wiring.axes.size() > protocol::kMaxAxes) {
    return refuse_wiring(
        fmt::format("{} axes, 1 to {} are possible", wiring.axes.size(), protocol::kMaxAxes));
  }
  std::set<std::string> names;
  for (const auto& axis : wiring.axes) {
    ABBE_TRY(check_axis(axis));
    if (!names.insert(axis.name).second)
      return refuse_wiring(fmt::format("two channels claim axis {}", axis.name));
  }
  return {};
}

Result<void> check_channels(const CounterCardWiring& wiring) {
  std::array<std::string, quad08::kChannels> used;
  const auto claim = [&used](std::uint8_t channel, const std::string& what) -> Result<void> {
    if (channel >= used.size())
      return refuse_wiring(
          fmt::format("{}: channel {}, 0 to {} exist", what, channel, used.size() - 1));
    if (!used[channel].empty())
      return refuse_wiring(
          fmt::format("channel {} is claimed by {} and {}", channel, used[channel], what));
    used[channel] = what;
    return {};
  };

  for (const auto& axis : wiring.axes) ABBE_TRY(claim(axis.channel, "axis " + axis.name));
  ABBE_TRY(claim(wiring.clock_channel, "the clock"));
  if (wiring.latch_channel) ABBE_TRY(claim(*wiring.latch_channel, "the probe latch"));
  if (wiring.edge_channel) ABBE_TRY(claim(*wiring.edge_channel, "the probe edges"));

  return {};
}

Result<void> check_clock(const CounterCardWiring& wiring) {
  if (!quad08::pacer_divisor(wiring.scan_rate_hz))
    return refuse_wiring(
        fmt::format("the card does not support a scan rate of {} Hz", wiring.scan_rate_hz));
  if (!(wiring.clock_hz > 0.0 && wiring.clock_hz <= kFastestClock_hz))
    return refuse_wiring(fmt::format("clock {} Hz: above 0 to {} Hz are possible", wiring.clock_hz,
                                     kFastestClock_hz));
  const double counts = clock_counts_per_scan(wiring);

  if (counts < kFewestCountsPerScan || counts > kMostCountsPerScan) {
    return refuse_wiring(
        fmt::format("{} clock periods per scan: {} to {} are needed to detect lost scans", counts,
                    kFewestCountsPerScan, kMostCountsPerScan));
  }

  if (wiring.clock_source == ClockSource::External) return {};
  const double divisor = quad08::kPacerClock_hz / wiring.clock_hz;
  if (std::abs(divisor - std::round(divisor)) > 1e-9 * divisor || divisor < 2.0) {
    return refuse_wiring(fmt::format(
        "the card's timer cannot make {} Hz: 48 MHz divided by an integer above 1 is possible",
        wiring.clock_hz));
  }

  return {};
}

}  // namespace

Result<void> check(const CounterCardWiring& wiring) {
  ABBE_TRY(check_axes(wiring));
  ABBE_TRY(check_channels(wiring));
  return check_clock(wiring);
}

quad08::ScanLayout layout_of(const CounterCardWiring& wiring) {
  std::set<std::uint8_t> channels{wiring.clock_channel};
  for (const auto& axis : wiring.axes) channels.insert(axis.channel);
  if (wiring.latch_channel) channels.insert(*wiring.latch_channel);
  if (wiring.edge_channel) channels.insert(*wiring.edge_channel);
  quad08::ScanLayout layout{.width = wiring.width};
  for (const auto channel : channels) layout.channels[layout.count++] = channel;
  return layout;
}

std::uint64_t divisor_of(const CounterCardWiring& wiring) {
  return quad08::pacer_divisor(wiring.scan_rate_hz).value_or(0);
}

double scan_rate_hz(const CounterCardWiring& wiring) {
  return quad08::pacer_rate_hz(divisor_of(wiring));
}

double clock_counts_per_scan(const CounterCardWiring& wiring) {
  return wiring.clock_hz / scan_rate_hz(wiring);
}

std::uint32_t timer_divisor(const CounterCardWiring& wiring) {
  return static_cast<std::uint32_t>(std::lround(quad08::kPacerClock_hz / wiring.clock_hz));
}

bool rests_on_assumption(const CounterCardWiring& wiring) {
  const bool latched = wiring.latch_channel.has_value() ||
                       std::ranges::any_of(wiring.axes, &CounterAxis::latch_on_index);
  return latched && !wiring.latch_verified;
}

}  // namespace abbe::drivers
