// Directed tests of joint/identify.hpp: length, scales of the axes, squareness.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

#include "abbe/calib/internal/geometry/axis_scale_columns.hpp"
#include "abbe/calib/internal/joint/all_parts.hpp"
#include "abbe/calib/internal/model/datum_coordinates.hpp"
#include "joint_parts.hpp"

namespace {
namespace joint = abbe::calib::joint;
using abbe::calib::VolumetricModel;
using testing::AllOf;
using testing::Each;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;
using testing::StartsWith;

/// Parts with random covariances, of coordinates that are equal except for `differs` in one part.
class DirectedTests : public testing::Test {
 protected:
  DirectedTests()
      : common_{*abbe::calib::TableBasis::of(abbe::tests::otf::layout_of(
                    abbe::tests::otf::coarse_machine("[w X' b Y Z t]"))),
                abbe::calib::Vector3::Zero()},
        c_(abbe::calib::datum_coordinates(common_.basis)),
        m_(c_.N.cols()),
        scales_(c_.N.transpose() * axis_scale_columns(common_.basis.layout())) {}

  Eigen::VectorXd draw(Eigen::Index size) {
    return Eigen::VectorXd::NullaryExpr(size, [this] { return normal_(random_); });
  }
  Eigen::MatrixXd covariance() {
    const Eigen::MatrixXd root = draw(m_ * (m_ + 5)).reshaped(m_, m_ + 5);
    return 1e-12 * root * root.transpose();
  }
  /// e = `truth` + noise of the covariance C.
  joint::Part part(const std::string& name, const Eigen::MatrixXd& C,
                   const Eigen::VectorXd& truth) {
    const Eigen::MatrixXd L = C.llt().matrixL();
    estimates_.emplace_back(truth + L * draw(m_));
    const Eigen::MatrixXd W = L.inverse();
    abbe::calib::estimation::Information information(common_.basis.size());
    information.add_rows(W * c_.N.transpose(), W * estimates_.back());
    return {.name = name, .method = "evemu", .information = information};
  }
  [[nodiscard]] Eigen::VectorXd length() const { return scales_.rowwise().sum(); }

  std::mt19937_64 random_{3};
  std::normal_distribution<double> normal_;
  joint::CommonTables common_;
  abbe::calib::DatumCoordinates c_;
  Eigen::Index m_ = 0;
  Eigen::MatrixXd scales_;
  std::vector<Eigen::VectorXd> estimates_;
};

/// The generalised least-squares estimate of d in e_2 - (mean of the others) = a d.
TEST_F(DirectedTests, EstimateTheDifferenceFromAllOtherPartsTogether) {
  std::vector<Eigen::MatrixXd> C;
  std::vector<joint::Part> parts;
  for (const char* name : {"one", "two", "three"}) {
    C.push_back(covariance());
    parts.push_back(part(name, C.back(), Eigen::VectorXd::Zero(m_)));
  }
  const Eigen::MatrixXd of_others = (C[0].inverse() + C[1].inverse()).inverse();
  const Eigen::VectorXd others =
      of_others * (C[0].llt().solve(estimates_[0]) + C[1].llt().solve(estimates_[1]));
  const Eigen::VectorXd weighted = (of_others + C[2]).llt().solve(length());
  const double u = 1.0 / std::sqrt(weighted.dot(length()));
  const double d = u * u * weighted.dot(estimates_[2] - others);

  const auto found = joint::AllParts(parts, c_).directed(2, length());
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->d, d, 1e-6 * u);
  EXPECT_NEAR(found->u, u, 1e-6 * u);
  EXPECT_EQ(found->dof, 0.0);
}

/// Half of the variance has 20 degrees of freedom: u has 80.
TEST_F(DirectedTests, UHasTheDegreesOfFreedomOfAnEstimatedNoise) {
  const Eigen::MatrixXd C = covariance();
  std::vector parts{part("one", C, Eigen::VectorXd::Zero(m_)),
                    part("two", C, Eigen::VectorXd::Zero(m_))};
  parts[1].dof_of_noise = 20.0;
  EXPECT_NEAR(joint::AllParts(parts, c_).directed(1, length())->dof, 80.0, 1e-6);
}

/// Of 200 sound triples with a false-alarm probability of 0.2 at most 40 are expected (Bonferroni),
/// standard deviation 5.7.
TEST_F(DirectedTests, SoundPartsAreSeldomRefused) {
  const std::vector C{covariance(), covariance(), covariance()};
  int refused = 0;
  for (int i = 0; i < 200; ++i) {
    const Eigen::VectorXd truth = 30e-6 * draw(m_);
    const std::vector parts{part("one", C[0], truth), part("two", C[1], truth),
                            part("three", C[2], truth)};
    const auto tests = joint::test_directions(parts, common_, {.false_alarm = 0.2});
    ASSERT_THAT(*tests, SizeIs(21));
    refused += std::any_of(tests->begin(), tests->end(),
                           [](const joint::DirectedTest& t) { return t.contradiction; });
  }
  EXPECT_LE(refused, 57);
  EXPECT_GE(refused, 10);  // the limits are not much too small
}

TEST_F(DirectedTests, NameThePartAndTheDirectionThatDiffer) {
  const std::vector C{covariance(), covariance(), covariance()};
  const auto first_of = [&](std::size_t wrong, const Eigen::VectorXd& differs) {
    const Eigen::VectorXd truth = 30e-6 * draw(m_);
    std::vector<joint::Part> parts;
    for (std::size_t k = 0; k < C.size(); ++k) {
      parts.push_back(part("part " + std::to_string(k), C[k],
                           k == wrong ? Eigen::VectorXd(truth + differs) : truth));
    }
    const auto result = joint::identify(parts, common_);
    return result->contradictions.empty() ? "" : result->contradictions.front();
  };
  const auto u_of = [&](std::size_t k, const Eigen::VectorXd& column) {
    std::vector<joint::Part> parts;
    for (const Eigen::MatrixXd& of : C) {
      parts.push_back(part("", of, Eigen::VectorXd::Zero(m_)));
    }
    return joint::AllParts(parts, c_).directed(k, column)->u;
  };

  constexpr double kInU = 9.0;
  EXPECT_THAT(first_of(1, kInU * u_of(1, length()) * length()),
              AllOf(StartsWith("part 1: its lengths are larger by "), HasSubstr("(u "),
                    HasSubstr("than those of all other parts: wrong length or temperature of the "
                              "array")));
  EXPECT_THAT(first_of(2, -kInU * u_of(2, scales_.col(1)) * scales_.col(1)),
              StartsWith("part 2: its lengths along Y are smaller by "));
  for (const auto& group : c_.groups) {
    if (!group.motion && group.size == 1) {
      const Eigen::VectorXd column = Eigen::VectorXd::Unit(m_, group.first);
      EXPECT_THAT(first_of(0, kInU * u_of(0, column) * column),
                  StartsWith("part 0: its " + group.name + " is larger by "));
    }
  }
}

/// A run and an array of one machine, with a length error of the array.
std::vector<std::string> contradictions_of(unsigned seed, double length_error) {
  const auto run = abbe::tests::otf::make_run({.seed = seed, .noise_seed = seed});
  const VolumetricModel of_run = abbe::tests::joint::model_of(run);
  const joint::CommonTables common = *joint::tables_of(of_run);
  const auto array = abbe::tests::joint::observed_array(
      run, abbe::tests::joint::field_of(run),
      {.seed = seed, .length_error = length_error, .tool_m = run.machine.target_offset_m});
  const std::vector parts{*joint::part_of_run("run", of_run, common),
                          *joint::part_of_array("array", array, common)};
  return joint::identify(parts, common)->contradictions;
}

TEST(DirectedTestsOfAnArray, FindAWrongLengthThatTheChiSquareOfAllCombinationsDoesNot) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    EXPECT_THAT(contradictions_of(seed, 0.0), IsEmpty());
    const auto found = contradictions_of(seed, 20e-6);
    ASSERT_THAT(found, Not(IsEmpty()));
    EXPECT_THAT(found.front(),
                AllOf(StartsWith("array: its lengths are smaller by "),
                      HasSubstr("than those of run: wrong length or temperature of the array, or "
                                "wrong scale of the tracker's ranges")));
  }
}

/// With the noise of its own residuals a wrong hypothesis explained every difference.
TEST(DirectedTestsOfAnArray, DoNotTakeALengthForSwappedAxes) {
  const auto found = contradictions_of(1, 200e-6);
  ASSERT_THAT(found, SizeIs(2));
  EXPECT_THAT(found.front(), StartsWith("array: its lengths are smaller by "));
  EXPECT_THAT(found, Each(AllOf(Not(HasSubstr("swapped")), Not(HasSubstr("reversed")))));
}

}  // namespace
