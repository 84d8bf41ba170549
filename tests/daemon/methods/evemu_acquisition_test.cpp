/// Touches as the hub brings them: usable or not, with device and reason; the session that is made
/// of them.
#include "abbe/methods/evemu/acquisition.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include "abbe/methods/calibration_session.hpp"

#include "evemu_run.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using calib::Vector3;
using protocol::HostTime;
using protocol::TouchFlag;
using testing::HasSubstr;

constexpr HostTime kFrom{10s};

EvemuRequest request() {
  return {.calibrator = tests::evemu::reference_calibrator()};
}

/// The reference touches in the order of the plan.
std::vector<Vector3> touched_points_m() {
  std::vector<Vector3> points;
  const auto all = tests::evemu::reference_touches("touched_noiseless.csv");
  for (const auto& t : tests::evemu::touches_in_order(all, calib::evemu::TouchPlan{}.positions))
    points.push_back(t.p_m);
  return points;
}

protocol::Snapshot touch_at(const Vector3& p_m, HostTime time, std::uint32_t number) {
  protocol::Snapshot s;
  s.head.time = time;
  s.has_trigger = true;
  s.trigger.touch = number;
  s.axis_count = 3;
  s.position = {p_m.x(), p_m.y(), p_m.z()};
  return s;
}

struct EvemuAcquisitionTest : testing::Test {
  EvemuAcquisitionTest() { acquisition.begin(kFrom); }
  void touch(std::size_t i) {
    acquisition.take(touch_at(points_m.at(i), kFrom + 1s * (i + 1), number++));
  }

  EvemuAcquisition acquisition =
      *EvemuAcquisition::create(request(), {.touches = {.device = "probe 1"}});
  std::vector<Vector3> points_m = touched_points_m();
  std::uint32_t number = 1;
};

TEST_F(EvemuAcquisitionTest, ReportsWhatToTouchAndRunsFromTheFirstTouch) {
  EXPECT_EQ(acquisition.phase(), AcquisitionPhase::WaitingAtStart);
  EXPECT_EQ(acquisition.reason(), "position 4 (1 of 8): touch ball 1, 25 points");
  touch(0);
  EXPECT_EQ(acquisition.phase(), AcquisitionPhase::Running);
  EXPECT_EQ(acquisition.next()->touched, 1u);
  const auto features = acquisition.next()->features;
  ASSERT_EQ(features->size(), 11u);
  EXPECT_EQ(features->front().on, "ball 1");
  EXPECT_EQ(features->front().touched, 1u);
}

TEST_F(EvemuAcquisitionTest, ATouchTheProbeIsNotQualifiedForIsNamedAndNotUsed) {
  auto slow = touch_at(points_m[0], kFrom + 1s, 7);
  slow.trigger.touch_flags |= TouchFlag::SpeedUnsteady;
  acquisition.take(slow);
  EXPECT_EQ(acquisition.points(), 0u);
  EXPECT_THAT(acquisition.take_notes(),
              testing::ElementsAre(
                  "probe 1 touch 7: not used: the speed of the approach changed; expected: "
                  "ball 1"));
}

TEST_F(EvemuAcquisitionTest, ATouchOutsideTheTravelIsNamedAndNotUsed) {
  calib::MachineNodes travel;
  for (std::size_t a = 0; a < 3; ++a) travel[a].nodes_m = {-2.0, 2.0};
  const double x_m = points_m[0].x();
  travel[0].nodes_m = {x_m - 0.3, x_m - 0.1};
  EvemuAcquisitionOptions options;
  options.touches.device = "probe 1";
  options.travel = travel;
  auto narrow = *EvemuAcquisition::create(request(), options);
  narrow.begin(kFrom);
  narrow.take(touch_at(points_m[0], kFrom + 1s, 7));

  EXPECT_EQ(narrow.points(), 0u);
  EXPECT_THAT(narrow.take_notes(), testing::ElementsAre(testing::AllOf(
                                       testing::StartsWith("probe 1 touch 7: not used: X "),
                                       HasSubstr("outside its travel"), HasSubstr("[axes.X]"))));
  travel[0].nodes_m = {x_m - 0.3, x_m + 0.1};
  options.travel = travel;
  auto wide = *EvemuAcquisition::create(request(), options);
  wide.begin(kFrom);
  wide.take(touch_at(points_m[0], kFrom + 1s, 7));
  EXPECT_EQ(wide.points(), 1u);
}

TEST_F(EvemuAcquisitionTest, ATouchWithAnAxisMissingIsNotUsed) {
  auto blind = touch_at(points_m[0], kFrom + 1s, 1);
  blind.missing_mask = 0b010;
  acquisition.take(blind);
  EXPECT_EQ(acquisition.points(), 0u);
  EXPECT_THAT(acquisition.take_notes(), testing::ElementsAre(HasSubstr("an axis was not known")));
}

TEST_F(EvemuAcquisitionTest, KeepsTheUsableTouchesAmongUnusableOnes) {
  auto blind = touch_at(points_m[0], kFrom + 1s, 1);
  blind.missing_mask = 0b010;
  touch(0);
  for (int i = 0; i < 100; ++i) acquisition.take(blind);
  EXPECT_EQ(acquisition.phase(), AcquisitionPhase::Running);
  EXPECT_EQ(acquisition.points(), 1u);
}

TEST_F(EvemuAcquisitionTest, EndsWhenTheFirstTouchesCannotBeUsed) {
  auto blind = touch_at(points_m[0], kFrom + 1s, 1);
  blind.missing_mask = 0b010;
  for (int i = 0; i < 19; ++i) acquisition.take(blind);
  EXPECT_EQ(acquisition.phase(), AcquisitionPhase::WaitingAtStart);
  acquisition.take(blind);
  EXPECT_EQ(acquisition.phase(), AcquisitionPhase::Failed);
  EXPECT_THAT(acquisition.reason(), HasSubstr("20 successive touches"));
  EXPECT_THAT(acquisition.reason(), HasSubstr("an axis was not known"));
}

TEST_F(EvemuAcquisitionTest, EndsWhenTheCardLostItsZeroInTheMiddle) {
  touch(0);
  auto after = touch_at(points_m[1], kFrom + 5s, 9);
  after.head.flags |= protocol::SampleFlag::Restarted;
  acquisition.take(after);
  EXPECT_EQ(acquisition.phase(), AcquisitionPhase::Failed);
  EXPECT_THAT(acquisition.reason(), HasSubstr("probe 1 touch 9: its device restarted"));
}

TEST_F(EvemuAcquisitionTest, TouchesFromBeforeItsStartDoNotCount) {
  acquisition.take(touch_at(points_m[0], kFrom - 1s, 1));
  EXPECT_EQ(acquisition.points(), 0u);
}

TEST_F(EvemuAcquisitionTest, IsCompleteWithTheLastPointOfTheLastPosition) {
  for (std::size_t i = 0; i < points_m.size(); ++i) touch(i);
  EXPECT_EQ(acquisition.phase(), AcquisitionPhase::Complete);
  EXPECT_EQ(acquisition.release().touches.size(), points_m.size());
}

TEST_F(EvemuAcquisitionTest, EndsWhenNoTouchArrivesForTheTimeout) {
  touch(0);
  acquisition.tick(kFrom + 1h);
  EXPECT_EQ(acquisition.phase(), AcquisitionPhase::Running);
  acquisition.tick(kFrom + 1h + 2s);
  EXPECT_EQ(acquisition.phase(), AcquisitionPhase::Failed);
  EXPECT_THAT(acquisition.reason(),
              HasSubstr("no touch for 3601 s; position 4 (1 of 8): touch ball 1"));
}

TEST_F(EvemuAcquisitionTest, TheSessionReportsEveryNewFeatureAndEveryNoteAsAnEvent) {
  CalibrationSession session;
  ASSERT_TRUE(session.start({request(), kFrom}));
  for (std::size_t i = 0; i < 25; ++i)
    session.take(touch_at(points_m[i], kFrom + 1s * (i + 1), static_cast<std::uint32_t>(i)));
  session.take(touch_at(points_m[3] + Vector3(1e-6, 0, 0), kFrom + 30s, 25));
  std::vector<std::string> said;
  for (const auto& event : session.take_events())
    said.push_back(std::string{name(event.status.state)} + ": " + event.status.reason);

  EXPECT_THAT(said,
              testing::ElementsAre("warming: position 4 (1 of 8): touch ball 1, 25 points",
                                   "acquiring: position 4 (1 of 8): touch ball 1, 25 points",
                                   "acquiring: position 4 (1 of 8): touch block 1, 25 points",
                                   HasSubstr("the same place on ball 1 was touched twice"),
                                   "acquiring: position 4 (1 of 8): touch block 1, 25 points"));
  EXPECT_EQ(session.status().noted, 1u);
  EXPECT_EQ(session.status().method, "evemu");
}

TEST(CalibrationRequest, KeepsEveryBitOfATaskWithABallArray) {
  CalibrationRequest asked{request(), HostTime{std::chrono::nanoseconds{123456789}}};
  auto& evemu = std::get<EvemuRequest>(asked.task);
  evemu.calibrator.balls[3].centre_m.x() = 0.1 + 0.2;
  evemu.plan = {{2, 1}, 7, 6};
  evemu.rotation_reference =
      RotationPoints{{{.reading_m = {1.0 / 3, 0, 0}, .V_m = {0, 1e-7 / 3, 0}}}, 2e-6};
  evemu.sources = {{"calibrator.toml", "abc"}};
  const auto attachment = to_attachment(asked);

  EXPECT_TRUE(is_calibration_request(attachment.name));
  const auto read = from_attachment(attachment);
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_EQ(read->from, asked.from);
  const auto& again = std::get<EvemuRequest>(read->task);
  EXPECT_EQ(again.calibrator.balls[3].centre_m, evemu.calibrator.balls[3].centre_m);
  EXPECT_EQ(again.plan.positions, evemu.plan.positions);
  EXPECT_EQ(again.plan.points_per_block, 6u);
  EXPECT_EQ(again.rotation_reference->points[0].V_m, evemu.rotation_reference->points[0].V_m);
  EXPECT_EQ(again.sources, evemu.sources);
}

TEST(CalibrationRequest, NamesAnUnknownMethodAndWhatIsMissing) {
  const auto unknown = task_from_json({{"method", "magic"}});
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::Usage);
  EXPECT_THAT(unknown.error().text, HasSubstr("\"otf\", \"evemu\""));
  const auto lacking = task_from_json({{"method", "evemu"}});
  ASSERT_FALSE(lacking);
  EXPECT_THAT(lacking.error().text, HasSubstr("calibrator"));
}

}  // namespace
}  // namespace abbe::daemon
