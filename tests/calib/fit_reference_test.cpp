// Line, plane, circle, sphere and cylinder against least-squares solutions with 30 digits
// (tests/data/mfb/geomfit_reference.json), and what each fit refuses (degenerate_reference.json).
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "abbe/calib/fit/cylinder.hpp"
#include "abbe/calib/fit/plane.hpp"
#include "abbe/calib/fit/sphere.hpp"
#include "abbe/calib/internal/fit/circle.hpp"
#include "abbe/calib/internal/fit/line.hpp"
#include "mfb_reference.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::fit;
using nlohmann::json;

double number_of(const json& text) {
  return text.is_string() ? std::stod(text.get<std::string>()) : text.get<double>();
}

template <int Dimensions>
Eigen::Matrix<double, Dimensions, 1> vector_of(const json& values) {
  Eigen::Matrix<double, Dimensions, 1> v;
  for (int i = 0; i < Dimensions; ++i) {
    const json& value = values.at(static_cast<std::size_t>(i));
    v(i) = value.is_null() ? std::numeric_limits<double>::quiet_NaN() : number_of(value);
  }
  return v;
}

template <int Dimensions>
std::vector<Eigen::Matrix<double, Dimensions, 1>> points_of(const json& set) {
  std::vector<Eigen::Matrix<double, Dimensions, 1>> points;
  for (const json& p : set.at("points")) {
    points.push_back(vector_of<Dimensions>(p));
  }
  return points;
}

/// Compares one fit with its reference solution.
class Compared {
 public:
  explicit Compared(const json& set)
      : ref_(set.at("ref")), length_(set.at("tol_len_mm")), angle_(set.at("tol_dir_rad")) {}

  template <class Vector>
  void place(const char* key, const Vector& found) const {
    EXPECT_LE((found - vector_of<Vector::RowsAtCompileTime>(ref_.at(key))).norm(), length_) << key;
  }
  void direction(const char* key, const Vector3& found) const {
    EXPECT_LE((found - vector_of<3>(ref_.at(key))).norm(), angle_) << key;
  }
  void radius(double found) const {
    EXPECT_LE(std::abs(found - number_of(ref_.at("radius"))), length_);
  }

 private:
  const json& ref_;
  double length_, angle_;
};

/// `start`: whether the fit of a cylinder is given the true direction.
void compare_with_reference(const json& set, bool start) {
  const Compared compared(set);
  const std::string kind = set.at("kind");
  if (kind == "circle") {
    const auto circle = fit_circle(points_of<2>(set));
    ASSERT_TRUE(circle) << circle.error().text;
    compared.place("center", circle->centre);
    compared.radius(circle->radius);
    return;
  }

  const std::vector<Vector3> points = points_of<3>(set);
  if (kind == "line") {
    const auto line = fit_line(points, vector_of<3>(set.at("ref").at("dir")));
    ASSERT_TRUE(line) << line.error().text;
    compared.place("point", line->point);
    compared.direction("dir", line->direction);
  } else if (kind == "plane") {
    const auto plane = fit_plane(points, vector_of<3>(set.at("ref").at("normal")));
    ASSERT_TRUE(plane) << plane.error().text;
    compared.place("point", plane->point);
    compared.direction("normal", plane->normal);
  } else if (kind == "sphere") {
    const auto sphere = fit_sphere(points);
    ASSERT_TRUE(sphere) << sphere.error().text;
    compared.place("center", sphere->centre);
    compared.radius(sphere->radius);
  } else {
    ASSERT_EQ(kind, "cylinder");
    const auto near = start ? std::optional<Vector3>(vector_of<3>(set.at("ref").at("dir")))
                            : std::optional<Vector3>();
    const auto cylinder = fit_cylinder(points, near);
    ASSERT_TRUE(cylinder) << cylinder.error().text;
    compared.place("point", cylinder->point);
    compared.direction("dir", cylinder->direction);
    compared.radius(cylinder->radius);
  }
}

TEST(FitReference, AllSetsAgreeWithinTheirTolerances) {
  const json sets = abbe::tests::mfb::reference("geomfit_reference.json").at("sets");
  EXPECT_EQ(sets.size(), 101u);
  for (const json& set : sets) {
    SCOPED_TRACE(set.at("name").get<std::string>());
    compare_with_reference(set, true);
  }
}

TEST(FitReference, CylindersAreFoundWithoutAnApproximateDirection) {
  const json sets = abbe::tests::mfb::reference("geomfit_reference.json").at("sets");
  std::size_t cylinders = 0;
  for (const json& set : sets) {
    if (set.at("kind") == "cylinder") {
      SCOPED_TRACE(set.at("name").get<std::string>());
      compare_with_reference(set, false);
      ++cylinders;
    }
  }
  EXPECT_EQ(cylinders, 25u);
}

/// ErrorCode for a status of the reference; nullopt: the fit succeeds.
std::optional<ErrorCode> refused_as(const std::string& status) {
  if (status == "NOT_ENOUGH_POINTS") {
    return ErrorCode::TooFewObservations;
  }
  if (status == "ALIGNED" || status == "COPLANAR") {
    return ErrorCode::DegenerateGeometry;
  }
  return status == "NOT_FINITE" ? std::optional(ErrorCode::NotFinite) : std::nullopt;
}

template <class Fit>
void expect_status(const json& set, const Fit& fit) {
  SCOPED_TRACE(set.at("name").get<std::string>());
  const std::string status = set.at("status");
  if (const auto code = refused_as(status)) {
    ASSERT_FALSE(fit);
    EXPECT_EQ(fit.error().code, *code) << fit.error().text;
  } else {
    ASSERT_TRUE(fit) << fit.error().text;
    EXPECT_EQ(fit->residuals.degrees_of_freedom == 0, status.starts_with("EXACT"));
  }
}

TEST(FitReference, DegeneratePointsAreRefusedByName) {
  const json sets = abbe::tests::mfb::reference("degenerate_reference.json");
  for (const json& set : sets.at("cylinder")) {
    if (set.at("status") == "EXACT_5") {  // four of the five are in one section: rank 4 of 5
      EXPECT_EQ(fit_cylinder(points_of<3>(set), Vector3(Vector3::UnitZ())).error().code,
                ErrorCode::DegenerateGeometry);
      continue;
    }
    expect_status(set, fit_cylinder(points_of<3>(set), Vector3(Vector3::UnitZ())));
  }
  for (const json& set : sets.at("plane")) {
    expect_status(set, fit_plane(points_of<3>(set), {0.1, 0.2, 0.9}));
  }
  EXPECT_GE(sets.at("cylinder").size() + sets.at("plane").size(), 10u);
}

}  // namespace
