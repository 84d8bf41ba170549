#include "abbe/calib/iso/standard_values.hpp"

#include <algorithm>
#include <cmath>

#include "abbe/result/try.hpp"
#include "lines.hpp"

namespace abbe::calib::iso {
namespace {

Positioning positioning_of(const ErrorFunctions& functions, const AxisLine& line) {
  Positioning p{.axis = line.axis, .targets_m = line.targets_m};
  const std::size_t component = index(line.axis);
  const Eigen::MatrixXd mean = line.rows(functions, component);
  for (Eigen::Index i = 0; i < mean.rows(); ++i) {
    p.mean.push_back(functions.with_u(mean.row(i) - mean.row(0)));
  }
  p.M = range_of(functions, mean);

  if (functions.has_travel()) {
    const Eigen::MatrixXd up = line.rows(functions, component, Travel::Forward),
                          down = line.rows(functions, component, Travel::Backward);
    if (const auto both = bidirectional_of(functions, up, down)) {
      p.E = both->E;
      p.B = both->B;
      p.mean_B = functions.with_u((up - down).colwise().mean());
    }
  }
  return p;
}

/// The least-squares line over the travel of a curve f that is linear between the targets p_i:
///     min over a, b of the integral of (f(p) - a - b (p - p_mean))^2 dp
///     mean = sum w_i f_i,   slope = sum (M q)_i f_i / q^T M q,   q_i = p_i - p_mean
/// w_i: the part of the travel nearest to target i; M: the integrals of the products of the hat
/// functions of the targets, tridiagonal.
struct ReferenceLine {
  Eigen::RowVectorXd mean, slope;  ///< weights of the values f_i
  Eigen::VectorXd from_mean_m;     ///< the vector q

  explicit ReferenceLine(const std::vector<double>& targets_m) {
    const Eigen::Index n = std::ssize(targets_m);
    const auto p = Eigen::Map<const Eigen::VectorXd>(targets_m.data(), n);
    mean = Eigen::RowVectorXd::Zero(n);
    Eigen::MatrixXd M = Eigen::MatrixXd::Zero(n, n);
    for (Eigen::Index i = 0; i + 1 < n; ++i) {
      const double h = p(i + 1) - p(i);
      mean.segment<2>(i).array() += 0.5 * h / (p(n - 1) - p(0));
      M.block<2, 2>(i, i) += h / 6.0 * (Eigen::Matrix2d() << 2.0, 1.0, 1.0, 2.0).finished();
    }
    from_mean_m = p.array() - mean.dot(p);
    slope = (M * from_mean_m).transpose();
    slope /= slope.dot(from_mean_m);
  }
};

Straightness straightness_of(const ErrorFunctions& functions, const AxisLine& line, Motion motion) {
  Straightness s{.motion = {motion, line.axis}};
  const Eigen::MatrixXd rows = line.rows(functions, direction(motion));
  const ReferenceLine reference(line.targets_m);
  const Eigen::RowVectorXd slope = reference.slope * rows, mean = reference.mean * rows;
  const Eigen::MatrixXd rest = rows.rowwise() - mean - reference.from_mean_m * slope;
  for (Eigen::Index i = 0; i < rest.rows(); ++i) {
    s.deviation.push_back(functions.with_u(rest.row(i)));
  }
  s.range = range_of(functions, rest);
  return s;
}

/// Row a: a U is the slope of component `of` of V on a line.
Eigen::RowVectorXd slope_row(const ErrorFunctions& functions, const AxisLine& line, Axis of) {
  return ReferenceLine(line.targets_m).slope * line.rows(functions, index(of));
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

const Diagonal& StandardValues::diagonal_of_largest_M() const {
  return *std::max_element(
      diagonals.begin(), diagonals.end(),
      [](const Diagonal& a, const Diagonal& b) { return a.M.value < b.M.value; });
}

const Diagonal* StandardValues::diagonal_of_largest_E() const {
  const auto largest = std::max_element(
      diagonals.begin(), diagonals.end(), [](const Diagonal& a, const Diagonal& b) {
        return a.E.value_or(Value{}).value < b.E.value_or(Value{}).value;
      });
  return largest->E ? &*largest : nullptr;
}

Result<StandardValues> standard_values(const VolumetricModel& model) {
  const Result<LineBox> box = line_box(model.validity());
  ABBE_TRY(box);

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
