/// `abbe tracker`: the daemon, a simulated tracker on its TCP port, and clients on the
/// control socket.

#include <gmock/gmock.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "abbe/base/control_protocol.hpp"
#include "abbe/calib/otf/plan/plan.hpp"
#include "abbe/service/abbed.hpp"
#include "abbe/sim/tracker_server.hpp"
#include "abbe_command.hpp"
#include "config_tables.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr auto kReplyPatience = 60s;

sim::VirtualMachine machine_at_rest() {
  sim::PathPlan plan;
  plan.vertices = {{{0.1, 0.2, 0.3}}};
  return {sim::TruthMachine{}, sim::PathMotion::plan(plan).value()};
}

/// A simulated tracker on a port, with a thread of its own.
class ServedTracker {
 public:
  explicit ServedTracker(const sim::TrackerOptions& options)
      : server_(sim::TrackerServer::open(
                    0, std::make_unique<sim::TrackerDevice>(options, machine_, time_.now()))
                    .value()),
        thread_([this] { serve(); }) {}
  ServedTracker(const ServedTracker&) = delete;
  ServedTracker& operator=(const ServedTracker&) = delete;
  ~ServedTracker() {
    stopping_ = true;
    thread_.join();
  }

  [[nodiscard]] std::uint16_t port() const { return server_.port(); }
  void inject(sim::FaultKind kind) {
    const std::lock_guard lock{mutex_};
    server_.device().inject({.kind = kind, .duration_s = 1e6}, time_.now());
  }
  [[nodiscard]] std::uint64_t initializations() const {
    const std::lock_guard lock{mutex_};
    return server_.device().initializations();
  }
  [[nodiscard]] std::uint64_t beam_moves() const {
    const std::lock_guard lock{mutex_};
    return server_.device().beam_moves();
  }

 private:
  void serve() {
    for (; !stopping_; std::this_thread::sleep_for(1ms)) {
      const std::lock_guard lock{mutex_};
      server_.poll(time_.now());
    }
  }

  drivers::MonotonicTime time_;
  sim::VirtualMachine machine_ = machine_at_rest();
  mutable std::mutex mutex_;
  sim::TrackerServer server_;
  std::atomic<bool> stopping_{false};
  std::thread thread_;
};

class TrackerControl : public ::testing::Test {
 protected:
  static sim::TrackerOptions quick() {
    sim::TrackerOptions options;
    options.initialize_time = 100ms;
    return options;
  }

  [[nodiscard]] std::string config_text(std::optional<std::uint16_t> port,
                                        const std::string& more) const {
    const std::string tracker = port
                                    ? to_toml(config_tables::Tracker{
                                          .port = *port, .more = "silence_timeout_s = 60\n" + more})
                                    : "";
    return to_toml(config_tables::half_metre_mill()) + tracker + to_toml(config_tables::Encoder{}) +
           std::string{config_tables::kDaemonInItsFolder} +
           "[dds]\nsupervise = \"off\"\n[recording]\nmin_free_MB = 0\n";
  }
  /// A computer that is busy with other tests is given time.
  static inline const std::string kPatient = "command_timeout_s = 60\n";
  void start_daemon(std::optional<std::uint16_t> port, const std::string& more = kPatient) {
    const auto config = parse_config(config_text(port, more), folder_.path() / "abbed.toml");
    ASSERT_TRUE(config) << config.error().details.front();
    socket_ = config->control.socket;
    auto started = Abbed::start(*config, {});
    ASSERT_TRUE(started) << started.error().text;
    abbed_ = std::move(*started);
  }
  /// A daemon that gets points from a simulated tracker.
  void start_measuring(const std::string& more = kPatient) {
    tracker_.emplace(quick());
    ASSERT_NO_FATAL_FAILURE(start_daemon(tracker_->port(), more));
    ASSERT_TRUE(reaches("streaming"));
  }

  [[nodiscard]] Result<json> ask(const json& request) const {
    return ask_daemon(socket_, request, kReplyPatience);
  }
  [[nodiscard]] std::string refusal_of(const json& request) const {
    const auto answer = ask(request);
    return answer ? "" : answer.error().text;
  }
  [[nodiscard]] json tracker() const {
    const auto status = ask({{"do", "status"}});
    return status ? status->value("tracker", json::object()) : json::object();
  }
  [[nodiscard]] bool reaches(const std::string& state) const {
    const auto end = std::chrono::steady_clock::now() + kReplyPatience;
    while (tracker().value("state", "") != state && std::chrono::steady_clock::now() < end)
      std::this_thread::sleep_for(5ms);
    return tracker().value("state", "") == state;
  }
  /// Its element of "orders", once it has ended; else null.
  [[nodiscard]] json carried_out(const json& request) const {
    const auto given = ask(request);
    if (!given) return {};
    const auto end = std::chrono::steady_clock::now() + kReplyPatience;
    while (std::chrono::steady_clock::now() < end) {
      for (const json& order : tracker().value("orders", json::array()))
        if (order["number"] == (*given)["order"] && order["outcome"] != "running") return order;
      std::this_thread::sleep_for(5ms);
    }
    return {};
  }
  [[nodiscard]] test::Ran abbe(const std::string& command) const {
    return test::run_abbe(folder_.path(),
                          fmt::format("tracker {} --socket '{}'", command, socket_.string()));
  }

  static inline const json kHome{{"do", "tracker"}, {"order", "home"}};
  static json find(const json& distance_m) {
    return {{"do", "tracker"}, {"order", "find"}, {"distance_m", distance_m}};
  }
  static json set_reflector(const std::string& name) {
    return {{"do", "tracker"}, {"order", "reflector set"}, {"reflector", name}};
  }
  /// A path that determines the model of half_metre_mill(). Edges and diagonals of a cube do not:
  /// errors that are the same in EXX, EYY and EZZ displace no point across its leg. So a part of
  /// the volume with three different lengths follows.
  static json calibrate() {
    const auto long_m = *calib::equidistant_nodes(0.0, 0.5),
               medium_m = *calib::equidistant_nodes(0.0, 0.4),
               short_m = *calib::equidistant_nodes(0.0, 0.3);
    json path = json::array();
    for (const calib::MachineNodes& box :
         {calib::MachineNodes{long_m, long_m, long_m}, {long_m, medium_m, short_m}})
      for (const auto& q : calib::otf::base_path(box).vertices_m)
        path.push_back({q.x(), q.y(), q.z()});
    return {{"do", "calibrate"}, {"method", "otf"}, {"path_m", path}};
  }
  static inline const json kCalibrate = calibrate();

  TemporaryFolder folder_;
  std::filesystem::path socket_;
  std::optional<ServedTracker> tracker_;
  std::unique_ptr<Abbed> abbed_;
};

TEST_F(TrackerControl, AirThatTheControllerWasSetToIsNotShownAsMeasured) {
  ASSERT_NO_FATAL_FAILURE(start_measuring(kPatient + "weather = \"none\"\n"));
  const auto status = ask({{"do", "status"}});
  ASSERT_TRUE(status);
  EXPECT_FALSE(status->contains("environment")) << (*status)["environment"];
  EXPECT_THAT(status->value("unmeasured_air", ""), testing::HasSubstr("20 C, 1013.25 hPa, 50 %"));
}

TEST_F(TrackerControl, AnOrderIsCarriedOutAndTheMeasurementGoesOn) {
  ASSERT_NO_FATAL_FAILURE(start_measuring());
  EXPECT_EQ(carried_out({{"do", "tracker"}, {"order", "initialize"}})["text"],
            "the tracker is initialised");
  ASSERT_TRUE(reaches("streaming"));
  EXPECT_EQ(tracker_->initializations(), 2u);
  EXPECT_EQ(carried_out(kHome)["outcome"], "done");
  ASSERT_TRUE(reaches("streaming"));
  EXPECT_EQ(carried_out(find(0.7))["text"], "the reflector was found");
  EXPECT_EQ(tracker_->beam_moves(), 2u);
  EXPECT_TRUE(reaches("streaming"));
}

TEST_F(TrackerControl, ReflectorsAreListedAndSet) {
  ASSERT_NO_FATAL_FAILURE(start_measuring());
  const json list = carried_out({{"do", "tracker_reflectors"}});
  ASSERT_EQ(list.value("reflectors", json::array()).size(), 3u) << list;
  EXPECT_EQ(list["reflectors"][0], json({{"id", 0}, {"name", "SMR 1.5 inch"}, {"in_use", true}}));
  EXPECT_EQ(carried_out(set_reflector("Cat eye 75 mm"))["outcome"], "done");
  ASSERT_TRUE(reaches("streaming"));
  EXPECT_EQ(carried_out(set_reflector("1"))["outcome"], "done");
  ASSERT_TRUE(reaches("streaming"));
  EXPECT_EQ(carried_out({{"do", "tracker_reflectors"}})["reflectors"][1]["in_use"], true);
}

TEST_F(TrackerControl, AnUnknownReflectorIsRefusedWithTheKnownOnes) {
  ASSERT_NO_FATAL_FAILURE(start_measuring());
  const json order = carried_out(set_reflector("SMR 7 inch"));
  EXPECT_EQ(order["outcome"], "refused");
  EXPECT_THAT(order["text"].get<std::string>(),
              AllOf(HasSubstr("SMR 7 inch"), HasSubstr("\"Cat eye 75 mm\" (4)")));
  EXPECT_TRUE(reaches("streaming"));
}

TEST_F(TrackerControl, WhatTheTrackerRefusesIsReportedAsItsRefusal) {
  ASSERT_NO_FATAL_FAILURE(start_measuring());
  tracker_->inject(sim::FaultKind::ReflectorAway);
  const json order = carried_out(find(0.7));
  EXPECT_EQ(order["outcome"], "refused");
  EXPECT_EQ(order["text"], "FindReflector was refused: no distance set (37)");
  EXPECT_TRUE(reaches("waiting for the beam"));
}

TEST_F(TrackerControl, AnOrderWithoutAnAnswerIsReportedAsTimedOut) {
  ASSERT_NO_FATAL_FAILURE(start_measuring("command_timeout_s = 1\n"));
  tracker_->inject(sim::FaultKind::Mute);
  const json order = carried_out(kHome);
  EXPECT_EQ(order["outcome"], "failed");
  EXPECT_THAT(order["text"].get<std::string>(), HasSubstr("no answer to"));
}

TEST_F(TrackerControl, AnInvalidOrderIsRefusedBeforeItIsSent) {
  ASSERT_NO_FATAL_FAILURE(start_measuring());
  for (const json& distance : json::parse(R"([0, -1, 2500, null, "far"])")) {
    const auto answer = ask(find(distance));
    ASSERT_FALSE(answer) << distance;
    EXPECT_EQ(answer.error().code, ErrorCode::Usage);
    EXPECT_THAT(answer.error().text,
                HasSubstr("find: the distance must be above 0 and at most 200 m"));
  }
  EXPECT_THAT(refusal_of(set_reflector("")), HasSubstr("1 to 96 bytes"));
  EXPECT_THAT(refusal_of(set_reflector(std::string(97, 'x'))), HasSubstr("1 to 96 bytes"));
  EXPECT_THAT(refusal_of({{"do", "tracker"}, {"order", "reflector list"}}),
              HasSubstr("known are initialize"));
  EXPECT_NE(refusal_of({{"do", "tracker"}}), "");
  EXPECT_NE(refusal_of({{"do", "tracker"}, {"order", "reflector set"}, {"reflector", 4}}), "");
  EXPECT_EQ(tracker()["orders"], json::array());
}

TEST_F(TrackerControl, OrdersAreRefusedWhileACalibrationTakesReadings) {
  ASSERT_NO_FATAL_FAILURE(start_measuring());
  ASSERT_TRUE(ask(kCalibrate));
  for (const json& request :
       {kHome, find(1.0), set_reflector("1"), json{{"do", "tracker_reflectors"}}}) {
    const auto answer = ask(request);
    ASSERT_FALSE(answer) << request;
    EXPECT_EQ(answer.error().code, ErrorCode::Refused);
    EXPECT_THAT(answer.error().text, HasSubstr("a calibration takes readings"));
  }
  ASSERT_TRUE(ask({{"do", "cancel"}}));
  EXPECT_EQ(carried_out(kHome)["outcome"], "done");
}

TEST_F(TrackerControl, OneOrderIsCarriedOutAtATimeAndNoRunBeginsDuringIt) {
  ASSERT_NO_FATAL_FAILURE(start_measuring());
  tracker_->inject(sim::FaultKind::Mute);
  ASSERT_TRUE(ask(kHome));
  EXPECT_THAT(refusal_of(find(1.0)), AllOf(HasSubstr("\"home\" of "), HasSubstr("is under way")));
  EXPECT_THAT(refusal_of(kCalibrate), HasSubstr("the tracker carries out \"home\""));
}

TEST_F(TrackerControl, OrdersToATrackerThatIsNotConnectedAreRefused) {
  ASSERT_NO_FATAL_FAILURE(start_daemon(1));
  EXPECT_THAT(refusal_of(kHome), HasSubstr("home: the tracker is not connected: "));
  EXPECT_THAT(refusal_of({{"do", "tracker_reflectors"}}), HasSubstr("not connected"));
}

TEST_F(TrackerControl, OrdersWithoutATrackerAreRefused) {
  ASSERT_NO_FATAL_FAILURE(start_daemon(std::nullopt));
  EXPECT_THAT(refusal_of(kHome),
              HasSubstr("there is no tracker, [tracker] host, in the configuration"));
  const auto shown = abbe("status");
  EXPECT_EQ(shown.exit, 5);
  EXPECT_THAT(shown.err, HasSubstr("has no tracker"));
}

TEST_F(TrackerControl, TheConfiguredReflectorIsSetAndTheBeamSentHomeAfterInitialize) {
  ASSERT_NO_FATAL_FAILURE(
      start_measuring(kPatient + "reflector = \"Cat eye 75 mm\"\nhome_after_initialize = true\n"
                                 "search_radius_mm = 30\nsearch_timeout_s = 5\n"));
  EXPECT_EQ(tracker_->beam_moves(), 1u);
  EXPECT_EQ(carried_out({{"do", "tracker_reflectors"}})["reflectors"][2]["in_use"], true);
}

TEST_F(TrackerControl, TheCommandSendsOrdersAndPrintsTheirResults) {
  ASSERT_NO_FATAL_FAILURE(start_measuring());
  const auto list = abbe("reflector list");

  EXPECT_EQ(list.exit, 0) << list.err;
  EXPECT_THAT(list.out, AllOf(HasSubstr("the controller lists 3 reflectors"),
                              HasSubstr("   0  SMR 1.5 inch                      in use")));
  const auto set = abbe("reflector set 'SMR 0.5 inch'");
  EXPECT_EQ(set.exit, 0) << set.err;
  EXPECT_THAT(set.out, HasSubstr("reflector SMR 0.5 inch is set"));
  ASSERT_TRUE(reaches("streaming"));
  EXPECT_EQ(abbe("find --distance-m 0.7").out, "the reflector was found\n");
  ASSERT_TRUE(reaches("streaming"));
  const auto unknown = abbe("reflector set 7");
  EXPECT_EQ(unknown.exit, 5);
  EXPECT_THAT(unknown.err, HasSubstr("reflector \"7\" is not in the controller's list"));
  EXPECT_EQ(abbe("find --distance-m 0").exit, 2);
  EXPECT_EQ(abbe("find").exit, 2);
  ASSERT_TRUE(reaches("streaming"));
  EXPECT_THAT(abbe("status").out, AllOf(HasSubstr("tracker    streaming"), HasSubstr(" find of "),
                                        HasSubstr(": refused: reflector \"7\"")));
}

}  // namespace
}  // namespace abbe::daemon
