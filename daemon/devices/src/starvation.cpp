#include "abbe/devices/starvation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "abbe/base/units.hpp"

namespace abbe::daemon {
namespace {

/// Least fractions of the nominal number of samples within one period and within two periods. A
/// tracker sends a burst every 332 ms, so that a period of one second contains two to four bursts.
constexpr double kLeastInOne = 0.5, kLeastInTwo = 0.8;
/// with fewer samples the fraction depends on single samples
constexpr double kFewestSamples = 20.0;

}  // namespace

std::string Starvation::look(double nominal_hz, bool streaming, protocol::HostTime now,
                             std::uint64_t samples) {
  const auto before = std::exchange(earlier_, {earlier_[1], Count{now, samples, streaming}});
  const auto share_since = [&](const Count& then) -> std::optional<double> {
    const double expected = nominal_hz * in_seconds(now - then.at);
    if (!then.known || !streaming || expected < kFewestSamples) return std::nullopt;
    return static_cast<double>(samples - then.samples) / expected;
  };
  const auto one = share_since(before[1]), two = share_since(before[0]);
  const bool starved = (one && *one < kLeastInOne) || (one && two && *two < kLeastInTwo);
  if (!starved) return {};

  return fmt::format(
      "{:.0f} % of the {:g} samples per second arrive: the device, its connection or this computer "
      "loses the rest",
      100.0 * std::min(*one, two.value_or(*one)), nominal_hz);
}

}  // namespace abbe::daemon
