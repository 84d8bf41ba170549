#include "abbe/calib/geometry/usual_mistakes.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "abbe/calib/internal/base/message.hpp"

namespace abbe::calib {
namespace {

Matrix3 reversed(std::span<const Eigen::Index> axes) {
  Matrix3 M = Matrix3::Identity();
  for (const Eigen::Index a : axes) {
    M(a, a) = -1.0;
  }
  return M;
}

/// Permutation matrix M: coordinate i of M * p is coordinate from[i] of p.
Matrix3 reordered(const std::array<Eigen::Index, 3>& from) {
  Matrix3 M = Matrix3::Zero();
  for (Eigen::Index i = 0; i < 3; ++i) {
    M(i, from[static_cast<std::size_t>(i)]) = 1.0;
  }
  return M;
}

bool is_inside(double q_m, const AxisNodes& axis, double tolerance_m) {
  return q_m >= axis.nodes_m.front() - tolerance_m && q_m <= axis.nodes_m.back() + tolerance_m;
}

bool all_inside(std::span<const Vector3> points_m, const Matrix3& M, const MachineNodes& travel) {
  return std::all_of(points_m.begin(), points_m.end(), [&](const Vector3& p) {
    const Vector3 q = M * p;
    return outside_travel(std::span(&q, 1), travel).empty();
  });
}

double travel_m(const AxisNodes& axis) {
  return axis.nodes_m.back() - axis.nodes_m.front();
}

/// True if a point is farther outside the travel than 5 % of the shortest travel. A wrong sign,
/// order or unit moves coordinates by such a distance; a coordinate slightly beyond an end has
/// another cause.
bool is_far_outside(std::span<const Vector3> points_m, const MachineNodes& travel) {
  constexpr double kFar = 0.05;
  double shortest_m = travel_m(travel[0]);
  for (const AxisNodes& axis : travel) {
    shortest_m = std::min(shortest_m, travel_m(axis));
  }
  return !outside_travel(points_m, travel, kFar * shortest_m).empty();
}

/// True if the scaled points extend over at least half of the travel of an axis. Without this
/// condition every factor below 1 would look right: small coordinates are inside the travel of most
/// machines.
bool fills(std::span<const Vector3> points_m, double factor, const MachineNodes& travel) {
  constexpr double kPart = 0.5;
  for (std::size_t a = 0; a < 3; ++a) {
    const auto [low, high] = std::minmax_element(
        points_m.begin(), points_m.end(), [a](const Vector3& p, const Vector3& q) {
          return p(static_cast<Eigen::Index>(a)) < q(static_cast<Eigen::Index>(a));
        });
    const auto k = static_cast<Eigen::Index>(a);
    if (factor * ((*high)(k) - (*low)(k)) >= kPart * travel_m(travel[a])) {
      return true;
    }
  }
  return false;
}

/// Units that may be wrong: those of the points, and those of the travel. Points in um instead of
/// mm and a travel in m instead of mm have the same factor; the size of the travel decides which is
/// named.
std::vector<UnitMistake> units_of_points_or_travel(const MachineNodes& travel) {
  constexpr double kShortest_m = 20e-3, kMicrometre = 1e-3;
  std::vector<UnitMistake> all = unit_mistakes();
  const bool is_short = std::all_of(travel.begin(), travel.end(), [](const AxisNodes& axis) {
    return travel_m(axis) < kShortest_m;
  });
  if (is_short) {
    std::erase_if(all, [](const UnitMistake& m) { return m.factor == kMicrometre; });
    all.push_back({"the travel of the axes in m instead of mm", 1e-3});
  }
  all.push_back({"the travel of the axes in inches instead of mm", 1.0 / 25.4});
  return all;
}

double azimuth(const Vector3& p) {
  return std::atan2(p.y(), p.x());
}

double elevation(const Vector3& p) {
  return std::atan2(p.z(), std::hypot(p.x(), p.y()));
}

}  // namespace

const std::vector<AxisMistake>& axis_mistakes() {
  static const std::vector<AxisMistake> all{
      {"X reversed", reversed(std::array<Eigen::Index, 1>{0})},
      {"Y reversed", reversed(std::array<Eigen::Index, 1>{1})},
      {"Z reversed", reversed(std::array<Eigen::Index, 1>{2})},
      {"X and Y swapped", reordered({1, 0, 2})},
      {"X and Z swapped", reordered({2, 1, 0})},
      {"Y and Z swapped", reordered({0, 2, 1})},
      {"X and Y reversed", reversed(std::array<Eigen::Index, 2>{0, 1})},
      {"X and Z reversed", reversed(std::array<Eigen::Index, 2>{0, 2})},
      {"Y and Z reversed", reversed(std::array<Eigen::Index, 2>{1, 2})},
      {"the axes in the order Y, Z, X", reordered({2, 0, 1})},
      {"the axes in the order Z, X, Y", reordered({1, 2, 0})}};

  return all;
}

const std::vector<UnitMistake>& unit_mistakes() {
  static const std::vector<UnitMistake> all{{"lengths in m instead of mm", 1e3},
                                            {"lengths in um instead of mm", 1e-3},
                                            {"lengths in inches instead of mm", 25.4}};
  return all;
}

const std::vector<AngleMistake>& angle_mistakes() {
  static const std::vector<AngleMistake> all{
      {"zenith angles instead of elevations",
       [](const Vector3& p) {
         return from_spherical(p.norm(), azimuth(p), 0.5 * std::numbers::pi - elevation(p));
       }},
      {"azimuth and elevation swapped",
       [](const Vector3& p) { return from_spherical(p.norm(), elevation(p), azimuth(p)); }}};
  return all;
}

std::vector<TriedCorrection> far_better(double left_as_given, std::vector<TriedCorrection> tried) {
  std::stable_sort(tried.begin(), tried.end(), [](const auto& a, const auto& b) {
    return a.left < b.left || (!std::isnan(a.left) && std::isnan(b.left));
  });
  const double most =
      tried.empty() ? 0.0
                    : std::min(kFarBetter * left_as_given, kAsGoodAsBest * tried.front().left);
  std::erase_if(
      tried, [&](const TriedCorrection& t) { return !std::isfinite(t.left) || !(t.left <= most); });
  return tried;
}

std::vector<OutsideTravel> outside_travel(std::span<const Vector3> points_m,
                                          const MachineNodes& travel, double tolerance_m) {
  std::vector<OutsideTravel> found;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    for (std::size_t a = 0; a < 3; ++a) {
      if (!is_inside(points_m[i][static_cast<Eigen::Index>(a)], travel[a], tolerance_m)) {
        found.push_back({i, a});
      }
    }
  }
  return found;
}

std::string corrections_inside_travel(std::span<const Vector3> points_m,
                                      const MachineNodes& travel) {
  if (!is_far_outside(points_m, travel)) {
    return "";
  }
  std::vector<std::string> texts;
  for (const AxisMistake& mistake : axis_mistakes()) {
    if (all_inside(points_m, mistake.M, travel)) {
      texts.push_back(mistake.text);
    }
  }

  const bool explained = !texts.empty();
  for (const UnitMistake& mistake : units_of_points_or_travel(travel)) {
    if (!explained && all_inside(points_m, mistake.factor * Matrix3::Identity(), travel) &&
        fills(points_m, mistake.factor, travel)) {
      texts.push_back(mistake.text);
    }
  }

  return texts.empty() ? "" : "; all are inside with " + or_list(texts);
}

std::string or_list(std::span<const std::string> texts) {
  std::string out;
  for (const std::string& text : texts) {
    out += message(out.empty() ? "" : ", or with ", text);
  }
  return out;
}

}  // namespace abbe::calib
