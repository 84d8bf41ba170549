/// A controller is left as it was found.

#include "abbe/drivers/tracker/device.hpp"
#include "stepped_time.hpp"
#include "tracker_peer.hpp"

#include <gmock/gmock.h>

#include <array>
#include <set>

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using emscon::Status;
using testing::HasSubstr;

class TrackerSettingsTest : public testing::Test {
 protected:
  explicit TrackerSettingsTest(const sim::TrackerOptions& options = {})
      : peer_(time_.now(), options) {
    options_.host = "127.0.0.1";
    options_.port = peer_.port();
  }

  void make_device() { device_ = TrackerDevice::create(options_, time_).value(); }
  void cycle() {
    peer_.serve(time_.now());
    peer_.send_points();
    device_->wait(20ms);
    device_->receive();
    time_.advance(20ms);
  }
  bool reaches(std::string_view state) {
    for (int i = 0; i < 6000 && device_->status().state != state; ++i) cycle();
    return device_->status().state == state;
  }
  /// As the destructor does, whose waiting takes no time of a stepped clock.
  void leave() {
    for (int i = 0; i < 1000 && !device_->finish(); ++i) cycle();
    device_.reset();
    for (int i = 0; i < 3; ++i) peer_.serve(time_.now());
  }
  TrackerOrderReport order(TrackerOrder order) {
    device_->order(std::move(order));
    for (int i = 0; i < 6000; ++i) {
      if (const auto reports = device_->reports(); !reports.empty()) return reports.front();
      cycle();
    }
    return {};
  }

  /// Another program at the same controller, before or after abbe.
  emscon::Answer ask(const emscon::Request& request) {
    std::array<std::byte, emscon::kMaxRequestSize> bytes{};
    const std::size_t size = emscon::encode(request, bytes);
    auto& controller = peer_.controller();
    controller.connected(time_.now());
    controller.receive(std::span{bytes}.first(size), time_.now());
    time_.advance(5s);
    controller.advance(time_.now());
    const auto out = controller.take_output();
    controller.disconnected();
    emscon::PacketFramer framer;
    framer.push(out);
    while (const auto packet = framer.next())
      if (const auto answer = emscon::decode_answer(*packet)) return *answer;

    return emscon::Acknowledge{emscon::command_of(request), Status::Unknown};
  }

  tests::SteppedTime time_;
  tests::tracker::TrackerPeer peer_;
  TrackerDeviceOptions options_;
  std::unique_ptr<TrackerDevice> device_;
};

TEST_F(TrackerSettingsTest, AreRestoredWhenAbbeDisconnects) {
  emscon::SystemSettings settings;
  settings.apply_transformation = settings.has_nivel = settings.has_video_camera = true;
  settings.keep_last_position = settings.send_unsolicited_messages = false;
  ask(emscon::SetUnits{{emscon::LengthUnit::Inch, emscon::AngleUnit::Degree}});
  ask(emscon::SetSystemSettings{settings});
  ask(emscon::SetTransformation{{100, 200, 300}, {}, 1.0});
  ask(emscon::SetCoordinateSystemType{emscon::CoordinateSystem::LeftHandedX});
  ask(emscon::SetStatisticMode{emscon::StatisticMode::Extended, emscon::StatisticMode::Extended});
  ask(emscon::SetContinuousTimeModeParams{10, 500, false, {}});
  make_device();

  ASSERT_TRUE(reaches("streaming"));
  leave();
  EXPECT_FALSE(peer_.controller().streaming());
  EXPECT_EQ(std::get<emscon::UnitsAnswer>(ask(emscon::GetUnits{})).units.length,
            emscon::LengthUnit::Inch);
  const auto after =
      std::get<emscon::SystemSettingsAnswer>(ask(emscon::GetSystemSettings{})).settings;
  EXPECT_TRUE(after.apply_transformation && after.has_nivel && after.has_video_camera);
  EXPECT_FALSE(after.keep_last_position || after.send_unsolicited_messages);
  EXPECT_EQ(
      std::get<emscon::TransformationAnswer>(ask(emscon::GetTransformation{})).set.translation[2],
      300.0);
  EXPECT_EQ(
      std::get<emscon::CoordinateSystemTypeAnswer>(ask(emscon::GetCoordinateSystemType{})).set.type,
      emscon::CoordinateSystem::LeftHandedX);
  EXPECT_EQ(std::get<emscon::StatisticModeAnswer>(ask(emscon::GetStatisticMode{})).set.continuous,
            emscon::StatisticMode::Extended);
  EXPECT_EQ(std::get<emscon::MeasurementModeAnswer>(ask(emscon::GetMeasurementMode{})).set.mode,
            emscon::MeasurementMode::Stationary);
  EXPECT_EQ(
      std::get<emscon::ContinuousTimeModeParamsAnswer>(ask(emscon::GetContinuousTimeModeParams{}))
          .set.number_of_points,
      500);
}

TEST_F(TrackerSettingsTest, OfAnotherProgramDoNotReachThePoints) {
  ask(emscon::SetTransformation{{100, 200, 300}, {}, 1.0});
  emscon::SystemSettings settings;
  settings.apply_transformation = true;
  ask(emscon::SetSystemSettings{settings});
  make_device();

  ASSERT_TRUE(reaches("streaming"));
  for (int i = 0; i < 100; ++i) cycle();
  protocol::TrackerPoint point;
  ASSERT_EQ(device_->points().pop({&point, 1}), 1u);
  const auto seen =
      sim::observe(sim::TrackerModel{}, tests::tracker::standing_machine(), time_.now(), 0);
  for (std::size_t k = 0; k < 3; ++k)
    EXPECT_NEAR(point.p_tracker_m[k], seen.p_tracker_m[static_cast<Eigen::Index>(k)], 1e-3);
}

TEST_F(TrackerSettingsTest, ThatAreToBeRestoredSurviveALostConnection) {
  ask(emscon::SetUnits{{emscon::LengthUnit::Inch, emscon::AngleUnit::Degree}});
  make_device();
  ASSERT_TRUE(reaches("streaming"));
  peer_.hang_up();
  ASSERT_TRUE(reaches("disconnected"));
  ASSERT_TRUE(reaches("streaming"));
  leave();
  EXPECT_EQ(std::get<emscon::UnitsAnswer>(ask(emscon::GetUnits{})).units.length,
            emscon::LengthUnit::Inch);
}

TEST_F(TrackerSettingsTest, AreRestoredBeforeARefusedConnectionIsClosed) {
  ask(emscon::SetUnits{{emscon::LengthUnit::Inch, emscon::AngleUnit::Degree}});
  options_.session.reflector = "no such reflector";
  make_device();
  ASSERT_TRUE(reaches("faulted"));
  EXPECT_THAT(device_->status().last_fault, HasSubstr("\"SMR 1.5 inch\" (0)"));
  peer_.hang_up();
  EXPECT_EQ(std::get<emscon::UnitsAnswer>(ask(emscon::GetUnits{})).units.length,
            emscon::LengthUnit::Inch);
}

TEST_F(TrackerSettingsTest, AMuteControllerIsDisconnectedWithoutRestoring) {
  make_device();
  ASSERT_TRUE(reaches("streaming"));
  peer_.controller().inject({sim::FaultKind::Mute, 0.0, 60.0, 0.0, 0}, time_.now());
  const auto begin = time_.now();
  leave();
  EXPECT_LE(time_.now() - begin, options_.session.leave_within + 100ms);
}

/// Whose beam is dropped by Initialize, and brought back a minute later.
class CarriedReflector : public TrackerSettingsTest {
 protected:
  CarriedReflector() : TrackerSettingsTest(carried()) {}
  static sim::TrackerOptions carried() {
    sim::TrackerOptions o;
    o.fetch_beam = 60s;
    return o;
  }
};

TEST_F(CarriedReflector, IsWaitedForAfterInitializeWithTheCauseNamed) {
  make_device();
  ASSERT_TRUE(reaches("waiting for the beam"));
  EXPECT_THAT(device_->status().last_fault, HasSubstr("no distance set (37)"));
  EXPECT_TRUE(device_->status().connected);
  ASSERT_TRUE(reaches("streaming"));
  EXPECT_EQ(device_->status().faults, 0u);
  EXPECT_EQ(peer_.controller().initializations(), 1u);
}

TEST_F(CarriedReflector, KeepsItsBeamThroughALostConnection) {
  make_device();
  ASSERT_TRUE(reaches("streaming"));
  for (int i = 0; i < 5; ++i) {
    peer_.hang_up();
    ASSERT_TRUE(reaches("disconnected"));
    ASSERT_TRUE(reaches("streaming"));
  }
  EXPECT_EQ(peer_.controller().initializations(), 1u);
}

TEST_F(CarriedReflector, IsFoundOnOrder) {
  make_device();
  ASSERT_TRUE(reaches("waiting for the beam"));
  const auto report = order({TrackerOrder::What::FindReflector, 5, "", 1.2});
  EXPECT_TRUE(report.done()) << report.text;
  EXPECT_EQ(report.number, 5u);
  ASSERT_TRUE(reaches("streaming"));
  EXPECT_EQ(peer_.controller().beam_moves(), 1u);
  EXPECT_EQ(peer_.controller().initializations(), 1u);
}

TEST_F(TrackerSettingsTest, EveryOrderIsReportedAlsoIfAnotherFollows) {
  make_device();
  ASSERT_TRUE(reaches("streaming"));
  std::set<std::uint64_t> reported;

  const auto take = [&] {
    for (const auto& report : device_->reports()) reported.insert(report.number);
  };

  for (std::uint64_t number = 1; number <= 200; ++number) {
    device_->order({TrackerOrder::What::GoHome, number, "", 0.0});
    cycle();
    take();
  }

  ASSERT_TRUE(reaches("streaming"));
  take();
  EXPECT_EQ(reported.size(), 200u);
}

TEST_F(TrackerSettingsTest, AReflectorSetOnOrderStays) {
  make_device();
  ASSERT_TRUE(reaches("streaming"));
  const auto list = order({TrackerOrder::What::ListReflectors, 1, "", 0.0});

  ASSERT_EQ(list.reflectors.size(), 3u);
  EXPECT_TRUE(list.reflectors[0].in_use);
  EXPECT_TRUE(order({TrackerOrder::What::SetReflector, 2, list.reflectors[2].name, 0.0}).done());
  ASSERT_TRUE(reaches("streaming"));
  const auto unknown = order({TrackerOrder::What::SetReflector, 3, "no such", 0.0});
  EXPECT_FALSE(unknown.done());
  EXPECT_THAT(unknown.text, HasSubstr("known are"));
  ASSERT_TRUE(reaches("streaming"));
  leave();
  EXPECT_EQ(std::get<emscon::ReflectorAnswer>(ask(emscon::GetReflector{})).internal_id,
            list.reflectors[2].id);
}

}  // namespace
}  // namespace abbe::drivers
