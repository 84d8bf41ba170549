#include "abbe/calib/iso/standard_values.hpp"

#include <algorithm>
#include <cmath>

#include "iso/lines.hpp"

namespace abbe::calib::iso {
namespace {

using estimation::Travel;

Positioning positioning_of(const ErrorFunctions& functions, const AxisLine& line) {
  Positioning p{.axis = line.axis, .targets_m = line.targets_m};
  const std::size_t component = index(line.axis);
  const Eigen::MatrixXd mean = line.rows(functions, component);
  for (Eigen::Index i = 0; i < mean.rows(); ++i) {
    p.mean.push_back(functions.with_u(mean.row(i) - mean.row(0)));
  }
  p.M = p.E = range_of(functions, mean);

  if (functions.has_travel()) {
    const Eigen::MatrixXd up = line.rows(functions, component, Travel::Forward),
                          down = line.rows(functions, component, Travel::Backward);
    Eigen::MatrixXd both(up.rows() + down.rows(), up.cols());
    both << up, down;
    p.E = range_of(functions, both);
    p.B = largest_of(functions, up - down);
    p.mean_B = functions.with_u((up - down).colwise().mean());
  }
  return p;
}

/// Row vector w such that w f is the slope of the least-squares line through the values f at the
/// targets:  w_i = (p_i - mean p) / sum (p_k - mean p)^2.
Eigen::RowVectorXd slope_weights(const std::vector<double>& targets_m) {
  Eigen::RowVectorXd p = Eigen::Map<const Eigen::RowVectorXd>(
      targets_m.data(), static_cast<Eigen::Index>(targets_m.size()));
  p.array() -= p.mean();
  return p / p.squaredNorm();
}

Straightness straightness_of(const ErrorFunctions& functions, const AxisLine& line, Motion motion) {
  Straightness s{.motion = {motion, line.axis}};
  const Eigen::MatrixXd rows = line.rows(functions, direction(motion));
  const Eigen::RowVectorXd weights = slope_weights(line.targets_m);
  const Eigen::RowVectorXd slope = weights * rows, mean = rows.colwise().mean();
  const Eigen::VectorXd p = weights.transpose() / weights.squaredNorm();
  const Eigen::MatrixXd rest = rows.rowwise() - mean - p * slope;
  for (Eigen::Index i = 0; i < rest.rows(); ++i) {
    s.deviation.push_back(functions.with_u(rest.row(i)));
  }
  s.range = range_of(functions, rest);
  return s;
}

/// Row of the slope of component `of` of V on a line.
Eigen::RowVectorXd slope_row(const ErrorFunctions& functions, const AxisLine& line, Axis of) {
  return slope_weights(line.targets_m) * line.rows(functions, index(of));
}

std::array<Squareness, 3> squareness_of(const ErrorFunctions& functions,
                                        const std::array<AxisLine, 3>& lines) {
  const auto both = [&](Axis axis, Axis reference) {
    return Eigen::RowVectorXd(slope_row(functions, lines[index(axis)], reference) +
                              slope_row(functions, lines[index(reference)], axis));
  };
  return {Squareness{"EC0Y", Axis::Y, Axis::X, functions.with_u(-both(Axis::Y, Axis::X))},
          Squareness{"EB0Z", Axis::Z, Axis::X, functions.with_u(both(Axis::Z, Axis::X))},
          Squareness{"EA0Z", Axis::Z, Axis::Y, functions.with_u(-both(Axis::Z, Axis::Y))}};
}

std::vector<Angular> angular_of(const ErrorFunctions& functions,
                                const std::array<AxisLine, 3>& lines) {
  std::vector<Angular> all;
  if (functions.model().tables() == nullptr) {
    return all;
  }
  for (const Table& table : functions.model().tables()->layout().tables()) {
    if (!is_rotation(table.motion.motion)) {
      continue;
    }
    const std::vector<double>& targets_m = lines[index(table.motion.axis)].targets_m;
    Eigen::MatrixXd rows;
    for (std::size_t i = 0; i < targets_m.size(); ++i) {
      const Eigen::RowVectorXd row = functions.table_row(table, targets_m[i]);
      rows.conservativeResize(static_cast<Eigen::Index>(targets_m.size()), row.size());
      rows.row(static_cast<Eigen::Index>(i)) = row;
    }
    all.push_back({table.motion, range_of(functions, rows)});
  }
  return all;
}

}  // namespace

const Diagonal& StandardValues::worst_diagonal() const {
  return *std::max_element(
      diagonals.begin(), diagonals.end(),
      [](const Diagonal& a, const Diagonal& b) { return a.E.value < b.E.value; });
}

Result<StandardValues> standard_values(const VolumetricModel& model) {
  const Result<LineBox> box = line_box(model.validity());
  if (!box) {
    return tl::unexpected(box.error());
  }

  const ErrorFunctions functions(model);
  std::array<AxisLine, 3> lines;
  for (const Axis axis : kAllAxes) {
    lines[index(axis)] = line_of(model, *box, axis);
  }

  StandardValues values{.box = *box, .tool_offset_m = model.tool_offsets_m().front()};
  for (const Axis axis : kAllAxes) {
    values.positioning[index(axis)] = positioning_of(functions, lines[index(axis)]);
    for (const Motion motion : {Motion::X, Motion::Y, Motion::Z}) {
      if (direction(motion) != index(axis)) {
        values.straightness.push_back(straightness_of(functions, lines[index(axis)], motion));
      }
    }
  }
  values.squareness = squareness_of(functions, lines);
  values.angular = angular_of(functions, lines);
  values.diagonals = diagonals_of(functions, *box);
  return values;
}

}  // namespace abbe::calib::iso
