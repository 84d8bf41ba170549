/// A ball array's model goes out by the rules of any other: vector and uncertainty only where it
/// may be applied.

#include <gmock/gmock.h>

#include "abbe/calib/evemu/solve/solve.hpp"
#include "abbe/messages/cdr.hpp"
#include "abbe/publishing/idl_messages.hpp"
#include "evemu_run.hpp"

namespace abbe::daemon {
namespace {

using calib::Vector3;

struct PolynomialPublication : testing::Test {
  /// Identified once: with sanitizers it takes seconds.
  static const PublishedModel& active_model() {
    static const PublishedModel active{
        .id = "m",
        .method = "evemu",
        .estimator = "bayes-pose",
        .recording_sha256 = {},
        .model =
            calib::evemu::solve(*calib::evemu::observe_errors(tests::evemu::reference_errors(),
                                                              tests::evemu::reference_machine()))
                ->model};
    return active;
  }
  static protocol::Snapshot standing_at(const Vector3& q_m) {
    protocol::Snapshot s;
    s.axis_count = 3;
    s.position = {q_m.x(), q_m.y(), q_m.z()};
    return s;
  }
  [[nodiscard]] v1::Compensation compensation(const protocol::Snapshot& s,
                                              const std::array<double, 3>& tool_m = {}) const {
    return compensation_message(v1::ModelStatus::MODEL_ACTIVE, &model, s, tool_m,
                                std::chrono::seconds{1}, {});
  }

  const PublishedModel& model = active_model();
  Vector3 inside_m{0.3, 0.2, 0.04};
};

TEST_F(PolynomialPublication, TheVectorHasTheUncertaintyOfTheModel) {
  const auto m = compensation(standing_at(inside_m));
  const auto e = model.model.error_at(inside_m, Vector3::Zero());
  EXPECT_EQ(m.state(), v1::ModelStatus::MODEL_ACTIVE);
  EXPECT_TRUE(m.inside());
  EXPECT_TRUE(m.tool_ok());
  EXPECT_EQ(m.vector_m()[1], e.V_m.y());
  EXPECT_GT(m.cov_m2()[0], 0.0);
  EXPECT_EQ(m.cov_m2()[3], e.cov_V_m2(1, 1));
}

TEST_F(PolynomialPublication, ReportsPositionsOutsideTheBalls) {
  EXPECT_FALSE(compensation(standing_at({0.3, -0.1, 0.04})).inside());
}

TEST_F(PolynomialPublication, ForAnotherToolThereIsNoVector) {
  const auto m = compensation(standing_at(inside_m), {0.0, 0.0, 0.05});
  EXPECT_FALSE(m.tool_ok());
  EXPECT_EQ(m.vector_m()[0], 0.0);
}

TEST_F(PolynomialPublication, WithAnAxisUnknownItIsStaleWithoutAVector) {
  auto blind = standing_at(inside_m);
  blind.missing_mask = 1;
  const auto m = compensation(blind);
  EXPECT_EQ(m.state(), v1::ModelStatus::MODEL_STALE);
  EXPECT_EQ(m.vector_m()[0], 0.0);
}

TEST_F(PolynomialPublication, ItsMessagesFitAndTheGridDoesNotClaimToBeLinear) {
  std::vector<std::byte> bytes;
  const auto said = model_message(model, {});
  EXPECT_TRUE(encode(said, bytes));
  EXPECT_EQ(said.basis(), "legendre");
  EXPECT_EQ(said.parameters().size(), 45u);
  for (const auto& slice : grid_messages(model, {})) {
    EXPECT_TRUE(encode(slice, bytes));
    EXPECT_FALSE(slice.every_node());
  }
}

TEST_F(PolynomialPublication, TheGridsUncertaintyIsValidBetweenNodesToo) {
  std::size_t nodes = 0;
  const v1::GridNode* inside = nullptr;
  const auto slices = grid_messages(model, {});

  for (const auto& slice : slices) {
    nodes += slice.nodes().size();
    for (const auto& node : slice.nodes())
      if (node.inside()) inside = &node;
  }

  EXPECT_GT(nodes, 3000u);
  ASSERT_NE(inside, nullptr);
  const Vector3 q(inside->position_m()[0], inside->position_m()[1], inside->position_m()[2]);
  const auto e = model.model.error_at(q, Vector3::Zero());
  EXPECT_GT(inside->cov_m2()[0] + inside->cov_m2()[3] + inside->cov_m2()[5], e.cov_V_m2.trace());
}

}  // namespace
}  // namespace abbe::daemon
