#include "abbe/methods/otf/time_unit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <optional>
#include <vector>

#include "otf/vector_of.hpp"

namespace abbe::daemon {
namespace {

using calib::Vector3;

constexpr double kMmPerMin = 60.0e3;  // mm/min per m/s
constexpr double kMostFactor = 20.0;  // between speed and feed
constexpr double kSlowest_m_per_s = 30.0 / kMmPerMin, kFastest_m_per_s = 200e3 / kMmPerMin;

struct TimedPlace {
  double time_s = 0.0;
  Vector3 p_m = Vector3::Zero();
};

/// Places at equal distances in the sequence of rows. The parts between them are short compared
/// with the time from one vertex to the next, so that parts in which the machine moves contain no
/// dwell.
template <class Rows, class Place>
std::vector<TimedPlace> thinned(const Rows& rows, const PathFile& path, const Place& place_of) {
  constexpr std::size_t kLeastParts = 500, kPartsOfLeg = 20;
  const std::size_t parts = std::max(kLeastParts, kPartsOfLeg * path.vertices_m.size());
  const std::size_t stride = std::max<std::size_t>(1, rows.size() / parts);
  std::vector<TimedPlace> places;
  for (std::size_t i = 0; i < rows.size(); i += stride)
    if (const std::optional<TimedPlace> place = place_of(rows[i])) places.push_back(*place);
  return places;
}

double length_m(const PathFile& path) {
  double sum_m = 0.0;
  for (std::size_t i = 1; i < path.vertices_m.size(); ++i)
    sum_m += (vector_of(path.vertices_m[i]) - vector_of(path.vertices_m[i - 1])).norm();
  return sum_m;
}

/// Median of the speeds over the parts between the places in which the machine moves, that is, the
/// parts longer than a quarter of the mean part of the path. nullopt if there are none.
std::optional<double> speed_m_per_s(const std::vector<TimedPlace>& places, double path_m) {
  constexpr double kMoves = 0.25;
  std::vector<double> speeds;
  for (std::size_t i = 1; i < places.size(); ++i) {
    const double way_m = (places[i].p_m - places[i - 1].p_m).norm();
    if (way_m > kMoves * path_m / static_cast<double>(places.size()))
      speeds.push_back(way_m / (places[i].time_s - places[i - 1].time_s));
  }
  if (speeds.empty()) return std::nullopt;
  const auto middle = speeds.begin() + std::ssize(speeds) / 2;
  std::ranges::nth_element(speeds, middle);
  return *middle;
}

struct Expected {
  double lowest_m_per_s = kSlowest_m_per_s, highest_m_per_s = kFastest_m_per_s;
  std::string text = "the feed of a machine";

  [[nodiscard]] bool contains(double v_m_per_s) const {
    return v_m_per_s >= lowest_m_per_s && v_m_per_s <= highest_m_per_s;
  }
};

Expected expected_speed(const PathFile& path) {
  std::vector<double> feeds;
  std::ranges::copy_if(path.feed_m_per_s, std::back_inserter(feeds),
                       [](double feed) { return std::isfinite(feed); });
  if (feeds.empty()) return {};
  const auto [least, most] = std::ranges::minmax(feeds);
  const auto stated = least == most
                          ? fmt::format("{:.6g}", kMmPerMin * most)
                          : fmt::format("{:.6g} to {:.6g}", kMmPerMin * least, kMmPerMin * most);
  return {least / kMostFactor, most * kMostFactor,
          fmt::format("{} states a feed_mm_per_min of {}", path.source.name, stated)};
}

/// Text that names the unit with which the times fit, "; they fit as milliseconds"; empty if no
/// unit fits.
std::string unit_that_fits(double v_m_per_s, const Expected& expected) {
  struct Unit {
    const char* name;
    double in_s;
  };
  constexpr std::array kUnits{Unit{"milliseconds", 1e-3}, Unit{"microseconds", 1e-6},
                              Unit{"nanoseconds", 1e-9}, Unit{"minutes", 60.0},
                              Unit{"hours", 3600.0}};
  for (const Unit& unit : kUnits)
    if (expected.contains(v_m_per_s / unit.in_s)) return fmt::format("; they fit as {}", unit.name);
  return {};
}

Result<void> check(const std::filesystem::path& file, const TimesOfFile& times,
                   const std::vector<TimedPlace>& places, const PathFile& path) {
  constexpr std::size_t kLeastOfLeg = 4;
  const auto v_m_per_s = speed_m_per_s(places, length_m(path));
  Expected expected = expected_speed(path);
  if (places.size() < kLeastOfLeg * path.vertices_m.size()) expected.lowest_m_per_s = 0.0;
  if (!v_m_per_s || expected.contains(*v_m_per_s)) return {};
  return fail(
      ErrorCode::BadInput,
      fmt::format("{}:{}: time_s: with the times of lines {} to {} the machine moves at "
                  "{:.4g} mm/min, but {}, expected {:.4g} to {:.4g} mm/min: the times must "
                  "be in s{}",
                  file.string(), times.first_line, times.first_line, times.last_line,
                  kMmPerMin * *v_m_per_s, expected.text, kMmPerMin * expected.lowest_m_per_s,
                  kMmPerMin * expected.highest_m_per_s, unit_that_fits(*v_m_per_s, expected)));
}

}  // namespace

Result<void> check_time_unit(const std::filesystem::path& file, const TrackerFile& tracker,
                             const PathFile& path) {
  const auto places =
      thinned(tracker.points, path,
              [](const calib::otf::TrackerObservation& p) -> std::optional<TimedPlace> {
                if (!p.valid) return std::nullopt;
                return TimedPlace{p.time_s, p.p_tracker_m};
              });
  return check(file, tracker.times, places, path);
}

Result<void> check_time_unit(const std::filesystem::path& file, const EncoderFile& encoder,
                             const PathFile& path) {
  const auto places = thinned(encoder.rows, path, [](const EncoderRow& row) {
    return std::optional(TimedPlace{row.time_s, vector_of(row.reading_m)});
  });
  return check(file, encoder.times, places, path);
}

}  // namespace abbe::daemon
