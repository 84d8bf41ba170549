#include "abbe/calib/mfb/run/features.hpp"

#include "abbe/calib/internal/base/message.hpp"
#include "abbe/result/try.hpp"

namespace abbe::calib::mfb {
namespace {

constexpr std::size_t kFewestHoles = 3;

Result<void> check_numbers(const BarTouches& touches, const Matrix3& axes) {
  const std::size_t holes = touches.holes_m.size();
  if (holes < kFewestHoles || touches.rods_m.size() + 1 != holes ||
      touches.planes_m.size() + 1 != holes) {
    return failure(
        ErrorCode::BadInput,
        message("bar: ", holes, " holes, ", touches.rods_m.size(), " rods and ",
                touches.planes_m.size(),
                " pairs of planes; N holes have N - 1 rods and pairs, N at least ", kFewestHoles));
  }
  constexpr double kOrthonormal = 1e-3;
  if (!((axes.transpose() * axes - Matrix3::Identity()).norm() < kOrthonormal) ||
      !(axes.determinant() > 0.0)) {
    return failure(ErrorCode::BadInput,
                   "bar: the approximate axes of the bar are not orthonormal and right-handed");
  }
  return {};
}

template <class Fit>
Result<void> keep(std::vector<Fit>& features, Result<Fit> fitted, const std::string& name) {
  if (!fitted) {
    return failure(fitted.error().code, message(name, ": ", fitted.error().text));
  }
  features.push_back(*std::move(fitted));
  return {};
}

Result<void> fit_cylinders(std::vector<fit::Cylinder>& features,
                           const std::vector<std::vector<Vector3>>& touched_m, const Vector3& near,
                           std::string (*name)(std::size_t)) {
  for (std::size_t i = 0; i < touched_m.size(); ++i) {
    if (Result<void> kept = keep(features, fit::fit_cylinder(touched_m[i], near), name(i)); !kept) {
      return kept;
    }
  }
  return {};
}

Result<void> fit_planes(BarFeatures& features, const BarTouches& touches, const Vector3& left) {
  for (std::size_t j = 0; j < touches.planes_m.size(); ++j) {
    std::vector<fit::Plane> pair;
    for (const Side side : {Side::Left, Side::Right}) {
      const Vector3 outward = side == Side::Left ? left : Vector3(-left);
      Result<void> kept =
          keep(pair, fit::fit_plane(touches.planes_m[j][static_cast<std::size_t>(side)], outward),
               plane_name(j, side));
      if (!kept) {
        return kept;
      }
    }
    features.planes.push_back({pair[0], pair[1]});
  }
  return {};
}

/// Checks that rod j lies between hole j and hole j + 1.
Result<void> check_order(const BarFeatures& f, const Vector3& x) {
  for (std::size_t j = 0; j < f.rods.size(); ++j) {
    const double before = x.dot(f.rods[j].point - f.holes[j].point);
    const double after = x.dot(f.holes[j + 1].point - f.rods[j].point);
    if (!(before > 0.0) || !(after > 0.0)) {
      return failure(
          ErrorCode::BadInput,
          message(rod_name(j), ": is not between ", hole_name(j), " and ", hole_name(j + 1),
                  " along x of the bar (", 1e3 * before, " mm and ", 1e3 * after,
                  " mm): touches of another feature, or the bar is turned"));
    }
  }
  return {};
}

/// Checks that the left plane lies at +y of its rod and the right one at -y.
Result<void> check_sides(const BarFeatures& f, const Vector3& y) {
  for (std::size_t j = 0; j < f.planes.size(); ++j) {
    for (const Side side : {Side::Left, Side::Right}) {
      const Vector3& plane = f.planes[j][static_cast<std::size_t>(side)].point;
      const Vector3& other = f.planes[j][side == Side::Left ? 1 : 0].point;
      const double away = (side == Side::Left ? 1.0 : -1.0) * y.dot(plane - other);
      if (!(away > 0.0)) {
        return failure(ErrorCode::BadInput,
                       message(plane_name(j, side), ": lies on the other side of ", rod_name(j),
                               ": touches of another plane, or the bar is turned"));
      }
    }
  }
  return {};
}

}  // namespace

std::size_t BarTouches::count() const {
  std::size_t sum = 0;
  for (const auto& hole : holes_m) {
    sum += hole.size();
  }
  for (const auto& rod : rods_m) {
    sum += rod.size();
  }
  for (const auto& pair : planes_m) {
    sum += pair[0].size() + pair[1].size();
  }
  return sum;
}

std::string hole_name(std::size_t index) {
  return message("hole ", index + 1);
}

std::string rod_name(std::size_t index) {
  return message("rod ", index + 1);
}

std::string plane_name(std::size_t index, Side side) {
  return message("plane ", index + 1, side == Side::Left ? " L" : " R");
}

Result<BarFeatures> fit_features(const BarTouches& touches, const Matrix3& axes) {
  BarFeatures features;
  Result<void> done =
      check_numbers(touches, axes)
          .and_then([&] {
            return fit_cylinders(features.holes, touches.holes_m, axes.col(2), hole_name);
          })
          .and_then(
              [&] { return fit_cylinders(features.rods, touches.rods_m, axes.col(1), rod_name); })
          .and_then([&] { return fit_planes(features, touches, axes.col(1)); })
          .and_then([&] { return check_order(features, axes.col(0)); })
          .and_then([&] { return check_sides(features, axes.col(1)); });
  ABBE_TRY(done);
  return features;
}

}  // namespace abbe::calib::mfb
