#include "direct/judge.hpp"

#include <algorithm>
#include <cmath>

#include "student_tail.hpp"

namespace abbe::calib::direct {
namespace {

/// A smaller uncertainty is rounding: the convention fixes the value there. m or rad.
constexpr double kFixedByConvention = 1e-9;

/// Values and variances of one position, before the test.
struct PointInput {
  double position_m = 0.0, measured = 0.0, model = 0.0;
  double variance_runs = 0.0, variance_device = 0.0, variance_model = 0.0;
};

/// [GUM] G.4.1: only the scatter of the runs has a limited number of degrees of freedom.
std::size_t effective_dof(double variance, double variance_runs, std::size_t runs) {
  constexpr double kUnlimited = 1e6;
  const double ratio = variance_runs > 0.0 ? variance / variance_runs : kUnlimited;
  const double dof = ratio * ratio * static_cast<double>(runs - 1);
  return static_cast<std::size_t>(std::clamp(dof, 1.0, kUnlimited));
}

PointDifference tested_point(const PointInput& in, std::size_t runs) {
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

  const bool scatter_known = runs > 1 || in.variance_device > 0.0;
  out.tested = scatter_known && out.u > kFixedByConvention;
  if (out.tested) {
    const std::size_t dof = runs > 1 ? effective_dof(variance, in.variance_runs, runs)
                                     : effective_dof(variance, 0.0, 2);
    out.p = student_tail(out.difference / out.u, dof);
  }
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

}  // namespace

void add_points(TableComparison& table, const Runs& runs, const Eigen::VectorXd& measured,
                const Eigen::VectorXd& model, const PointCovariances& cov) {
  for (std::size_t k = 0; k < runs.positions_m.size(); ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    table.points.push_back(tested_point({runs.positions_m[k], measured(i), model(i), cov.runs(i, i),
                                         cov.device(i, i), cov.model(i, i)},
                                        runs.values.size()));
  }
  add_statistics(table);
  table.finding = Finding::NotTested;  // judged later
}

std::size_t count_tests(const TableComparison& table) {
  return static_cast<std::size_t>(
      std::count_if(table.points.begin(), table.points.end(),
                    [](const PointDifference& point) { return point.tested; }));
}

void judge(TableComparison& table, double limit) {
  if (table.points.empty()) {
    table.finding = Finding::NotCompared;
    return;
  }
  double least_p = 1.0;
  bool tested = false;
  for (const PointDifference& point : table.points) {
    tested = tested || point.tested;
    least_p = std::min(least_p, point.p);
  }
  table.finding = least_p < limit ? Finding::Contradicts : Finding::Agrees;
  if (!tested) {
    table.finding = Finding::NotTested;
    table.reason = table.runs < 2 ? "one run shows no scatter; state the uncertainty of the device"
                                  : "neither the runs nor the model show an uncertainty";
  }
}

}  // namespace abbe::calib::direct
