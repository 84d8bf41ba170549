#include "abbe/web/curve_history.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "abbe/base/json_text.hpp"
#include "abbe/base/utc_text.hpp"

namespace abbe::web {
namespace {

using nlohmann::json;

/// The number of the step that contains `at`.
std::int64_t bucket_of(CurveHistory::Clock::time_point at, const CurveWindow& window) {
  return at.time_since_epoch() / window.step;
}

/// Rounded, so that the answer stays short: to 10 nm, 0.00001 degrees.
double rounded(double value) {
  constexpr double kPerUnit = 1e5;
  return std::round(value * kPerUnit) / kPerUnit;
}

}  // namespace

CurveHistory::Curve* CurveHistory::find_or_add(const CurveName& name, Clock::time_point now) {
  const auto known = std::ranges::find_if(curves_, [&](const Curve& curve) {
    return curve.name.name == name.name && curve.name.group == name.group;
  });
  if (known != curves_.end()) return &*known;
  if (curves_.size() >= kMostCurves)
    left_out_ = std::erase_if(curves_, [&](const Curve& curve) {
                  return now - *curve.last > kWindows.back().length;
                }) == 0;
  if (curves_.size() >= kMostCurves) return nullptr;

  Curve& added = curves_.emplace_back(Curve{.name = name, .last = {}, .rings = {}});
  for (std::size_t i = 0; i < kWindows.size(); ++i) added.rings[i].resize(kWindows[i].buckets());
  return &added;
}

void CurveHistory::add(const CurveName& name, double value, Clock::time_point now) {
  if (!std::isfinite(value)) return;
  const std::lock_guard lock(mutex_);
  Curve* const curve = find_or_add(name, now);
  if (curve == nullptr) return;

  const bool gap = curve->last && now - *curve->last > kGap;
  curve->last = now;
  for (std::size_t i = 0; i < kWindows.size(); ++i) {
    auto& ring = curve->rings[i];
    const std::int64_t number = bucket_of(now, kWindows[i]);
    Bucket& bucket = ring[static_cast<std::size_t>(number) % ring.size()];
    if (bucket.number != number) bucket = {.number = number, .min = value, .max = value};
    bucket.min = std::min(bucket.min, value);
    bucket.max = std::max(bucket.max, value);
    bucket.sum += value;
    ++bucket.count;
    bucket.gap |= gap;
  }
}

std::optional<std::string> CurveHistory::window(std::string_view name, std::int64_t since,
                                                Clock::time_point now) const {
  const auto found = std::ranges::find(kWindows, name, &CurveWindow::name);
  if (found == kWindows.end()) return std::nullopt;
  const auto index = static_cast<std::size_t>(found - kWindows.begin());
  const auto most = static_cast<std::int64_t>(found->buckets());
  const std::int64_t last = bucket_of(now, *found);
  const std::int64_t oldest = std::max<std::int64_t>(0, last - most + 1);
  const std::int64_t first = since >= oldest && since <= last ? since : oldest;

  json curves = json::array();
  const std::lock_guard lock(mutex_);
  for (const Curve& curve : curves_) {
    const auto& ring = curve.rings[index];
    json min = json::array(), max = json::array(), mean = json::array(), gaps = json::array();
    bool any = false;
    for (std::int64_t number = first; number <= last; ++number) {
      const Bucket& bucket = ring[static_cast<std::size_t>(number) % ring.size()];
      const bool has_value = bucket.number == number;
      any = any || has_value;
      min.push_back(has_value ? json(rounded(bucket.min)) : json{});
      max.push_back(has_value ? json(rounded(bucket.max)) : json{});
      mean.push_back(has_value ? json(rounded(bucket.sum / bucket.count)) : json{});
      if (has_value && bucket.gap) gaps.push_back(number);
    }
    if (!any) continue;
    curves.push_back({{"group", curve.name.group},
                      {"name", curve.name.name},
                      {"unit", curve.name.unit},
                      {"min", std::move(min)},
                      {"max", std::move(max)},
                      {"mean", std::move(mean)},
                      {"gaps", std::move(gaps)}});
  }
  const std::chrono::duration<double> now_s = now.time_since_epoch();
  const auto wall =
      std::chrono::time_point_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now());
  const json answer{{"window", found->name},
                    {"step_s", found->step.count()},
                    {"buckets", most},
                    {"first", first},
                    {"length", last - first + 1},
                    {"now_s", now_s.count()},
                    {"now", daemon::to_text(protocol::UtcTime{wall.time_since_epoch()})},
                    {"left_out", left_out_},
                    {"curves", std::move(curves)}};
  return daemon::json_text(answer);
}

}  // namespace abbe::web
