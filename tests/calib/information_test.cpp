#include "abbe/calib/estimation/information.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <random>

#include "abbe/calib/internal/estimation/dense_information.hpp"
#include "abbe/calib/internal/estimation/null_space.hpp"
#include "abbe/calib/internal/estimation/sparse_information.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::calib::estimation;

struct Rows {
  Eigen::MatrixXd A;
  Eigen::VectorXd y;
};

/// Random rows; a third of the entries is zero, as in a sparse design matrix.
Rows random_rows(Eigen::Index rows, Eigen::Index unknowns, unsigned seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  Rows r{Eigen::MatrixXd(rows, unknowns), Eigen::VectorXd(rows)};
  for (Eigen::Index i = 0; i < rows; ++i) {
    for (Eigen::Index j = 0; j < unknowns; ++j) {
      r.A(i, j) = (i + 2 * j) % 3 == 0 ? 0.0 : normal(random);
    }
    r.y(i) = normal(random);
  }
  return r;
}

Information of_rows(const Rows& r) {
  Information information(static_cast<std::size_t>(r.A.cols()));
  information.add_rows(r.A, r.y);
  return information;
}

/// [R z] of Eigen's QR of all rows at once, with the sign that makes the diagonal positive.
Eigen::MatrixXd dense_triangle(const Rows& r) {
  Eigen::MatrixXd all(r.A.rows(), r.A.cols() + 1);
  all << r.A, r.y;
  const Eigen::HouseholderQR<Eigen::MatrixXd> qr(all);
  Eigen::MatrixXd T = qr.matrixQR().topRows(r.A.cols()).triangularView<Eigen::Upper>();
  for (Eigen::Index i = 0; i < T.rows(); ++i) {
    if (T(i, i) < 0.0) {
      T.row(i) *= -1.0;
    }
  }
  return T;
}

Eigen::MatrixXd triangle(const Information& information) {
  Eigen::MatrixXd T(information.R().rows(), information.R().cols() + 1);
  T << information.R(), information.z();
  return T;
}

/// Largest difference relative to the largest entry.
double difference(const Eigen::MatrixXd& a, const Eigen::MatrixXd& b) {
  return (a - b).cwiseAbs().maxCoeff() / b.cwiseAbs().maxCoeff();
}

// Rounding of 300 rows and 20 columns of size 1: sqrt(300 * 20) * 1e-16 = 1e-14.
constexpr double kRounding = 1e-13;

TEST(Information, HasTheTriangleOfADenseQrOfAllRows) {
  const Rows r = random_rows(300, 20, 1);
  EXPECT_LT(difference(triangle(of_rows(r)), dense_triangle(r)), kRounding);
}

TEST(Information, IsTheSameFromAllRowsAtOnce) {
  const Rows r = random_rows(300, 20, 1);
  const Information added = of_rows(r), at_once = information_of(r.A, r.y);
  EXPECT_LT(difference(triangle(at_once), triangle(added)), kRounding);
  EXPECT_NEAR(at_once.rest(), added.rest(), 1e-11);
  EXPECT_EQ(at_once.rows(), added.rows());
  EXPECT_GE(at_once.R().diagonal().minCoeff(), 0.0);
}

// Fewer rows than unknowns, and an unknown without data: R^T R and R^T z are those of the rows.
TEST(Information, FromAllRowsAtOnceMayLeaveUnknownsOpen) {
  Rows r = random_rows(12, 20, 2);
  r.A.col(3).setZero();
  const Information information = information_of(r.A, r.y);
  const Eigen::MatrixXd R = information.R();
  EXPECT_LT(difference(R.transpose() * R, r.A.transpose() * r.A), kRounding);
  EXPECT_LT(difference(R.transpose() * information.z(), r.A.transpose() * r.y), kRounding);
  EXPECT_NEAR(information.z().squaredNorm() + information.rest(), r.y.squaredNorm(), 1e-12);
  EXPECT_EQ(information.rows(), 12u);
}

TEST(Information, HasTheResidualsOfLeastSquares) {
  const Rows r = random_rows(300, 20, 1);
  const Eigen::VectorXd U = r.A.householderQr().solve(r.y);
  EXPECT_NEAR(of_rows(r).rest(), (r.A * U - r.y).squaredNorm(), 1e-11);
  EXPECT_EQ(of_rows(r).rows(), 300u);
}

TEST(Information, IsTheSameFromSparseRowsInBatches) {
  const Rows r = random_rows(100, 12, 2);
  Information information(12);
  RowBatch batch(12);
  for (Eigen::Index i = 0; i < r.A.rows(); ++i) {
    std::vector<RowEntry> row;
    for (Eigen::Index j = 0; j < r.A.cols(); ++j) {
      if (r.A(i, j) != 0.0) {
        row.push_back({static_cast<std::size_t>(j), 0.5 * r.A(i, j)});
      }
    }
    batch.append(row, 0.5 * r.y(i), 2.0);
    if (batch.full()) {
      information.add(batch);
    }
  }
  information.add(batch);
  EXPECT_LT(difference(triangle(information), dense_triangle(r)), kRounding);
  EXPECT_EQ(information.rows(), 100u);
}

/// Sparse rows whose first column is 0, 1 or 2, as rows of three cells of an axis.
std::vector<std::vector<RowEntry>> rows_of_three_cells(const Rows& r) {
  std::vector<std::vector<RowEntry>> rows;
  for (Eigen::Index i = 0; i < r.A.rows(); ++i) {
    const Eigen::Index cell = i % 3;
    std::vector<RowEntry>& row = rows.emplace_back();
    for (const Eigen::Index j : {cell, cell + 1, cell + 5, Eigen::Index{9}}) {
      row.push_back({static_cast<std::size_t>(j), r.A(i, j)});
    }
  }
  return rows;
}

TEST(SparseInformation, IsThatOfAllRowsInOneTriangle) {
  const Rows values = random_rows(90, 10, 6);
  const std::vector<std::vector<RowEntry>> entries = rows_of_three_cells(values);
  std::vector<WeightedRow> rows;
  Rows dense{Eigen::MatrixXd::Zero(90, 10), 2.0 * values.y};
  for (Eigen::Index i = 0; i < 90; ++i) {
    rows.push_back({entries[static_cast<std::size_t>(i)], values.y(i), 2.0});
    for (const RowEntry& e : entries[static_cast<std::size_t>(i)]) {
      dense.A(i, static_cast<Eigen::Index>(e.column)) = 2.0 * e.value;
    }
  }

  const Information information = information_of(10, rows);
  EXPECT_LT(
      difference(information.R().transpose() * information.R(), dense.A.transpose() * dense.A),
      kRounding);
  EXPECT_LT(
      difference(information.R().transpose() * information.z(), dense.A.transpose() * dense.y),
      kRounding);
  EXPECT_NEAR(information.rest(), of_rows(dense).rest(), 1e-11);
  EXPECT_EQ(information.rows(), 90u);
}

TEST(Information, OfAllRowsIsTheSumOfItsPartsInAnyGrouping) {
  const Information a = of_rows(random_rows(40, 10, 1)), b = of_rows(random_rows(5, 10, 2)),
                    c = of_rows(random_rows(70, 10, 3));
  Information left = a, right = b;
  left += b;
  left += c;
  right += c;
  Information a_and_right = a;
  a_and_right += right;
  EXPECT_LT(difference(triangle(left), triangle(a_and_right)), kRounding);
  EXPECT_NEAR(left.rest(), a_and_right.rest(), 1e-12);
  EXPECT_EQ(left.rows(), 115u);
}

TEST(Information, ThatForgetsHasLessWeight) {
  Information forgotten = of_rows(random_rows(40, 10, 1));
  const Information kept = forgotten;
  forgotten.forget(0.25);
  EXPECT_LT(difference(forgotten.R(), 0.5 * kept.R()), kRounding);
  EXPECT_DOUBLE_EQ(forgotten.rest(), 0.25 * kept.rest());
}

TEST(Information, OfAPriorIsOneRow) {
  Information information(3);
  information.add_prior(1, 5.0, 0.1);
  EXPECT_DOUBLE_EQ(information.R()(1, 1), 10.0);
  EXPECT_DOUBLE_EQ(information.z()(1), 50.0);
  EXPECT_EQ(information.squared_length(0), 0.0);
}

/// Information matrix of the kept unknowns: H_kk - H_ke H_ee^-1 H_ek.
Eigen::MatrixXd schur_complement(const Eigen::MatrixXd& H, const std::vector<Eigen::Index>& kept,
                                 const std::vector<Eigen::Index>& out) {
  return H(kept, kept) - H(kept, out) * H(out, out).ldlt().solve(Eigen::MatrixXd(H(out, kept)));
}

TEST(Information, WithoutUnknownsIsTheSchurComplement) {
  const Rows r = random_rows(60, 9, 4);
  const Information rest = of_rows(r).without_unknowns(std::array<std::size_t, 3>{7, 0, 4});
  const Eigen::MatrixXd expected =
      schur_complement(r.A.transpose() * r.A, {1, 2, 3, 5, 6, 8}, {0, 4, 7});
  EXPECT_LT(difference(rest.R().transpose() * rest.R(), expected), kRounding);
  EXPECT_EQ(rest.rows(), 57u);
  // The estimate of the others is the same.
  const Eigen::VectorXd U = r.A.householderQr().solve(r.y);
  const Eigen::VectorXd V = rest.R().triangularView<Eigen::Upper>().solve(rest.z());
  EXPECT_NEAR(V(5), U(8), 1e-12);
}

/// An unknown that depends on the others takes nothing from them.
TEST(Information, WithoutUndeterminedUnknownsKeepsWhatTheRowsStateAboutTheOthers) {
  Rows r = random_rows(60, 5, 4);
  r.A.col(1) = 2.0 * r.A.col(0);
  r.A.col(0).tail(30).setZero();
  r.A.col(1).tail(30).setZero();
  const Information rest = of_rows(r).without_unknowns(std::array<std::size_t, 2>{0, 1});
  const Eigen::MatrixXd expected = schur_complement(r.A.transpose() * r.A, {2, 3, 4}, {0});
  EXPECT_LT(difference(rest.R().transpose() * rest.R(), expected), kRounding);
  EXPECT_EQ(rest.rows(), 59u);
}

/// A group with a nuisance, a correlated noise and unknowns in another order.
ObservationGroup correlated_group() {
  const Rows r = random_rows(12, 4, 5);
  ObservationGroup group{.unknowns = {5, 1, 2},
                         .A = r.A.leftCols(3),
                         .L = r.A.rightCols(1),
                         .u_nuisance = {0.3},
                         .y = r.y};
  group.covariance = Eigen::MatrixXd::Constant(12, 12, 0.2);
  group.covariance.diagonal().array() += 0.5;
  return group;
}

/// Information matrix when the nuisance is part of the noise: A^T (C + u^2 L L^T)^-1 A.
TEST(Information, OfABlockCountsItsNuisanceAsNoise) {
  const ObservationGroup group = correlated_group();
  Information information(6);
  ASSERT_TRUE(information.add(group));
  const Eigen::MatrixXd C = group.covariance + 0.3 * 0.3 * group.L * group.L.transpose();
  const Eigen::MatrixXd expected = group.A.transpose() * C.ldlt().solve(group.A);
  const Eigen::MatrixXd H = information.R().transpose() * information.R();
  const std::vector<Eigen::Index> at{5, 1, 2};
  EXPECT_LT(difference(H(at, at), expected), kRounding);
  EXPECT_EQ(H.row(0).norm(), 0.0);
  EXPECT_EQ(information.rows(), 12u);  // the prior is one more, the nuisance one less
}

TEST(Information, OfABlockWithoutPriorIsThatOfAnUnknownNuisance) {
  ObservationGroup group = correlated_group();
  group.u_nuisance = {kNoPrior};
  group.covariance = Eigen::VectorXd::Constant(12, 4.0);
  Information information(6);
  ASSERT_TRUE(information.add(group));
  Eigen::MatrixXd all(12, 4);
  all << group.A, group.L;
  const Eigen::MatrixXd expected = schur_complement(0.25 * all.transpose() * all, {0, 1, 2}, {3});
  const std::vector<Eigen::Index> at{5, 1, 2};
  const Eigen::MatrixXd H = information.R().transpose() * information.R();
  EXPECT_LT(difference(H(at, at), expected), kRounding);
  EXPECT_EQ(information.rows(), 11u);
}

TEST(Information, RefusesABlockOfWrongSize) {
  Information information(3);
  ObservationGroup group = correlated_group();  // unknown 5 of 3
  EXPECT_EQ(information.add(group).error().code, ErrorCode::BadInput);
  group.unknowns = {0, 1};
  EXPECT_EQ(information.add(group).error().code, ErrorCode::BadInput);
  group.unknowns = {0, 1, 2};
  group.covariance(0, 0) = -1.0;
  EXPECT_EQ(information.add(group).error().code, ErrorCode::DegenerateGeometry);
}

/// NIST StRD, Longley: observations and certified parameters
/// (https://www.itl.nist.gov/div898/strd).
struct Longley {
  Rows rows{Eigen::MatrixXd(16, 7), Eigen::VectorXd(16)};
  Eigen::VectorXd certified{Eigen::VectorXd(7)};
  double certified_rest = 836424.055505915;
  Longley() {
    Eigen::MatrixXd data(16, 7);
    data << 60323, 83.0, 234289, 2356, 1590, 107608, 1947,  //
        61122, 88.5, 259426, 2325, 1456, 108632, 1948,      //
        60171, 88.2, 258054, 3682, 1616, 109773, 1949,      //
        61187, 89.5, 284599, 3351, 1650, 110929, 1950,      //
        63221, 96.2, 328975, 2099, 3099, 112075, 1951,      //
        63639, 98.1, 346999, 1932, 3594, 113270, 1952,      //
        64989, 99.0, 365385, 1870, 3547, 115094, 1953,      //
        63761, 100.0, 363112, 3578, 3350, 116219, 1954,     //
        66019, 101.2, 397469, 2904, 3048, 117388, 1955,     //
        67857, 104.6, 419180, 2822, 2857, 118734, 1956,     //
        68169, 108.4, 442769, 2936, 2798, 120445, 1957,     //
        66513, 110.8, 444546, 4681, 2637, 121950, 1958,     //
        68655, 112.6, 482704, 3813, 2552, 123366, 1959,     //
        69564, 114.2, 502601, 3931, 2514, 125368, 1960,     //
        69331, 115.7, 518173, 4806, 2572, 127852, 1961,     //
        70551, 116.9, 554894, 4007, 2827, 130081, 1962;
    rows.A << Eigen::VectorXd::Ones(16), data.rightCols(6);
    rows.y = data.col(0);
    certified << -3482258.63459582, 15.0618722713733, -0.0358191792925910, -2.02022980381683,
        -1.03322686717359, -0.0511041056535807, 1829.15146461355;
  }
};

Eigen::VectorXd solution(const Information& information) {
  return information.R().triangularView<Eigen::Upper>().solve(information.z());
}

double largest_relative(const Eigen::VectorXd& found, const Eigen::VectorXd& expected) {
  return ((found - expected).array() / expected.array()).abs().maxCoeff();
}

// Condition 4.9e9 (4e4 with scaled columns): the last digits of the certified values, 1e-14 * 4e4.
TEST(Information, GivesTheCertifiedParametersOfLongleyTo10Digits) {
  const Longley longley;
  const Information information = of_rows(longley.rows);
  EXPECT_LT(largest_relative(solution(information), longley.certified), 1e-10);
  EXPECT_NEAR(information.rest() / longley.certified_rest, 1.0, 1e-12);
}

TEST(Information, HasTwoMoreDigitsOfLongleyThanNormalEquations) {
  const Longley longley;
  const Eigen::MatrixXd& A = longley.rows.A;
  const Eigen::VectorXd squared = (A.transpose() * A).llt().solve(A.transpose() * longley.rows.y);
  EXPECT_GT(largest_relative(squared, longley.certified),
            100.0 * largest_relative(solution(of_rows(longley.rows)), longley.certified));
}

/// Rows of a Hilbert matrix: condition 1e12 with 9 columns.
Rows hilbert() {
  Rows r{Eigen::MatrixXd(20, 9), Eigen::VectorXd(20)};
  for (Eigen::Index i = 0; i < 20; ++i) {
    for (Eigen::Index j = 0; j < 9; ++j) {
      r.A(i, j) = 1.0 / static_cast<double>(i + j + 1);
    }
  }
  r.y = r.A * Eigen::VectorXd::Ones(9);
  return r;
}

TEST(Information, SolvesWhereNormalEquationsAreNotPositiveDefinite) {
  const Rows r = hilbert();
  EXPECT_LT((solution(of_rows(r)).array() - 1.0).abs().maxCoeff(), 1e-3);
  const Eigen::MatrixXd H = r.A.transpose() * r.A;
  const Eigen::VectorXd scale = H.diagonal().cwiseSqrt().cwiseInverse();
  const Eigen::MatrixXd scaled = scale.asDiagonal() * H * scale.asDiagonal();
  EXPECT_NE(scaled.llt().info(), Eigen::Success);
}

TEST(Spectrum, HasTheConditionOfTheScaledColumns) {
  Rows r = random_rows(80, 6, 7);
  r.A.col(2) *= 1e-9;  // another unit
  Eigen::MatrixXd scaled = r.A;
  scaled.colwise().normalize();
  const Eigen::VectorXd values = Eigen::JacobiSVD<Eigen::MatrixXd>(scaled).singularValues();
  const Spectrum s = spectrum(of_rows(r));
  EXPECT_EQ(s.rank, 6u);
  EXPECT_NEAR(s.condition, values(0) / values(5), 1e-10);
}

TEST(NullSpace, SpansTheCombinationsThatNoRowSees) {
  Rows r = random_rows(80, 6, 7);
  r.A.col(2) = 1e3 * (r.A.col(0) - r.A.col(4));
  const NullSpace null = null_space(of_rows(r));
  ASSERT_EQ(null.rank, 5u);
  ASSERT_EQ(null.basis.cols(), 1);
  EXPECT_LT((r.A * null.basis).norm(), 1e-13);
  EXPECT_NEAR(null.basis(0, 0) / null.basis(2, 0), -1e3, 1e-8);
  EXPECT_LT(null.share(1), 1e-20);
  EXPECT_GT(null.share(0), 0.1);
}

TEST(PivotedRank, IsThatOfTheSingularValues) {
  Rows r = random_rows(80, 6, 7);
  EXPECT_EQ(pivoted_rank(of_rows(r)), 6u);
  r.A.col(2) = 1e3 * (r.A.col(0) - r.A.col(4));
  EXPECT_EQ(pivoted_rank(of_rows(r)), 5u);
}

/// With a datum defect of half the unknowns, and with columns of zeros.
TEST(Spectrum, CountsTheRankOfAMatrixWithManyZeroSingularValues) {
  const Rows r = random_rows(80, 24, 7);
  Rows half = r;
  half.A.rightCols(12) = r.A.leftCols(12) * r.A.topLeftCorner(12, 12);
  half.A.col(3).setZero();
  const Spectrum s = spectrum(of_rows(half));
  EXPECT_EQ(s.rank, 12u);
  EXPECT_LT(s.singular_values(12), 1e-14);
  EXPECT_EQ(null_space(of_rows(half)).basis.cols(), 12);
}

/// A singular value of 1e-9 is far above rounding; squared it would be lost.
TEST(Spectrum, CountsAWeakCombination) {
  Rows r = random_rows(80, 6, 7);
  r.A.col(2) = r.A.col(0) + 1e-9 * r.A.col(2);
  EXPECT_EQ(spectrum(of_rows(r)).rank, 6u);
  r.A.col(2) = r.A.col(0);
  EXPECT_EQ(spectrum(of_rows(r)).rank, 5u);
}

TEST(Information, OfAnEntryWhoseSquareIsZeroIsFinite) {
  // So small are entries that are rounding of rounding, behind the rank of the rows.
  Rows r{Eigen::MatrixXd(1, 2), Eigen::VectorXd::Constant(1, 3.0)};
  r.A << 1e-170, 1.0;
  const Information information = of_rows(r);
  EXPECT_EQ(information.R()(1, 1), 1.0);
  EXPECT_EQ(information.z()(1), 3.0);
}

}  // namespace
