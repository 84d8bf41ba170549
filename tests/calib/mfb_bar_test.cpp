#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <sstream>

#include "abbe/calib/internal/mfb/identify/reversal.hpp"
#include "abbe/calib/internal/mfb/run/orientation.hpp"
#include "abbe/calib/mfb/run/points_of_interest.hpp"
#include "mfb_reference.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::mfb;
using abbe::tests::mfb::kMm;
using abbe::tests::mfb::kUm;
using abbe::tests::mfb::nominal_touches;
using abbe::tests::mfb::points_in;
using abbe::tests::mfb::reference;
using abbe::tests::mfb::touches_of;
using nlohmann::json;

constexpr double kPicometre = 1e-12;

Matrix3 columns_of(const json& columns) {
  const auto c = points_in(columns, 1.0);
  Matrix3 m;
  m << c[0], c[1], c[2];
  return m;
}

TEST(PointsOfInterest, AgreeWithTheReference) {
  const json cases = reference("extraction_reference.json").at("cases");
  EXPECT_EQ(cases.size(), 4u);
  for (const json& c : cases) {
    SCOPED_TRACE(c.at("name").get<std::string>());
    const auto found = points_of_interest(touches_of(c.at("points")),
                                          columns_of(c.at("guess_R_columns_xyz")).transpose());
    ASSERT_TRUE(found) << found.error().text;
    const auto O_m = points_in(c.at("O_raw"), kMm), O_bar_m = points_in(c.at("O_MFB"), kMm);
    ASSERT_EQ(found->O_m.size(), O_m.size());
    for (std::size_t i = 0; i < O_m.size(); ++i) {
      EXPECT_LT((found->O_m[i] - O_m[i]).norm(), kPicometre) << i;
      EXPECT_LT((found->O_bar_m[i] - O_bar_m[i]).norm(), kPicometre) << i;
    }
    EXPECT_LT((found->axes - columns_of(c.at("frame_rows_xyz"))).norm(), 1e-12);
  }
}

/// Bar axes as columns, far from those of the frame.
const Matrix3 kOblique = (Eigen::AngleAxisd(0.7, Vector3(1, 2, -1).normalized()) *
                          Eigen::AngleAxisd(0.3, Vector3::UnitX()))
                             .toRotationMatrix();

/// The same bar with its axes along kOblique.
BarTouches turned(BarTouches touches) {
  const auto turn = [](std::vector<Vector3>& feature) {
    for (Vector3& p : feature) {
      p = kOblique * p;
    }
  };
  for (std::size_t i = 0; i < touches.holes_m.size(); ++i) {
    turn(touches.holes_m[i]);
  }
  for (std::size_t j = 0; j < touches.rods_m.size(); ++j) {
    turn(touches.rods_m[j]);
    turn(touches.planes_m[j][0]);
    turn(touches.planes_m[j][1]);
  }
  return touches;
}

/// Moves touch k of a bar along `normal`; the touches are counted as in BarTouches::count().
void move_touch(BarTouches& touches, std::size_t k, const Vector3& by_m) {
  const auto in = [&](std::vector<Vector3>& feature) {
    if (k < feature.size()) {
      feature[k] += by_m;
      return true;
    }
    k -= feature.size();
    return false;
  };
  for (auto& hole : touches.holes_m) {
    if (in(hole)) return;
  }
  for (auto& rod : touches.rods_m) {
    if (in(rod)) return;
  }
  for (auto& pair : touches.planes_m) {
    if (in(pair[0]) || in(pair[1])) return;
  }
}

TEST(PointsOfInterest, DerivativesAreThoseOfDifferences) {
  constexpr double kStep_m = 1e-6;
  const BarTouches touches = turned(nominal_touches());
  const auto at = points_of_interest(touches, kOblique);
  ASSERT_TRUE(at) << at.error().text;
  ASSERT_EQ(at->normals.size(), touches.count());
  double largest = 0.0;

  for (std::size_t k = 0; k < touches.count(); k += 3) {  // every feature: each has 4 or more
    BarTouches more = touches, less = touches;
    move_touch(more, k, kStep_m * at->normals[k]);
    move_touch(less, k, -kStep_m * at->normals[k]);
    const auto plus = points_of_interest(more, kOblique),
               minus = points_of_interest(less, kOblique);
    ASSERT_TRUE(plus && minus);
    for (std::size_t i = 0; i < at->O_m.size(); ++i) {
      const auto column = static_cast<Eigen::Index>(k);
      const auto row = 3 * static_cast<Eigen::Index>(i);
      const Vector3 dO = (plus->O_m[i] - minus->O_m[i]) / (2.0 * kStep_m);
      const Vector3 dO_bar = (plus->O_bar_m[i] - minus->O_bar_m[i]) / (2.0 * kStep_m);
      EXPECT_LT((at->dO_dtouch.block<3, 1>(row, column) - dO).norm(), 1e-4) << k << " " << i;
      EXPECT_LT((at->dO_bar_dtouch.block<3, 1>(row, column) - dO_bar).norm(), 1e-4)
          << k << " " << i;
      largest = std::max(largest, dO.norm());
    }
  }
  EXPECT_GT(largest,
            0.2);  // eight touches of a hole: each moves its centre by a quarter of its way
}

/// Covariance of O_bar for independent touches with a standard deviation of 1 along the normal.
Eigen::MatrixXd unit_covariance_bar(const PointsOfInterest& points) {
  return points.dO_bar_dtouch * points.dO_bar_dtouch.transpose();
}

TEST(PointsOfInterest, CovarianceAgreesWithTheReference) {
  auto file = abbe::tests::mfb::open_reference("nominal_O_covariance_36x36_um2.csv");
  Eigen::MatrixXd expected(36, 36);
  std::string line;
  for (Eigen::Index i = 0; i < 36 && std::getline(file, line); ++i) {
    std::istringstream row(line);
    std::string value;
    for (Eigen::Index k = 0; k < 36 && std::getline(row, value, ','); ++k) {
      expected(i, k) = std::stod(value);
    }
  }

  const auto found = points_of_interest(nominal_touches(), Matrix3::Identity());
  ASSERT_TRUE(found) << found.error().text;
  const double variance_um2 = 0.125 * 0.125 + 0.25 * 0.25;  // of a touch along the normal
  const Eigen::MatrixXd covariance_um2 =
      variance_um2 * found->dO_dtouch * found->dO_dtouch.transpose();
  EXPECT_LT((covariance_um2 - expected).norm(), 1e-4 * expected.norm());

  // In the bar frame it does not depend on how the bar lies; the origin has none.
  const Eigen::MatrixXd of_bar = unit_covariance_bar(*found);
  const auto oblique = points_of_interest(turned(nominal_touches()), kOblique);
  ASSERT_TRUE(oblique) << oblique.error().text;
  EXPECT_LT((unit_covariance_bar(*oblique) - of_bar).norm(), 1e-9 * of_bar.norm());
  EXPECT_LT(of_bar.topRows<3>().norm(), 1e-9 * of_bar.norm());
  EXPECT_GT(of_bar.norm(), 0.1);
}

TEST(PointsOfInterest, RadiusOfTheTipDoesNotMoveThem) {
  BarTouches touches = nominal_touches();
  const auto without = points_of_interest(touches, Matrix3::Identity());
  ASSERT_TRUE(without);
  for (std::size_t k = 0; k < touches.count(); ++k) {
    const std::size_t first_rod = 12 * 8;  // holes are touched from inside
    move_touch(touches, k, (k < first_rod ? -1.5e-3 : 1.5e-3) * without->normals[k]);
  }
  const auto with = points_of_interest(touches, Matrix3::Identity());
  ASSERT_TRUE(with);
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_LT((with->O_bar_m[i] - without->O_bar_m[i]).norm(), 1e-9) << i;
  }
}

TEST(PointsOfInterest, BadTouchesAreRefusedByFeature) {
  const Matrix3 I = Matrix3::Identity();
  BarTouches touches = nominal_touches();
  touches.holes_m[2][5].x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(points_of_interest(touches, I).error().text.substr(0, 7), "hole 3:");

  touches = nominal_touches();
  touches.planes_m[4][1].resize(2);
  EXPECT_EQ(points_of_interest(touches, I).error().text.substr(0, 10), "plane 5 R:");

  touches = nominal_touches();
  touches.rods_m.pop_back();
  EXPECT_EQ(points_of_interest(touches, I).error().code, ErrorCode::BadInput);

  touches = nominal_touches();
  touches.holes_m[11] = touches.holes_m[0];  // the first hole instead of the last one
  EXPECT_EQ(points_of_interest(touches, I).error().text.substr(0, 7), "rod 11:");

  touches = nominal_touches();
  std::swap(touches.planes_m[6][0], touches.planes_m[6][1]);
  EXPECT_EQ(points_of_interest(touches, I).error().text.substr(0, 10), "plane 7 L:");

  Matrix3 left_handed = I, turned_about_z = I;
  left_handed(2, 2) = -1.0;
  turned_about_z(0, 0) = turned_about_z(1, 1) = -1.0;
  EXPECT_EQ(points_of_interest(nominal_touches(), left_handed).error().code, ErrorCode::BadInput);
  EXPECT_EQ(points_of_interest(nominal_touches(), turned_about_z).error().code,
            ErrorCode::BadInput);

  touches = nominal_touches();
  std::swap(touches.planes_m[0][0], touches.holes_m[0]);  // a hole in place of a plane
  EXPECT_FALSE(points_of_interest(touches, I));
  EXPECT_EQ(points_of_interest(nominal_touches(), 2.0 * I).error().code, ErrorCode::BadInput);
}

const std::vector<double> kSignature_m{0, 0, 1e-3, 0, 1e-3, 0, 0, 0, 0, 0, 0, 0};

TEST(BarOrientation, IsRecognisedInAllFourPositions) {
  const json cases = reference("orientation_reference.json");
  ASSERT_EQ(cases.size(), 4u);
  const std::map<std::string, Orientation> kNames{{"normal", Orientation::Normal},
                                                  {"flip_x", Orientation::TurnedAboutX},
                                                  {"flip_y", Orientation::TurnedAboutY},
                                                  {"flip_z", Orientation::TurnedAboutZ}};
  for (const json& c : cases) {
    const auto fit = orientation_of(points_in(c.at("O"), kMm), kSignature_m);
    ASSERT_TRUE(fit) << fit.error().text;
    const std::string expected = c.at("expect");
    EXPECT_EQ(fit->orientation, kNames.at(expected)) << expected;
    EXPECT_NEAR(fit->rms_m, c.at("residuals_mm").at(expected).get<double>() * kMm, 1e-12);
    EXPECT_GT(fit->runner_up_rms_m, 5.0 * fit->rms_m);
  }
}

TEST(BarOrientation, IsNotGuessed) {
  std::vector<Vector3> O_m(12, Vector3::Zero());
  const std::vector<double> none(12, 0.0);
  EXPECT_EQ(orientation_of(O_m, none).error().code, ErrorCode::NotApplicable);
  const auto other_bar = orientation_of(O_m, kSignature_m);  // a bar without the shifts
  ASSERT_FALSE(other_bar);
  EXPECT_EQ(other_bar.error().code, ErrorCode::NotApplicable);
  EXPECT_NE(other_bar.error().text.find("um"), std::string::npos);
  EXPECT_EQ(orientation_of(O_m, std::span(kSignature_m).first(11)).error().code,
            ErrorCode::BadInput);
}

ReversalRuns reference_runs() {
  const json r = reference("reversal_reference.json");
  ReversalRuns runs;
  for (const json& pass : r.at("M_NR")) {
    runs.normal.push_back(points_in(pass, kUm));
  }
  for (const json& pass : r.at("M_R")) {
    runs.reversed.push_back(points_in(pass, kUm));
  }
  for (const json& x : r.at("EXX_CMM")) {
    runs.machine_x_m.push_back(x.get<double>() * kUm);
  }
  return runs;
}

TEST(Reversal, SeparatesBarAndMachine) {
  const auto bar = calibrate_by_reversal(reference_runs());
  ASSERT_TRUE(bar) << bar.error().text;
  const json r = reference("reversal_reference.json");
  const auto expected_m = points_in(r.at("E_MFB"), kUm), truth_m = points_in(r.at("truth"), kUm);
  ASSERT_EQ(bar->error_m.size(), expected_m.size());
  EXPECT_EQ(bar->degrees_of_freedom, 4u);
  int beyond = 0, count = 0;

  for (std::size_t i = 0; i < expected_m.size(); ++i) {
    EXPECT_LT((bar->error_m[i] - expected_m[i]).norm(), 2e-12) << i;  // 1e-6 um in the file
    for (Eigen::Index k = 1; k < 3 && i > 0 && i + 1 < expected_m.size(); ++k) {
      const double off = (bar->error_m[i](k) - truth_m[i](k)) / bar->u_m[i](k);
      constexpr double kCoverage = 2.776;  // Student's t, 95 %, 4 degrees of freedom
      beyond += std::abs(off) > kCoverage ? 1 : 0;
      ++count;
    }
  }

  EXPECT_EQ(count, 20);
  EXPECT_LE(beyond, 4);  // 20 independent values: more than 4 with a probability of 0.3 %
}

TEST(Reversal, RefusesRunsThatDoNotBelongTogether) {
  ReversalRuns runs = reference_runs();
  runs.reversed.pop_back();
  EXPECT_EQ(calibrate_by_reversal(runs).error().code, ErrorCode::BadInput);
  runs = reference_runs();
  runs.normal.resize(1);
  runs.reversed.resize(1);
  EXPECT_EQ(calibrate_by_reversal(runs).error().code, ErrorCode::TooFewObservations);
  runs = reference_runs();
  runs.normal[1].pop_back();
  EXPECT_NE(calibrate_by_reversal(runs).error().text.find("normal pass 2"), std::string::npos);
  runs = reference_runs();
  runs.reversed[0][4].z() = std::numeric_limits<double>::infinity();
  EXPECT_NE(calibrate_by_reversal(runs).error().text.find("reversed pass 1, hole 5"),
            std::string::npos);
  runs = reference_runs();
  runs.u_machine_x_m.assign(12, -1e-7);
  EXPECT_EQ(calibrate_by_reversal(runs).error().code, ErrorCode::BadInput);
  runs.u_machine_x_m[3] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_NE(calibrate_by_reversal(runs).error().text.find("hole 1"), std::string::npos);
  EXPECT_EQ(calibrate_by_reversal({{{}, {}}, {{}, {}}, {}, {}}).error().code, ErrorCode::BadInput);
}

TEST(Reversal, UncertaintyOfThePositioningContainsThatOfTheMachine) {
  ReversalRuns runs = reference_runs();
  runs.u_machine_x_m.assign(12, 0.15e-6);
  const auto bar = calibrate_by_reversal(runs);
  ASSERT_TRUE(bar) << bar.error().text;
  for (std::size_t i = 0; i < 12; ++i) {
    EXPECT_NEAR(bar->u_m[i].x(), std::hypot(bar->u_mean_m[i].x(), 0.15e-6), 1e-15);
    EXPECT_EQ(bar->u_m[i].y(), bar->u_mean_m[i].y());
  }
}

}  // namespace
