#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <random>

#include "abbe/calib/geometry/equivalent_model.hpp"
#include "abbe/calib/geometry/scaled_design.hpp"
#include "evemu_reference.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::evemu;
using namespace abbe::tests::evemu;

const std::vector<std::string> kSixOrders{"XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"};

KinematicChain chain_of(const std::string& order) {
  return *KinematicChain::parse("[w b " + order.substr(0, 1) + " " + order.substr(1, 1) + " " +
                                order.substr(2, 1) + " t]");
}

EquivalentModel model_of(const std::string& order, int np = 3) {
  return *EquivalentModel::of(chain_of(order), np);
}

/// Points in a volume of the size of the reference machine, mm.
std::vector<Vector3> random_points_mm(int count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> x(-90, 600), y(-60, 370), z(0, 80);
  std::vector<Vector3> points;
  for (int i = 0; i < count; ++i) {
    points.emplace_back(x(random), y(random), z(random));
  }
  return points;
}

Eigen::MatrixXd stacked_A(const ErrorPolynomials& A, std::span<const Vector3> points_mm) {
  Eigen::MatrixXd all(3 * std::ssize(points_mm), std::ssize(A.names()));
  for (std::size_t i = 0; i < points_mm.size(); ++i) {
    all.middleRows<3>(static_cast<Eigen::Index>(3 * i)) = A.A(points_mm[i]);
  }
  return all;
}

Eigen::Index rank_of(const Eigen::MatrixXd& M, double threshold = 1e-12) {
  Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(M);
  return qr.setThreshold(threshold).rank();
}

/// Columns scaled to unit length before the rank is determined.
Eigen::Index scaled_rank(Eigen::MatrixXd M) {
  for (Eigen::Index j = 0; j < M.cols(); ++j) {
    const double norm = M.col(j).norm();
    if (norm > 0) {
      M.col(j) /= norm;
    }
  }
  return rank_of(M, 1e-10);
}

TEST(EquivalentModel, HasTheRowsAndNamesOfTheReference) {
  const auto reference = reference_json("W_ZXY.json");
  const EquivalentModel model = model_of("ZXY");
  EXPECT_THAT(std::vector<std::string>(model.names().begin(), model.names().end()),
              testing::ElementsAreArray(reference["beta_names"].get<std::vector<std::string>>()));
  const auto A = *ErrorPolynomials::of(chain_of("ZXY"), 3);
  EXPECT_THAT(std::vector<std::string>(A.names().begin(), A.names().end()),
              testing::ElementsAreArray(reference["K_names"].get<std::vector<std::string>>()));
  for (std::size_t i = 0; i < model.size(); ++i) {
    EXPECT_EQ(model.W().row(static_cast<Eigen::Index>(i)).transpose(),
              reference_vector(reference["W"][i]))
        << model.names()[i];
  }
}

TEST(EquivalentModel, CombinesLikeTermsOfEveryChainLikeTheReference) {
  const auto reference = reference_json("W_all_chains.json");
  for (const std::string& order : kSixOrders) {
    const EquivalentModel model = model_of(order);
    const auto A = *ErrorPolynomials::of(chain_of(order), 3);
    std::vector<std::string> single{};
    std::copy_if(model.names().begin(), model.names().end(), std::back_inserter(single),
                 [](const std::string& n) { return n.rfind("k_eq", 0) != 0; });
    EXPECT_EQ(single, reference[order]["single_names"].get<std::vector<std::string>>()) << order;
    ASSERT_EQ(model.size(), reference[order]["rank"].get<std::size_t>());
    // Every row of the reference is a row of W, except for the sign.
    for (const auto& row : reference[order]["rows"]) {
      Eigen::RowVectorXd w = Eigen::RowVectorXd::Zero(model.W().cols());
      for (const auto& [name, value] : row["coefs"].items()) {
        const auto at = std::find(A.names().begin(), A.names().end(), name);
        w(at - A.names().begin()) = value.get<double>();
      }
      const auto found = (model.W().rowwise() - w).rowwise().norm().minCoeff() == 0.0 ||
                         (model.W().rowwise() + w).rowwise().norm().minCoeff() == 0.0;
      EXPECT_TRUE(found) << order << " " << row.dump();
    }
  }
}

TEST(EquivalentModel, HasFourteenTimesOrderPlusThreeRowsForEveryChain) {
  for (const std::string& order : kSixOrders) {
    for (int np = 1; np <= 5; ++np) {
      const EquivalentModel model = model_of(order, np);
      EXPECT_EQ(model.size(), static_cast<std::size_t>(14 * np + 3)) << order << " np " << np;
      EXPECT_EQ(rank_of(model.W()), 14 * np + 3) << order << " np " << np;
    }
  }
}

TEST(EquivalentModel, ExplainsEverythingTheFullModelCanShow) {
  const std::vector<Vector3> points = random_points_mm(40);
  for (const std::string& order : kSixOrders) {
    const auto A = *ErrorPolynomials::of(chain_of(order), 3);
    const EquivalentModel model = model_of(order);
    for (const Vector3& p : points) {
      EXPECT_LE((A.A(p) - model.X(p) * model.W()).norm(), 1e-13 * A.A(p).norm());
    }
    EXPECT_EQ(scaled_rank(stacked_A(A, points)), 45) << order;
  }
}

TEST(EquivalentModel, IsThePseudoInverseProduct) {
  const auto A = *ErrorPolynomials::of(chain_of("ZXY"), 3);
  const EquivalentModel model = model_of("ZXY");
  const Eigen::MatrixXd pinv = model.W().completeOrthogonalDecomposition().pseudoInverse();
  for (const Vector3& p : random_points_mm(10)) {
    // Scaled to the size of the columns, so that rounding of the largest monomial does not hide
    // errors in the smallest.
    const Eigen::Matrix3Xd X = model.X(p);
    EXPECT_LE((A.A(p) * pinv - X).norm(), 1e-12 * X.norm());
  }
}

TEST(EquivalentModel, PredictsWhatTheFullModelPredicts) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const auto A = *ErrorPolynomials::of(chain_of("ZXY"), 3);
  const EquivalentModel model = model_of("ZXY");
  Eigen::VectorXd K(model.W().cols());
  for (double& k : K) {
    k = normal(random);
  }
  for (const Vector3& p : random_points_mm(10)) {
    const Vector3 E = A.A(p) * K;
    EXPECT_LE((model.X(p) * (model.W() * K) - E).norm(), 1e-13 * A.A(p).norm() * K.norm());
  }
}

TEST(EquivalentModel, GivesTheRegressorsOfTheReference) {
  const EquivalentModel model = model_of("ZXY");
  const auto X = reference_cells("X216.csv");
  const auto points = reference_cells("points72.csv");
  ASSERT_EQ(X.size(), 3 * points.size());

  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Matrix3Xd ours =
        model.X({std::stod(points[i][2]), std::stod(points[i][3]), std::stod(points[i][4])});
    for (Eigen::Index c = 0; c < 3; ++c) {
      for (Eigen::Index j = 0; j < 45; ++j) {
        const double theirs =
            std::stod(X[3 * i + static_cast<std::size_t>(c)][static_cast<std::size_t>(j)]);
        // The reference was computed with a numeric pseudo-inverse and has rounding errors instead
        // of zeros.
        EXPECT_NEAR(ours(c, j), theirs, 1e-12 * ours.row(c).norm()) << i << " " << model.names()[j];
      }
    }
  }
}

TEST(EquivalentModel, KeepsItsSpanForAnyStylus) {
  const Vector3 stylus(12, -7, -80);
  const auto A = *ErrorPolynomials::of(chain_of("ZXY"), 3, stylus);
  const EquivalentModel model = *EquivalentModel::of(chain_of("ZXY"), 3, stylus);
  const EquivalentModel plain = model_of("ZXY");
  EXPECT_TRUE(std::equal(model.names().begin(), model.names().end(), plain.names().begin()));
  for (const Vector3& p : random_points_mm(10)) {
    EXPECT_LE((A.A(p) - model.X(p) * model.W()).norm(), 1e-13 * A.A(p).norm());
    EXPECT_EQ(model.X(p), plain.X(p));
  }
}

TEST(EquivalentModel, RefusesOrdersItDoesNotKnow) {
  EXPECT_EQ(EquivalentModel::of(chain_of("XYZ"), 0).error().code, ErrorCode::BadInput);
  EXPECT_EQ(EquivalentModel::of(chain_of("XYZ"), 6).error().code, ErrorCode::BadInput);
}

ScaledDesign scaled(const std::string& order, int np) {
  return *ScaledDesign::of(chain_of(order), np, {{0.25, 0.15, 0.04}, {0.35, 0.2, 0.04}});
}

TEST(ScaledDesign, SpansTheEquivalentModel) {
  for (const std::string& order : kSixOrders) {
    for (int np = 1; np <= 5; ++np) {
      const ScaledDesign design = scaled(order, np);
      const Eigen::MatrixXd M = design.named_from_scaled();
      // Rows have units from mm to rad mm^-5.
      EXPECT_EQ(rank_of(M.rowwise().normalized()), M.cols()) << order << " " << np;
      for (const Vector3& p_mm : random_points_mm(10)) {
        const Eigen::Matrix3Xd B = design.B(p_mm / 1000), X = design.equivalent().X(p_mm);
        // Monomials of order 5 cancel to 1e-12 of their magnitude.
        EXPECT_LE((X * M - B).norm(), 1e-10 * B.norm()) << order << " " << np;
      }
    }
  }
}

TEST(ScaledDesign, HasFunctionsOfTheSizeOfOne) {
  const ScaledDesign design = scaled("ZXY", 3);
  for (const double sx : {-1.0, 1.0}) {
    for (const double sy : {-1.0, 1.0}) {
      const ReadingBox& box = design.box();
      const Eigen::Matrix3Xd B =
          design.B(box.centre_m + Vector3(sx, sy, 1).cwiseProduct(box.half_width_m));
      EXPECT_LE(B.cwiseAbs().maxCoeff(), 1.0 + 1e-12);
    }
  }
}

TEST(ScaledDesign, ContainsEverySmallRotation) {
  const Vector3 about(-0.09, 0.14, 0.03), omega(1e-4, -2e-4, 3e-4);
  for (const std::string& order : kSixOrders) {
    const ScaledDesign design = scaled(order, 3);
    const Eigen::VectorXd c = design.rotation_about(about) * omega;
    for (const Vector3& p_mm : random_points_mm(5)) {
      const Vector3 expected = omega.cross(p_mm / 1000 - about);
      EXPECT_LE((design.B(p_mm / 1000) * c - expected).norm(), 1e-15) << order;
    }
  }
}

TEST(ScaledDesign, NeedsAllAxesToMove) {
  EXPECT_EQ(ScaledDesign::of(chain_of("XYZ"), 3, {Vector3::Zero(), {1, 1, 0}}).error().code,
            ErrorCode::DegenerateGeometry);
}

}  // namespace
