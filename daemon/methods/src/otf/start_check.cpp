#include "abbe/methods/otf/start_check.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>

#include "abbe/base/units.hpp"
#include "abbe/calib/otf/run/polyline.hpp"

namespace abbe::daemon {
namespace {

constexpr auto kCounted = std::chrono::milliseconds{500};
constexpr auto kJudgedEvery = std::chrono::milliseconds{100};
// This is longer than the third of a second between two bursts of a tracker, plus some delay.
constexpr auto kSilence = std::chrono::milliseconds{1500};

std::string mm_text(const calib::Vector3& q) {
  return fmt::format("({:.3f}, {:.3f}, {:.3f}) mm", q[0] * 1e3, q[1] * 1e3, q[2] * 1e3);
}

double percent(std::size_t part, std::size_t all) {
  return all > 0 ? 100.0 * static_cast<double>(part) / static_cast<double>(all) : 0.0;
}

bool enough(std::size_t part, std::size_t all) {
  return all > 0 && percent(part, all) >= 100.0 * StartCheck::kShare;
}

}  // namespace

StartCheck::StartCheck(const Options& options) : options_(options), conditions_(judged()) {}

StartCheck::Counts StartCheck::recent() const noexcept {
  Counts sum;
  for (const Counts& c : window_) {
    if (last_time_ && c.begin + kWindow * kCounted < *last_time_) continue;
    sum.points += c.points;
    sum.usable += c.usable;
    sum.settled += c.settled;
    sum.with_axes += c.with_axes;
  }
  return sum;
}

std::vector<StartCondition> StartCheck::judged() const {
  const Counts c = recent();
  const auto tracker = [&]() -> StartCondition {
    if (silent_ || c.points == 0) return {"tracker", false, "no points from the tracker"};
    if (!enough(c.usable, c.points))
      return {
          "tracker", false,
          fmt::format("{:.0f} % of the tracker points are usable", percent(c.usable, c.points))};
    if (!enough(c.settled, c.points))
      return {"tracker", false, "the clock of the tracker is not settled: wait up to a minute"};
    return {"tracker", true, "the tracker streams usable points"};
  };

  const auto axes = [&]() -> StartCondition {
    if (silent_ || c.points == 0) return {"axes", false, "axis positions are not known"};
    if (!enough(c.with_axes, c.points))
      return {"axes", false,
              fmt::format("{:.0f} % of the tracker points have axis positions",
                          percent(c.with_axes, c.points))};
    return {"axes", true, "axis positions arrive"};
  };

  const auto position = [&]() -> StartCondition {
    if (!q_m_) return {"position", false, fmt::format("drive to {}", mm_text(options_.first_m))};
    const double off_m = (*q_m_ - options_.first_m).norm();
    if (off_m > options_.vertex_tolerance_m)
      return {"position", false,
              fmt::format("{:.3f} mm from the first vertex {}", off_m * 1e3,
                          mm_text(options_.first_m))};
    return {"position", true, "the machine is at the first vertex"};
  };

  const auto standstill = [&]() -> StartCondition {
    if (stood_ < options_.stand_before)
      return {"standstill", false,
              fmt::format("the machine must stand there for {:.1f} s",
                          in_seconds(options_.stand_before))};
    return {"standstill", true, "the machine stands"};
  };

  return {tracker(), axes(), position(), standstill()};
}

/// The conditions that do not hold: "47 % of the tracker points have axis positions, the clock
/// ..."; empty: all hold.
std::string StartCheck::missing() const {
  std::vector<std::string> texts;
  for (const StartCondition& c : conditions_)
    if (!c.met && c.name != "position") texts.push_back(c.text);
  return fmt::format("{}", fmt::join(texts, ", "));
}

/// The position of the machine relative to its legs after it has left the first vertex.
StartCheck::Departure StartCheck::departure(const calib::Vector3& q) const {
  const auto leg = calib::otf::nearest_on_leg(options_.first_m, options_.second_m, q);
  if (leg.off_m > options_.path_tolerance_m) return Departure::ElsewhereThanThePath;
  return leg.along_m > 2.0 * options_.vertex_tolerance_m ? Departure::OnFirstLeg
                                                         : Departure::NearTheVertex;
}

void StartCheck::take(const Point& point) {
  const bool follows = last_time_ && point.time - window_[newest_].begin < kCounted;
  if (!follows) {
    newest_ = (newest_ + 1) % kWindow;
    window_[newest_] = {.begin = point.time};
  }
  Counts& counts = window_[newest_];
  ++counts.points;
  counts.usable += point.usable ? 1 : 0;
  counts.settled += point.settled ? 1 : 0;
  counts.with_axes += point.q_m ? 1 : 0;
  last_time_ = point.time;
  silent_ = false;
  stood_ = point.stood;
  if (point.q_m) q_m_ = point.q_m;
  if (point.time - judged_at_ >= kJudgedEvery) judge(point.time);
  if (!point.q_m) return;

  if (at_start()) {
    was_at_start_ = true;
    return;
  }
  ready_ = false;
  const Departure where = departure(*q_m_);
  if (where == Departure::ElsewhereThanThePath) was_at_start_ = false;
  if (was_at_start_ && where == Departure::OnFirstLeg) {
    was_at_start_ = false;
    missed_ = fmt::format(
        "start missed: the machine has left {}, and the run has not begun: {}. Drive back and wait "
        "for READY",
        mm_text(options_.first_m),
        missing_at_start_.empty() ? "it did not stand there long enough" : missing_at_start_);
  }
}

bool StartCheck::at_start() const {
  return q_m_ && (*q_m_ - options_.first_m).norm() <= options_.vertex_tolerance_m;
}

void StartCheck::judge(protocol::HostTime now) {
  judged_at_ = now;
  conditions_ = judged();
  ready_ = std::all_of(conditions_.begin(), conditions_.end(),
                       [](const StartCondition& c) { return c.met; });
  if (!at_start()) return;
  missing_at_start_ = missing();
  if (ready_) missed_.clear();
}

void StartCheck::tick(protocol::HostTime now) {
  if (!last_time_ || now - *last_time_ < kSilence) return;
  silent_ = true;
  judge(now);
}

std::string StartCheck::text() const {
  if (ready_) return "READY: drive the path now";
  if (!missed_.empty()) return missed_;
  return fmt::format(
      "waiting for the machine to stand at {} for {:.1f} s with the tracker streaming",
      mm_text(options_.first_m), in_seconds(options_.stand_before));
}

}  // namespace abbe::daemon
