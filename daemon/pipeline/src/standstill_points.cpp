#include "abbe/pipeline/standstill_points.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "abbe/config/capabilities.hpp"
#include "abbe/config/linear_axes.hpp"

namespace abbe::daemon {
namespace {

using protocol::SampleFlag;
using protocol::Snapshot;

bool has_axes(const Snapshot& s) {
  return has_linear_axes(s) && !has(s.head.flags, SampleFlag::AxisMissing);
}

bool good_point(const Snapshot& s) {
  return !has(s.tracker_point.head.flags, SampleFlag::PointInvalid) &&
         !has(s.tracker_point.head.flags, SampleFlag::SpeedExceeded);
}

}  // namespace

void StandstillPoints::take(const Snapshot& snapshot) {
  if (!snapshot.has_tracker_point) return;
  if (!has_axes(snapshot)) return finish();
  const auto& p = snapshot.tracker_point.p_tracker_m;
  const Sample sample{snapshot.head.time,
                      {snapshot.position[0], snapshot.position[1], snapshot.position[2]},
                      {p[0], p[1], p[2]}};
  const bool stands = running_ && (sample.reading_m - first_.reading_m).cwiseAbs().maxCoeff() <=
                                      options_.tolerance_m;

  if (!stands) {
    finish();
    begin(sample);
  }

  while (!pending_.empty() && pending_.front().time <= sample.time - options_.settle) {
    add(pending_.front());
    pending_.pop_front();
  }

  if (good_point(snapshot) && sample.time >= first_.time + options_.settle)
    pending_.push_back(sample);
}

void StandstillPoints::begin(const Sample& sample) {
  running_ = true;
  first_ = sample;
  open_ = {};
  taken_ = 0;
  reading_sum_m_ = tracker_sum_m_ = calib::Vector3::Zero();
  tracker_squares_m2_ = 0.0;
}

void StandstillPoints::add(const Sample& sample) {
  if (taken_ == 0) open_.from = sample.time;
  open_.until = sample.time;
  ++taken_;
  const calib::Vector3 off_m = sample.tracker_m - first_.tracker_m;
  reading_sum_m_ += sample.reading_m - first_.reading_m;
  tracker_sum_m_ += off_m;
  tracker_squares_m2_ += off_m.squaredNorm();
}

void StandstillPoints::finish() {
  if (running_ && taken_ > 0) {
    const auto n = static_cast<double>(taken_);
    const calib::Vector3 mean_off_m = tracker_sum_m_ / n;
    open_.mean = {first_.reading_m + reading_sum_m_ / n, first_.tracker_m + mean_off_m};
    open_.tracker_points = taken_;
    open_.scatter_m = std::sqrt(std::max(0.0, tracker_squares_m2_ / n - mean_off_m.squaredNorm()));
    points_.push_back(open_);
  }
  running_ = false;
  taken_ = 0;
  pending_.clear();
}

Result<void> check_verification(const Config& config) {
  if (!tracker_source(config))
    return fail(ErrorCode::Refused,
                fmt::format("verify: there is no {} with a host to measure with",
                            tables_with(Capability::TrackerPoints)));
  if (config.axes_compensated())
    return fail(ErrorCode::Refused,
                "verify: the control already corrects these axes (axes_compensated = true): a "
                "model applies to readings without this correction");
  return {};
}

StandstillOptions standstill_options(const Config& config) {
  StandstillOptions options;
  const auto tracker = tracker_source(config);
  if (tracker && tracker->stationary_time)
    options.settle = std::max(options.settle, *tracker->stationary_time);
  return options;
}

}  // namespace abbe::daemon
