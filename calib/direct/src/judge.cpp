#include "abbe/calib/internal/direct/judge.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/direct/convention.hpp"
#include "abbe/calib/internal/statistics/student_tail.hpp"

namespace abbe::calib::direct {
namespace {

/// An uncertainty below this (m or rad) is a rounding error: the convention sets the value to zero
/// at this position.
constexpr double kFixedByConvention = 1e-9;

/// Values and variances of one position, before the test.
struct PointInput {
  double position_m = 0.0, measured = 0.0, model = 0.0;
  double variance_runs = 0.0, variance_device = 0.0, variance_model = 0.0;
};

PointDifference tested_point(const PointInput& in, bool known) {
  PointDifference out;
  out.position_m = in.position_m;
  out.measured = in.measured;
  out.model = in.model;
  out.difference = in.measured - in.model;
  const double variance_measured = in.variance_runs + in.variance_device;
  const double variance = variance_measured + in.variance_model;
  out.u_measured = std::sqrt(variance_measured);
  out.u_model = std::sqrt(std::max(0.0, in.variance_model));
  out.u = std::sqrt(std::max(0.0, variance));

  out.u_runs = std::sqrt(in.variance_runs);
  out.tested = known && out.u > kFixedByConvention;
  return out;
}

void add_statistics(TableComparison& table) {
  double squares = 0.0, normalised = 0.0, tested = 0.0;
  for (const PointDifference& point : table.points) {
    const double d = std::abs(point.difference);
    table.mae += d / static_cast<double>(table.points.size());
    squares += d * d / static_cast<double>(table.points.size());
    if (d >= table.largest) {
      table.largest = d;
      table.largest_at_m = point.position_m;
    }
    if (point.tested) {
      const double ratio = d / point.u;
      normalised += ratio * ratio;
      tested += 1.0;
      table.largest_normalised = std::max(table.largest_normalised, ratio);
    }
  }
  table.rms = std::sqrt(squares);
  table.rms_normalised = tested > 0.0 ? std::sqrt(normalised / tested) : 0.0;
}

std::string too_coarse(const TableComparison& table, double largest_of_model) {
  const char* unit = table.is_angle ? " urad" : " um";
  return message("differences up to ", three_digits(kUmPerM * table.revealed), unit,
                 " would not be found, the largest value of the model is ",
                 three_digits(kUmPerM * largest_of_model), unit,
                 "; measure more runs, or state the uncertainty of the device");
}

std::string why_not_tested(const TableComparison& table) {
  return table.runs < 2 ? "one run shows no scatter; state the uncertainty of the device"
                        : "neither the runs nor the model show an uncertainty; state that of the "
                          "device";
}

}  // namespace

void add_points(TableComparison& table, const Runs& runs, const Eigen::VectorXd& measured,
                const Eigen::VectorXd& model, const PointCovariances& cov, bool known) {
  for (std::size_t k = 0; k < runs.positions_m.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    table.points.push_back(tested_point({runs.positions_m[k], measured(i), model(i), cov.runs(i, i),
                                         cov.device(i, i), cov.model(i, i)},
                                        known));
  }
  add_statistics(table);
  table.finding = Finding::NotTested;  // until judge() sets it
}

std::size_t count_tests(const TableComparison& table) {
  return static_cast<std::size_t>(
      std::count_if(table.points.begin(), table.points.end(),
                    [](const PointDifference& point) { return point.tested; }));
}

Limits limits_of(double p, std::size_t dof) {
  constexpr std::size_t kNormal = 1000;  // as good as infinite: its quantile is at most 1 % above
                                         // the normal one
  return {dof > 0 ? student_quantile(p, dof) : 0.0, student_quantile(p, kNormal)};
}

double limit_of(const Limits& limits, double variance_runs, double variance) {
  return std::sqrt(limits.student * limits.student * variance_runs +
                   limits.normal * limits.normal * std::max(0.0, variance - variance_runs));
}

void judge(TableComparison& table, const Limits& limits) {
  if (table.points.empty()) {
    table.finding = Finding::NotCompared;
    return;
  }
  bool tested = false, contradicts = false, model_seen = false;
  double largest_of_model = 0.0;
  for (PointDifference& point : table.points) {
    largest_of_model = std::max(largest_of_model, std::abs(point.model));
    if (point.tested) {
      point.limit = limit_of(limits, point.u_runs * point.u_runs, point.u * point.u);
      table.revealed = std::max(table.revealed, point.limit);
      tested = true;
      contradicts = contradicts || std::abs(point.difference) > point.limit;
      model_seen = model_seen || std::abs(point.model) > point.limit;
    }
  }

  if (contradicts) {
    table.finding = Finding::Contradicts;
  } else if (tested && model_seen) {
    table.finding = Finding::Agrees;
  } else if (table.reason.empty()) {
    table.reason = tested ? too_coarse(table, largest_of_model) : why_not_tested(table);
  }
}

}  // namespace abbe::calib::direct
