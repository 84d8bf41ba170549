#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>

#include "abbe/calib/model/model_comparison.hpp"
#include "joint_parts.hpp"

namespace {
namespace joint = abbe::calib::joint;
using abbe::calib::Vector3;
using abbe::calib::VolumetricModel;
using abbe::tests::joint::field_of;
using abbe::tests::joint::model_of;
using abbe::tests::joint::observed_array;
using abbe::tests::joint::SimulatedArray;
using abbe::tests::otf::MadeRun;
using abbe::tests::otf::make_run;
using testing::HasSubstr;
using testing::IsEmpty;

/// One run and one array of the machine with the seed.
struct OneMachine {
  MadeRun run;
  VolumetricModel of_run;
  joint::CommonTables common;
  abbe::calib::evemu::Observations array;

  explicit OneMachine(unsigned seed, SimulatedArray wanted = {}, unsigned noise_seed = 1)
      : run(make_run({.seed = seed, .noise_seed = noise_seed})),
        of_run(model_of(run)),
        common(*joint::tables_of(of_run)) {
    if (wanted.tool_m.isZero()) {
      wanted.tool_m = run.machine.target_offset_m;
    }
    array = observed_array(run, field_of(run), wanted);
  }

  [[nodiscard]] joint::Part run_part() const { return *joint::part_of_run("run", of_run, common); }
  /// The run with its parameters changed: a mistake on the way to the joint identification.
  [[nodiscard]] joint::Part run_part(const Eigen::VectorXd& U) const {
    const VolumetricModel changed = *VolumetricModel::from_vector(
        common.basis.layout(), abbe::calib::ModelDatum::G1, of_run.tool_offsets_m(), U,
        of_run.covariance(), of_run.validity());
    return *joint::part_of_run("run", changed, common);
  }
  [[nodiscard]] Eigen::VectorXd with_table(const std::string& table, double factor) const {
    Eigen::VectorXd U = of_run.U();
    for (Eigen::Index i = 0; i < U.size(); ++i) {
      U(i) *= of_run.parameters()[static_cast<std::size_t>(i)].name == table ? factor : 1.0;
    }
    return U;
  }
  [[nodiscard]] std::string contradiction(const joint::Part& a, const joint::Part& b) const {
    const std::vector<joint::Part> parts{a, b};
    const auto result = joint::identify(parts, common);
    return !result                          ? result.error().text
           : result->contradictions.empty() ? ""
                                            : result->contradictions.front();
  }
  [[nodiscard]] std::string with_array(const abbe::calib::evemu::Observations& o) const {
    const auto part = joint::part_of_array("array", o, common);
    return part ? contradiction(run_part(), *part) : part.error().text;
  }
  [[nodiscard]] std::string with_run(const Eigen::VectorXd& U) const {
    return contradiction(run_part(U), *joint::part_of_array("array", array, common));
  }
};

TEST(JointIdentification, PartsOfOneMachineAgreeAndTheModelIsNowhereLessCertain) {
  double squares = 0.0, count = 0.0;
  for (unsigned seed = 1; seed <= 8; ++seed) {
    const OneMachine m(seed, {.seed = seed}, seed);
    const std::vector parts{m.run_part(), *joint::part_of_array("array", m.array, m.common)};
    const auto result = joint::identify(parts, m.common);
    ASSERT_TRUE(result) << result.error().text;
    ASSERT_THAT(result->contradictions, IsEmpty()) << seed;
    const VolumetricModel& model = result->joint->model;

    for (const Vector3& q : abbe::calib::tensor_grid(m.of_run.nodes())) {
      const Vector3& t = m.common.tool_offset_m;
      const double of_joint = model.error_at(q, t).cov_V_m2.trace(),
                   of_run = m.of_run.error_at(q, t).cov_V_m2.trace();
      EXPECT_LE(of_joint, of_run * (1.0 + 1e-9));
    }

    // The truth in the datum of the model; normalised by the covariance of the free coordinates.
    Eigen::VectorXd U = Eigen::VectorXd::Zero(m.run.truth.size() + 6);
    U.head(m.run.truth.size()) = m.run.truth;
    const Eigen::VectorXd truth =
        abbe::calib::to_datum(abbe::calib::ModelDatum::G1, m.common.basis.layout(),
                              std::array{m.common.tool_offset_m}, U)
            ->head(m.run.truth.size());
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(model.covariance());
    const double least = 1e-9 * eigen.eigenvalues().maxCoeff();
    const Eigen::VectorXd e = eigen.eigenvectors().transpose() * (model.U() - truth);
    for (Eigen::Index k = 0; k < e.size(); ++k) {
      if (eigen.eigenvalues()(k) > least) {
        squares += e(k) * e(k) / eigen.eigenvalues()(k);
        count += 1.0;
      }
    }
  }
  RecordProperty("mean_squared_normalised_error", std::to_string(squares / count));
  EXPECT_NEAR(squares / count, 1.0, 0.3);  // 248 values: standard deviation 0.09
}

TEST(JointIdentification, NamesFaultsOfTables) {
  const OneMachine m(1);
  for (const char* table : {"EXX", "EYX", "EAX", "EC0Y", "EZZ"}) {
    EXPECT_THAT(m.with_run(m.with_table(table, -1.0)),
                HasSubstr(std::string("the sign of ") + table))
        << table;
  }
  EXPECT_THAT(m.with_run(m.with_table("EBY", 4.848)), HasSubstr("EBY"));  // arcsec for rad * 1e-6
  EXPECT_THAT(m.with_run(-m.of_run.U()), HasSubstr("the sign of V is reversed"));
  EXPECT_THAT(m.with_run(m.of_run.U() / 25.4), HasSubstr("25.4 (unit)"));
}

TEST(JointIdentification, NamesFaultsOfTheArray) {
  const OneMachine longer(1, {.length_error = 200e-6});
  EXPECT_THAT(longer.with_array(longer.array), HasSubstr("array: its lengths are smaller by"));

  const OneMachine m(1);
  abbe::calib::evemu::Observations other_tool = m.array;
  other_tool.machine.tool_offset_m = Vector3::Zero();
  EXPECT_THAT(m.with_array(other_tool), HasSubstr("the tool offset is (20, -15, -120) mm"));

  abbe::calib::evemu::Observations swapped = m.array;
  for (auto& row : swapped.rows) {
    std::swap(row.V_m.x(), row.V_m.y());
  }
  EXPECT_THAT(m.with_array(swapped), HasSubstr("swapped"));
  const OneMachine another(2);
  EXPECT_THAT(m.with_array(another.array), HasSubstr("contradict"));
}

}  // namespace
