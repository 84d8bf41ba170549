#include "sample_lines.hpp"

#include <fmt/format.h>

#include <array>
#include <chrono>
#include <span>
#include <string>
#include <string_view>

namespace abbe::daemon {
namespace {

using protocol::SampleHead;

constexpr std::array<std::string_view, 12> kSampleFlags{
    "gap",           "time-widened", "clock-unsettled", "axis-missing",   "bus-error",
    "bus-off",       "device-error", "speed-warning",   "speed-exceeded", "point-invalid",
    "beam-returned", "restarted"};
constexpr std::array<std::string_view, 7> kTouchFlags{
    "chattered",     "speed-low",   "speed-high", "speed-unsteady",
    "latch-refused", "no-position", "refused"};

template <std::size_t N>
std::string names_of(std::uint32_t flags, const std::array<std::string_view, N>& names) {
  std::string out;
  for (std::size_t bit = 0; bit < N; ++bit)
    if ((flags >> bit & 1u) != 0) out += fmt::format(" {}", names[bit]);
  return out;
}

/// "axes      1234.567 gap lost=3 |"
std::string head_of(std::string_view what, const SampleHead& head, protocol::HostTime begin) {
  const std::chrono::duration<double, std::milli> since = head.time - begin;
  std::string out =
      fmt::format("{:<8}{:12.3f}{}", what, since.count(), names_of(head.flags, kSampleFlags));
  if (head.lost_before > 0) out += fmt::format(" lost={}", head.lost_before);
  return out + " |";
}

std::string values(const auto& numbers, std::string_view format) {
  std::string out;
  for (const auto number : numbers) out += ' ' + fmt::format(fmt::runtime(format), number);
  return out;
}

std::string missing(std::uint8_t mask) {
  return mask == 0 ? std::string{} : fmt::format(" missing={:#04x}", mask);
}

std::string line_of(const protocol::TrackerPoint& p, protocol::HostTime begin) {
  return fmt::format("{}{} status={}\n", head_of("point", p.head, begin),
                     values(p.p_tracker_m, "{:.9f}"), p.device_status);
}

std::string line_of(const protocol::AxisSample& s, protocol::HostTime begin) {
  return fmt::format("{}{}{}\n", head_of("axes", s.head, begin),
                     values(std::span{s.count}.first(s.axis_count), "{}"), missing(s.missing_mask));
}

std::string line_of(const protocol::EnvironmentSample& e, protocol::HostTime begin,
                    std::string_view what) {
  const std::array air{e.air_temperature_K, e.air_pressure_Pa, e.relative_humidity};
  std::string out = head_of(what, e.head, begin) + values(air, "{:.6g}");
  if (e.measured == 0) out += " assumed";
  for (std::size_t i = 0; i < e.temperature_K.size(); ++i)
    if ((e.measured & protocol::temperature_bit(i)) != 0)
      out += fmt::format(" T{}={:.6g}", i, e.temperature_K[i]);
  return out + '\n';
}

std::string line_of(const protocol::ProbeTrigger& t, protocol::HostTime begin) {
  return fmt::format("{} {}{}{}{}\n", head_of("touch", t.head, begin), t.touch,
                     names_of(t.touch_flags, kTouchFlags),
                     values(std::span{t.position}.first(t.axis_count), "{:.9f}"),
                     missing(t.missing_mask));
}

}  // namespace

void print_samples(std::FILE* to, const Batch& batch, protocol::HostTime begin) {
  const auto print = [to](const std::string& line) { std::fputs(line.c_str(), to); };
  for (const auto& point : batch.points) print(line_of(point, begin));
  for (const auto& sample : batch.axes) print(line_of(sample, begin));
  for (const auto& sample : batch.environment) print(line_of(sample, begin, "weather"));
  for (const auto& [device, sample] : batch.measured_environment)
    print(line_of(sample, begin, fmt::format("air{}", device)));
  for (const auto& touch : batch.touches) print(line_of(touch, begin));
}

}  // namespace abbe::daemon
