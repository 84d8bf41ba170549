#include "squareness.hpp"

#include <algorithm>
#include <array>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/direct/convention.hpp"
#include "model_curve.hpp"

namespace abbe::calib::direct {
namespace {

/// Effect of the slope of a straightness on a squareness; see compare.hpp.
struct SlopeTerm {
  std::string_view squareness;
  ErrorMotion straightness;
  double factor;
};
constexpr std::array kSlopeTerms{
    SlopeTerm{"EC0Y", {Motion::X, Axis::Y}, -1.0}, SlopeTerm{"EC0Y", {Motion::Y, Axis::X}, -1.0},
    SlopeTerm{"EB0Z", {Motion::X, Axis::Z}, 1.0},  SlopeTerm{"EB0Z", {Motion::Z, Axis::X}, 1.0},
    SlopeTerm{"EA0Z", {Motion::Y, Axis::Z}, -1.0}, SlopeTerm{"EA0Z", {Motion::Z, Axis::Y}, -1.0}};

/// Factor of the slope of the straightness in the squareness; 0 if it has no effect.
double slope_factor(const std::string& squareness, ErrorMotion straightness) {
  const auto found = std::find_if(kSlopeTerms.begin(), kSlopeTerms.end(), [&](const SlopeTerm& t) {
    return t.squareness == squareness && t.straightness == straightness;
  });
  return found == kSlopeTerms.end() ? 0.0 : found->factor;
}

std::span<const double> positions_of(ErrorMotion straightness, std::span<const LineChange> lines,
                                     std::span<const double> otherwise) {
  const auto found = std::find_if(lines.begin(), lines.end(), [&](const LineChange& change) {
    return change.straightness == straightness;
  });
  return found == lines.end() ? otherwise : std::span<const double>(found->positions_m);
}

/// True if two lines along an axis are less than 1 mm apart.
bool same_line(const Vector3& a_m, const Vector3& b_m, Axis along) {
  constexpr double kSameLine_m = 1e-3;
  Vector3 apart = a_m - b_m;
  apart(static_cast<Eigen::Index>(index(along))) = 0.0;
  return apart.norm() < kSameLine_m;
}

}  // namespace

std::optional<LineChange> line_change(ErrorMotion motion, const Runs& all,
                                      const std::optional<Vector3>& line_m,
                                      std::span<const double> common_m, StraightnessLine line) {
  if (!is_straightness(motion)) {
    return std::nullopt;
  }
  const Eigen::VectorXd own = reduction(motion, all.positions_m, 0.0, line) * all.mean();
  const Eigen::VectorXd common = interpolation_matrix(all.positions_m, common_m) * own;
  const bool shortened = common_m.front() - all.positions_m.front() > kSameTarget_m ||
                         all.positions_m.back() - common_m.back() > kSameTarget_m;
  return LineChange{motion,
                    {common_m.begin(), common_m.end()},
                    slope_row(common_m, line) * common,
                    line_m,
                    shortened};
}

Eigen::RowVectorXd squareness_row(const std::string& name, const TableBasis& basis,
                                  const Vector3& tool_m, const Vector3& at_m,
                                  std::span<const LineChange> lines, StraightnessLine line) {
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(static_cast<Eigen::Index>(basis.size()));
  for (const SlopeTerm& term : kSlopeTerms) {
    if (term.squareness == name) {
      const Axis axis = term.straightness.axis;
      const auto positions_m =
          positions_of(term.straightness, lines, basis.layout().nodes()[index(axis)].nodes_m);
      row += term.factor * slope_row(positions_m, line) *
             rows_along(basis, tool_m, term.straightness, at_m, positions_m);
    }
  }
  return row;
}

std::string why_not_comparable(const MeasuredError& squareness, const MachineNodes& nodes,
                               std::span<const LineChange> lines) {
  if (!squareness.line_m) {
    return "the point where its two lines meet is not stated (x_mm, y_mm, z_mm): rotations of the "
           "axes change a squareness from place to place";
  }
  for (std::size_t a = 0; a < 3; ++a) {
    const double at_m = (*squareness.line_m)(static_cast<Eigen::Index>(a));
    const std::vector<double>& nodes_m = nodes[a].nodes_m;
    if (at_m < nodes_m.front() - kSameTarget_m || at_m > nodes_m.back() + kSameTarget_m) {
      return message("its two lines meet outside the common range: ", letter(kAllAxes[a]), " = ",
                     kMmPerM * at_m, " mm");
    }
  }
  for (const LineChange& change : lines) {
    const bool concerned = slope_factor(squareness.name, change.straightness) != 0.0;
    const bool same =
        change.line_m && same_line(*change.line_m, *squareness.line_m, change.straightness.axis);
    if (concerned && change.shortened && !same) {
      return message(
          calib::name(change.straightness),
          " was measured beyond the common range, and not on the line of the squareness");
    }
  }
  return {};
}

double squareness_change(const std::string& name, std::span<const LineChange> lines) {
  double sum = 0.0;
  for (const LineChange& change : lines) {
    sum += slope_factor(name, change.straightness) * change.measured_slope;
  }
  return sum;
}

std::string squareness_text(const std::string& name, std::span<const LineChange> lines) {
  std::string text = "between the lines of the straightness errors";
  std::string names;
  for (const LineChange& change : lines) {
    if (slope_factor(name, change.straightness) != 0.0) {
      names += (names.empty() ? " " : " and ") + calib::name(change.straightness);
    }
  }
  return names.empty() ? "over the range of the model" : text + names;
}

}  // namespace abbe::calib::direct
