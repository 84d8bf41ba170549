#include "abbe/calib/gate.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "abbe/calib/model_comparison.hpp"
#include "otf_run.hpp"

namespace {
using namespace abbe::calib;
using namespace abbe::tests::otf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

/// Only EXX, `step_m` from node to node.
VolumetricModel positioning_model(double step_m) {
  const otf::Machine machine = coarse_machine("[w X' b Y Z t]");
  const ParameterLayout layout = layout_of(machine);
  Eigen::VectorXd U = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(layout.model_size()));
  for (Eigen::Index i = 0; i < 4; ++i) {
    U(i) = step_m * static_cast<double>(i);
  }
  return *VolumetricModel::from_vector(layout, Gauge::G1, std::array{machine.target_offset_m}, U,
                                       Eigen::MatrixXd::Zero(U.size(), U.size()),
                                       *ValidityVolume::hull_of(tensor_grid(machine.nodes)));
}

HeldOutFigures figures(double none, double candidate, std::optional<double> active = {}) {
  HeldOutFigures f;
  f.no_compensation = none;
  f.candidate = candidate;
  f.active = active;
  f.observations = 1000;
  return f;
}

TEST(Gate, AcceptsABetterModelOfPlausibleSize) {
  const Verdict verdict = decide(positioning_model(100e-6), figures(100, 1.0, 1.1));
  EXPECT_TRUE(verdict.accepted);
  EXPECT_THAT(verdict.reasons, IsEmpty());
  EXPECT_NEAR(verdict.max_error_m, 300e-6, 1e-12);
  EXPECT_NEAR(verdict.max_gradient, 100e-6 / 0.2, 1e-9);
}

TEST(Gate, RefusesWhatPredictsWorseThanNothing) {
  const Verdict verdict = decide(positioning_model(1e-6), figures(2.0, 2.5));
  EXPECT_FALSE(verdict.accepted);
  EXPECT_THAT(verdict.reasons, ElementsAre(HasSubstr("without compensation")));
}

TEST(Gate, RefusesWhatTheActiveModelDoesBetter) {
  const Verdict verdict = decide(positioning_model(1e-6), figures(100, 1.2, 1.1));
  EXPECT_THAT(verdict.reasons, ElementsAre(HasSubstr("active model")));
}

TEST(Gate, RefusesImplausibleMagnitudeAndGradient) {
  const Verdict verdict = decide(positioning_model(2e-3), figures(100, 1));
  EXPECT_THAT(verdict.reasons,
              ElementsAre(HasSubstr("largest error 6000 um"), HasSubstr("steepest change 10000")));
}

TEST(Gate, RefusesWithoutTestData) {
  HeldOutFigures nothing;
  EXPECT_FALSE(decide(positioning_model(1e-6), nothing).accepted);
  EXPECT_FALSE(decide(positioning_model(1e-6), figures(std::nan(""), std::nan(""))).accepted);
}

}  // namespace
