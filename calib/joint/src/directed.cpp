#include "directed.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/calib/internal/base/units.hpp"
#include "abbe/calib/internal/geometry/axis_scale_columns.hpp"
#include "abbe/calib/internal/joint/all_parts.hpp"
#include "abbe/calib/internal/statistics/chi2_tail.hpp"
#include "abbe/calib/internal/statistics/elementary.hpp"
#include "abbe/calib/internal/statistics/student_tail.hpp"

namespace abbe::calib::joint {
namespace {

/// Probability of a larger |d| if the part and the others have the same value.
double p_of(const AllParts::Directed& found) {
  const double t = found.d / found.u;
  return found.dof > 0.0 ? student_tail(t, static_cast<std::size_t>(std::max(1.0, found.dof)))
                         : exponential(log_chi2_tail(t * t, 1));
}

/// Probable causes of a wrong length of a part, for the method of the part.
std::string causes_of_length(const std::string& method) {
  if (method == "otf") {
    return "wrong scale of the tracker's ranges";
  }
  if (method == "evemu") {
    return "wrong length or temperature of the array";
  }
  return method == "mfb" ? "wrong length or temperature of the bar" : "wrong scale of its lengths";
}

std::string causes(const DirectedTest& t, std::span<const Part> parts) {
  if (t.is_angle) {
    return "the machine changed between the measurements, or the part has a wrong shape";
  }
  if (t.direction != kLength) {
    return "the scale of this axis had another temperature or correction";
  }
  std::string text = causes_of_length(parts[t.part].method);
  if (parts.size() == 2) {
    const std::string other = causes_of_length(parts[1 - t.part].method);
    text += other == text ? "" : ", or " + other;
  }
  return text;
}

/// Index of the first part that is tested. With two parts one test is enough: the test of the other
/// part would be the same.
std::size_t first_tested(std::size_t parts) {
  return parts == 2 ? 1 : 0;
}

}  // namespace

std::vector<Direction> directions(const DatumCoordinates& c, const ParameterLayout& layout) {
  constexpr double kLengthShare = 0.7, kAxesShare = 0.2;  // the sum with kShareOfPairs is 1
  const Eigen::MatrixX3d of_axis = c.N.transpose() * axis_scale_columns(layout);
  std::vector<Direction> all{{kLength, false, of_axis.rowwise().sum(), kLengthShare}};
  for (const Axis a : kAllAxes) {
    all.push_back({message("scale of ", letter(a)), false,
                   of_axis.col(static_cast<Eigen::Index>(index(a))), 0.0});
  }
  for (const DatumGroup& group : c.groups) {
    if (!group.motion && group.size == 1) {
      all.push_back({group.name, true, Eigen::VectorXd::Unit(c.N.cols(), group.first), 0.0});
    }
  }
  for (std::size_t k = 1; k < all.size(); ++k) {
    all[k].share = kAxesShare / static_cast<double>(all.size() - 1);
  }
  return all;
}

std::vector<DirectedFinding> directed_findings(std::span<const Part> parts,
                                               const DatumCoordinates& c,
                                               const ParameterLayout& layout, double false_alarm) {
  constexpr double kLikely = 1e-3;  // an explanation must leave a larger probability
  const AllParts all(parts, c);
  const std::size_t first = first_tested(parts.size());
  const auto comparisons = static_cast<double>(parts.size() - first);
  std::vector<DirectedFinding> findings;
  for (std::size_t k = first; k < parts.size(); ++k) {
    for (const Direction& direction : directions(c, layout)) {
      const auto found = all.directed(k, direction.column);
      if (!found) {
        continue;
      }
      DirectedTest test{.part = k,
                        .direction = direction.name,
                        .is_angle = direction.is_angle,
                        .difference = found->d,
                        .u = found->u,
                        .dof = found->dof,
                        .p = p_of(*found),
                        .limit = direction.share * false_alarm / comparisons};
      test.contradiction = test.p < test.limit;
      test.explains =
          found->log_p_left > natural_logarithm(std::max(kLikely, kShareOfPairs * false_alarm));
      findings.push_back({std::move(test), found->log_p});
    }
  }
  return findings;
}

std::string text(const DirectedTest& t, std::span<const Part> parts) {
  const std::string others = parts.size() == 2 ? parts[1 - t.part].name : "all other parts";
  const char* unit = t.is_angle ? " urad" : " um/m";
  const std::string what = t.direction == kLength ? "lengths are"
                           : t.is_angle           ? t.direction + " is"
                                        : "lengths along " + t.direction.substr(9) + " are";
  std::ostringstream out;
  out.precision(3);
  out << parts[t.part].name << ": its " << what
      << (t.difference > 0.0 ? " larger by " : " smaller by ") << std::abs(t.difference) * kUmPerM
      << unit << " (u " << t.u * kUmPerM << unit << ", p " << t.p << ") than those of " << others
      << (t.explains ? ": " + causes(t, parts) : "; this alone does not explain their difference");
  return out.str();
}

}  // namespace abbe::calib::joint
