#include <gtest/gtest.h>

#include <algorithm>

#include "abbe/publishing/idl_messages.hpp"
#include "synthetic_model.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using protocol::HostTime;
using protocol::SampleFlag;
using v1::ModelStatus;

constexpr std::array<double, 3> kTool_m{0.02, -0.015,
                                        -0.12};  // the one tool of the synthetic model
constexpr std::array<double, 3> kNoVector{};

const PublishedModel kModel{.id = "m", .model = test::synthetic_model(1)};

protocol::Snapshot view_inside() {
  protocol::Snapshot view;
  view.head.time = HostTime{100s};
  view.axis_count = 3;
  view.position = {0.01, -0.02, -0.25};
  return view;
}

v1::Compensation message(const protocol::Snapshot& view,
                         const std::array<double, 3>& tool_m = kTool_m,
                         ModelStatus status = ModelStatus::MODEL_ACTIVE) {
  return compensation_message(status, &kModel, view, tool_m, 500ms,
                              {.machine = "mill", .now = HostTime{100s + 3ms}});
}

void expect_not_to_be_applied(const v1::Compensation& m) {
  EXPECT_EQ(m.state(), ModelStatus::MODEL_STALE);
  EXPECT_FALSE(m.inside());
  EXPECT_EQ(m.vector_m(), kNoVector);
  EXPECT_EQ(m.model_id(), "m");
}

TEST(CompensationMessage, IsTheModelErrorAtTheMachinesPosition) {
  const auto m = message(view_inside());
  const auto expected =
      kModel.model.V_at({0.01, -0.02, -0.25}, {kTool_m[0], kTool_m[1], kTool_m[2]});
  EXPECT_EQ(m.state(), ModelStatus::MODEL_ACTIVE);
  EXPECT_TRUE(m.inside() && m.tool_ok());
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(m.vector_m()[i], expected[static_cast<Eigen::Index>(i)], 1e-15);
  }
  EXPECT_EQ(m.age_ns(), 3'000'000);
}

/// Neither direction may be published as known, nor the difference as exact.
TEST(CompensationMessage, OfAModelWithBacklashIsTheMeanWithHalfTheDifference) {
  constexpr double kD = 80e-6, kU = 60e-6;
  const auto with = [](double u_D) {
    const PublishedModel model{.id = "b", .model = test::synthetic_travel_model(1, kD, u_D)};
    return compensation_message(ModelStatus::MODEL_ACTIVE, &model, view_inside(), kTool_m, 500ms,
                                {.machine = "mill"});
  };
  const auto known = with(1e-9), uncertain = with(kU);
  EXPECT_EQ(known.vector_m(), message(view_inside()).vector_m());
  EXPECT_EQ(uncertain.vector_m(), known.vector_m());
  EXPECT_GT(known.cov_m2()[0], 0.25 * kD * kD);
  EXPECT_GT(uncertain.cov_m2()[0] - known.cov_m2()[0], 0.25 * kU * kU);  // of EXX alone
}

/// The grid and the vector are two forms of one statement.
TEST(GridMessage, OfAModelWithBacklashIsThatOfTheCompensation) {
  const PublishedModel with{.id = "b", .model = test::synthetic_travel_model(1, 80e-6, 60e-6)};
  const auto node = grid_messages(with, {.machine = "mill"}).front().nodes().front();
  auto view = view_inside();
  std::ranges::copy(node.position_m(), view.position.begin());
  const auto m = compensation_message(ModelStatus::MODEL_ACTIVE, &with, view, kTool_m, 500ms, {});
  EXPECT_EQ(node.error_m(), m.vector_m());
  EXPECT_EQ(node.cov_m2(), m.cov_m2());
}

TEST(CompensationMessage, IsStaleWithoutAVectorOnceAnAxisDoesNotAnswer) {
  auto view = view_inside();
  view.missing_mask = 0b001;
  view.head.flags |= SampleFlag::AxisMissing;
  expect_not_to_be_applied(message(view));
}

TEST(CompensationMessage, IsStaleWithoutAVectorWhenTheBusIsOff) {
  auto view = view_inside();
  view.head.flags |= SampleFlag::BusOff;
  expect_not_to_be_applied(message(view));
}

TEST(CompensationMessage, IsStaleWithoutAVectorWhenAnEncoderReportsAFault) {
  auto view = view_inside();
  view.head.flags |= SampleFlag::DeviceError;
  expect_not_to_be_applied(message(view));
}

TEST(CompensationMessage, KeepsAStateThatIsWorseThanStale) {
  auto view = view_inside();
  view.missing_mask = 0b001;
  EXPECT_EQ(message(view, kTool_m, ModelStatus::MODEL_INVALID).state(), ModelStatus::MODEL_INVALID);
}

TEST(CompensationMessage, ForAnotherToolHasNoVector) {
  const auto m = message(view_inside(), {0.0, 0.0, -0.2});
  EXPECT_FALSE(m.tool_ok());
  EXPECT_FALSE(m.inside());
  EXPECT_EQ(m.vector_m(), kNoVector);
}

TEST(CompensationMessage, ReportsAPositionOutsideTheVolume) {
  auto view = view_inside();
  view.position[0] = 0.5;
  EXPECT_FALSE(message(view).inside());
}

}  // namespace
}  // namespace abbe::daemon
