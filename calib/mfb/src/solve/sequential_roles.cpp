#include "solve/sequential_roles.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

/// Places and tools that differ by less than kTogether_m are the same. A difference that is used to
/// determine an angle must be larger than kApart_m.
constexpr double kTogether_m = 10e-3, kApart_m = 50e-3;

std::vector<std::size_t> axes_along(const Vector3& bar_x) {
  constexpr double kAlong = 0.3;  // direction cosine; 17 degrees
  std::vector<std::size_t> along;
  for (std::size_t a = 0; a < 3; ++a) {
    if (std::abs(bar_x(static_cast<Eigen::Index>(a))) > kAlong) {
      along.push_back(a);
    }
  }
  return along;
}

Vector3 middle_of(const Profile& p) {
  return 0.5 * (p.tip_m.front() + p.tip_m.back());
}

/// The pair of profiles with the largest difference of the place (or tool, if `of_tool`) along one
/// axis, among profiles that are otherwise the same.
std::optional<ProfilePair> widest_pair(const std::vector<Profile>& all,
                                       const std::vector<std::size_t>& among, std::size_t axis,
                                       bool of_tool) {
  const auto k = static_cast<Eigen::Index>(axis);
  std::optional<ProfilePair> widest;
  for (const std::size_t i : among) {
    for (const std::size_t j : among) {
      Vector3 place_m = middle_of(all[j]) - middle_of(all[i]);
      Vector3 tool_m = -(all[j].tool_m - all[i].tool_m);
      Vector3& value_m = of_tool ? tool_m : place_m;
      const double difference_m = value_m(k);
      value_m(k) = 0.0;
      const bool alike = place_m.norm() < kTogether_m && tool_m.norm() < kTogether_m;
      if (alike && difference_m > kApart_m && (!widest || difference_m > widest->difference_m)) {
        widest = {i, j, difference_m};
      }
    }
  }
  return widest;
}

Result<void> set_pair(ProfilePair& pair, const std::vector<Profile>& all,
                      const std::vector<std::size_t>& among, std::size_t axis, bool of_tool,
                      const char* role) {
  const std::optional<ProfilePair> found = widest_pair(all, among, axis, of_tool);
  if (!found) {
    return failure(ErrorCode::NotApplicable,
                   message("sequential estimator: no measurements ", role));
  }
  pair = *found;
  return {};
}

/// Finds two bars in a plane of two axes: an ascending and a descending one.
Result<void> set_diagonals(std::array<std::size_t, 2>& pair, const std::vector<Profile>& all,
                           const std::vector<std::size_t>& plane, const char* name) {
  std::array<bool, 2> found{};
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].along == plane) {
      const Vector3 x = all[i].axes.col(0);
      const bool descending =
          x(static_cast<Eigen::Index>(plane[0])) * x(static_cast<Eigen::Index>(plane[1])) < 0.0;
      pair[descending ? 1 : 0] = i;
      found[descending ? 1 : 0] = true;
    }
  }
  if (found[0] && found[1]) {
    return {};
  }
  return failure(ErrorCode::NotApplicable,
                 message("sequential estimator: no two diagonals in the plane ", name));
}

}  // namespace

std::vector<Profile> profiles_of(const Observations& o) {
  std::vector<Profile> all;
  std::vector<std::pair<std::size_t, std::size_t>> known;
  for (std::size_t i = 0; i < o.passes.size(); ++i) {
    const PassObservation& pass = o.passes[i];
    const std::pair key(pass.position, pass.tool);
    const auto at = std::find(known.begin(), known.end(), key);
    if (at != known.end()) {
      all[static_cast<std::size_t>(at - known.begin())].passes.push_back(i);
      continue;
    }
    known.push_back(key);

    Profile& p = all.emplace_back();
    const BarPose& pose = o.positions[pass.position].pose;
    p.passes = {i};
    p.axes = pose.axes;
    p.tool_m = o.plan.measurements[pass.measurement].tool_offset_m;
    p.along = axes_along(pose.axes.col(0));
    p.hole.resize(o.bar.O_m.size());
    std::iota(p.hole.begin(), p.hole.end(), std::size_t{0});
    if (pose.axes(static_cast<Eigen::Index>(p.along.front()), 0) < 0.0) {
      std::reverse(p.hole.begin(), p.hole.end());
    }
    for (const std::size_t hole : p.hole) {
      p.tip_m.emplace_back(pose.origin_m + pose.axes * o.bar.O_m[hole]);
      p.on_axis_m.emplace_back(pose.origin_m + o.bar.pattern.hole_x_m[hole] * pose.axes.col(0));
    }
  }
  return all;
}

Result<SequentialRoles> roles_of(const std::vector<Profile>& all) {
  constexpr std::size_t X = 0, Y = 1, Z = 2;
  SequentialRoles roles;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].along.size() == 1) {
      roles.along[all[i].along.front()].push_back(i);
    }
  }

  const auto &along_x = roles.along[X], &along_y = roles.along[Y], &along_z = roles.along[Z];
  Result<void> found =
      set_pair(roles.x_at_two_z, all, along_x, Z, false, "along X at two Z")
          .and_then([&] {
            return set_pair(roles.x_at_two_y, all, along_x, Y, false, "along X at two Y");
          })
          .and_then([&] {
            return set_pair(roles.y_at_two_z, all, along_y, Z, false, "along Y at two Z");
          })
          .and_then([&] {
            return set_pair(roles.y_with_two_tools_x, all, along_y, X, true,
                            "along Y with two tools that differ along X");
          })
          .and_then([&] {
            return set_pair(roles.z_with_two_tools_x, all, along_z, X, true,
                            "along Z with two tools that differ along X");
          })
          .and_then([&] {
            return set_pair(roles.z_with_two_tools_y, all, along_z, Y, true,
                            "along Z with two tools that differ along Y");
          })
          .and_then([&] {
            return set_diagonals(roles.diagonals[0], all, {X, Y}, "XY");
          })
          .and_then([&] {
            return set_diagonals(roles.diagonals[1], all, {X, Z}, "XZ");
          })
          .and_then([&] {
            return set_diagonals(roles.diagonals[2], all, {Y, Z}, "YZ");
          });
  ABBE_TRY(found);
  return roles;
}

}  // namespace abbe::calib::mfb
