#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "abbe/base/units.hpp"
#include "abbe/report/model_figures.hpp"

namespace abbe::daemon {
namespace {

using calib::Axis;
using calib::VolumetricModel;

/// Points of a curve in a cell between two nodes. Tables with many nodes are drawn at their nodes
/// only: a point of a cubic table depends on all nodes.
constexpr std::size_t kStepsInCell = 6, kMostNodesWithSteps = 60;

/// Value and standard uncertainty of a table at a position, as the model interpolates it.
struct TableValue {
  double value = 0.0, u = 0.0;
};

TableValue value_at(const VolumetricModel& model, const calib::Table& table, double position_m) {
  const auto& interpolation = model.tables()->interpolation(table.motion.axis);
  const calib::NodeWeights weights = interpolation.at(position_m);
  const auto offset = static_cast<Eigen::Index>(table.offset + weights.first());
  const auto count = static_cast<Eigen::Index>(weights.count());
  Eigen::VectorXd w(count);
  for (Eigen::Index i = 0; i < count; ++i) w(i) = weights[static_cast<std::size_t>(i)];

  const double variance = w.dot(model.covariance().block(offset, offset, count, count) * w);
  return {w.dot(model.U().segment(offset, count)), std::sqrt(std::max(0.0, variance))};
}

TableValue value_of_node(const VolumetricModel& model, const calib::Table& table,
                         std::size_t node) {
  const auto i = static_cast<Eigen::Index>(table.offset + node);
  return {model.U()(i), std::sqrt(std::max(0.0, model.covariance()(i, i)))};
}

Curve curve_of(const VolumetricModel& model, const calib::Table& table) {
  const auto& nodes_m = model.tables()->layout().nodes()[index(table.motion.axis)].nodes_m;
  const std::size_t steps = nodes_m.size() <= kMostNodesWithSteps ? kStepsInCell : 1;
  Curve curve{.name = {}, .x = {}, .y = {}, .dot_every = steps};
  const auto add = [&curve](double position_m, const TableValue& at) {
    curve.x.push_back(position_m * kMmPerM);
    curve.y.push_back(at.value * kUmPerM);
    curve.u.push_back(at.u * kUmPerM);
  };

  for (std::size_t k = 0; k < nodes_m.size(); ++k) {
    add(nodes_m[k], value_of_node(model, table, k));
    for (std::size_t i = 1; i < steps && k + 1 < nodes_m.size(); ++i) {
      const double b = static_cast<double>(i) / static_cast<double>(steps);
      const double at_m = nodes_m[k] + b * (nodes_m[k + 1] - nodes_m[k]);
      add(at_m, value_at(model, table, at_m));
    }
  }

  curve.key = calib::name(table.motion);
  curve.name =
      fmt::format("{}, U \u2264 {:.2g}", curve.key, 2.0 * *std::ranges::max_element(curve.u));
  return curve;
}

/// A chart of the errors of one kind (rotations if `angles`, else translations) along one axis.
LineChart table_chart(const VolumetricModel& model, Axis axis, bool angles) {
  LineChart chart{
      .title = fmt::format("{} of {}", angles ? "Angular errors" : "Positioning and straightness",
                           letter(axis)),
      .x_label = fmt::format("{}, mm", letter(axis)),
      .y_label = angles ? "error, urad" : "error, um"};
  for (const calib::Table& table : model.tables()->layout().tables()) {
    if (table.motion.axis == axis && is_rotation(table.motion.motion) == angles)
      chart.curves.push_back(curve_of(model, table));
  }
  return chart;
}

}  // namespace

std::vector<LineChart> table_line_charts(const VolumetricModel& model) {
  std::vector<LineChart> charts;
  if (model.tables() == nullptr) return charts;
  for (const Axis axis : calib::kAllAxes) {
    for (const bool angles : {false, true}) {
      LineChart chart = table_chart(model, axis, angles);
      if (!chart.curves.empty()) charts.push_back(std::move(chart));
    }
  }
  return charts;
}

}  // namespace abbe::daemon
