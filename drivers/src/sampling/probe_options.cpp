#include "abbe/drivers/sampling/probe_options.hpp"

#include <fmt/format.h>

namespace abbe::drivers {
namespace {

using std::chrono::nanoseconds;

// Largest sum of the times that the scan history covers. It limits heap memory: ten seconds at 33
// kHz would be 80 MB.
constexpr auto kLongestPast = std::chrono::seconds{1};

tl::unexpected<Error> bad(const TouchOptions& options, std::string_view what) {
  return tl::unexpected(Error{ErrorCode::BadConfiguration,
                              fmt::format("touch probe {}: {}", options.delay.id, what)});
}

}  // namespace

Result<void> check(const TouchOptions& o) {
  const nanoseconds zero{};
  if (o.delay.delay < zero) return bad(o, "the delay is negative");
  if (o.delay.u_jitter < zero || o.delay.u_delay < zero)
    return bad(o, "an uncertainty of the delay is negative");
  if (o.approach.min_speed_m_s < 0.0 || !(o.approach.max_speed_m_s > o.approach.min_speed_m_s))
    return bad(o, "the largest approach speed must be above the smallest");
  if (!(o.approach.max_speed_change > 0.0))
    return bad(o, "the permitted change of speed must be above 0");
  if (o.approach.speed_window <= zero) return bad(o, "the speed window must be above 0");
  if (o.switching.confirm <= zero || o.switching.chatter < zero || o.switching.rearm_quiet < zero)
    return bad(o,
               "the confirmation must be above 0, chatter and re-arm times must not be negative");
  if (o.switching.chatter >= o.switching.confirm)
    return bad(o, "the chatter time must be below the confirmation");
  if (!(o.switching.rearm_retract_m >= 0.0)) return bad(o, "the retract distance is negative");
  if (!(o.wiring.clock_hz >= 1e3 && o.wiring.clock_hz <= 1e9))
    return bad(o, "the clock must be 1 kHz to 1 GHz");
  if (o.wiring.counter_debounce < zero) return bad(o, "the debounce time is negative");
  if (o.wiring.scan_period <= zero) return bad(o, "the scan period must be above 0");
  for (const double resolution : o.wiring.resolution)
    if (!(resolution >= 0.0)) return bad(o, "the resolution of an axis is negative");
  if (o.window_before < zero || o.window_after < zero) return bad(o, "a window is negative");
  if (o.delay.delay + o.switching.confirm + o.approach.speed_window + o.window_before >
      kLongestPast)
    return bad(o, "delay, confirmation and window together are longer than 1 s");

  return {};
}

}  // namespace abbe::drivers
