#include "direct/squareness.hpp"

#include <algorithm>
#include <array>

#include "direct/convention.hpp"
#include "direct/device.hpp"
#include "direct/model_curve.hpp"

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

/// 0 if the straightness has no effect on the squareness.
double slope_factor(const std::string& squareness, ErrorMotion straightness) {
  const auto found = std::find_if(kSlopeTerms.begin(), kSlopeTerms.end(), [&](const SlopeTerm& t) {
    return t.squareness == squareness && t.straightness == straightness;
  });
  return found == kSlopeTerms.end() ? 0.0 : found->factor;
}

}  // namespace

std::optional<LineChange> line_change(ErrorMotion motion, const Runs& all,
                                      std::span<const double> common_m, StraightnessLine line) {
  if (!is_straightness(motion)) {
    return std::nullopt;
  }
  Runs own = all;
  own.values = {reduction(motion, all.positions_m, 0.0, line) * all.mean()};
  own.reversal.clear();
  const Runs common = at_positions(own, [&](double position_m) {
    return position_m >= common_m.front() && position_m <= common_m.back();
  });
  return LineChange{motion,
                    {common_m.begin(), common_m.end()},
                    slope_row(common.positions_m, line) * common.values.front()};
}

Eigen::RowVectorXd squareness_row(const std::string& name, const VolumetricModel& model,
                                  std::span<const LineChange> lines, StraightnessLine line) {
  Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(model.U().size());
  const auto place = std::find(kSquarenessNames.begin(), kSquarenessNames.end(), name);
  row(static_cast<Eigen::Index>(model.tables()->layout().squareness_offset()) +
      (place - kSquarenessNames.begin())) = 1.0;
  for (const LineChange& change : lines) {
    const double factor = slope_factor(name, change.straightness);
    if (factor != 0.0) {
      row += factor * slope_row(change.positions_m, line) *
             ModelCurve(model, change.straightness).rows(change.positions_m);
    }
  }
  return row;
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
  return names.empty() ? text + " in the gauge of the model" : text + names;
}

}  // namespace abbe::calib::direct
