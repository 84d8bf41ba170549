#include <gtest/gtest.h>

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

TEST(CompensationMessage, IsThatOfTheDirectionInWhichTheAxesMoved) {
  using calib::estimation::Travel;
  const PublishedModel with{.id = "b", .model = test::synthetic_travel_model(1)};
  const auto of = [&](const calib::estimation::AxisTravel& travel) {
    return compensation_message(ModelStatus::MODEL_ACTIVE, &with, view_inside(), kTool_m, 500ms, {},
                                travel);
  };
  const auto forth = of({Travel::Forward, Travel::Forward, Travel::Forward}),
             back = of({Travel::Backward, Travel::Backward, Travel::Backward}), unknown = of({});
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(unknown.vector_m()[i], 0.5 * (forth.vector_m()[i] + back.vector_m()[i]), 1e-15);
    EXPECT_GT(std::abs(forth.vector_m()[i] - back.vector_m()[i]), 1e-6);
  }
  EXPECT_GT(unknown.cov_m2()[0], 10.0 * forth.cov_m2()[0]);
}

/// A subscriber of the grid does not know the direction: its uncertainty contains half of it.
TEST(GridMessage, OfAModelWithBacklashIsTheMeanWithHalfTheDifference) {
  const PublishedModel with{.id = "b", .model = test::synthetic_travel_model(1)};
  const auto node = grid_messages(with, {.machine = "mill"}).front().nodes().front();
  const calib::Vector3 q(node.position_m().data()), tool(kTool_m.data());
  const auto e = with.model.error_at(q, tool, {});
  EXPECT_EQ(node.error_m()[0], e.V_m.x());
  EXPECT_NEAR(node.cov_m2()[0], e.cov_V_m2(0, 0), 1e-20);
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
