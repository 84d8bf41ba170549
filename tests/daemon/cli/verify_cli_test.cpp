/// `abbe verify`: the built program on models of two methods, its files and exit codes.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/wait.h>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>

#include "abbe/base/control_protocol.hpp"
#include "config_tables.hpp"
#include "recording_fixture.hpp"
#include "synthetic_model.hpp"
#include "verify_cli_fixture.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
namespace study = tests::evemu;
using test::Ran;
using test::text_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

TEST_F(VerifyCli, ReportsTheResidualErrorOfAModel) {
  const auto ran = abbe("verify model.json --points verification.csv --json");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto summary = nlohmann::json::parse(ran.out);
  EXPECT_EQ(summary["points"], 8 * 6 * 6);
  EXPECT_LT(summary["after"]["rms_um"].get<double>(),
            0.1 * summary["before"]["rms_um"].get<double>());
  EXPECT_EQ(summary["effect"], "better");
  EXPECT_NE(summary.contains("R_turned"), summary.contains("R_not_given"));
}

TEST_F(VerifyCli, WritesAReportThatNeedsNoNetwork) {
  const auto ran =
      abbe("verify model.json --points verification.csv --planes-mm 366.667,50,33.333 -o out");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out,
              AllOf(StartsWith("verdict     better with the model"), HasSubstr("R_resmag")));
  const auto page = text_of(folder_ / "out/report.html");
  EXPECT_THAT(page, AllOf(HasSubstr("Vectors in three planes"), HasSubstr("rigid motion"),
                          HasSubstr("weak portal"), Not(HasSubstr("src=\"http"))));
  EXPECT_THAT(text_of(folder_ / "out/grid.csv"), StartsWith("x_mm,y_mm,z_mm,las_x_um,"));
}

TEST_F(VerifyCli, TakesAModelOfTables) {
  const auto document = test::synthetic_document(3);
  write("tables.json", to_json(document));
  write("points.csv", to_verification_csv(points_of(document)));
  const auto ran = abbe("verify tables.json --points points.csv --json");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto summary = nlohmann::json::parse(ran.out);
  EXPECT_LT(summary["after"]["max_um"].get<double>(), 1e-3);
  EXPECT_GT(summary["before"]["max_um"].get<double>(), 1.0);
}

TEST_F(VerifyCli, NamesTheLineOfAPointThatAloneDoesNotFit) {
  auto points = tracker_points(study::table3_machine());
  for (const calib::Vector3& wrong_m :
       {calib::Vector3(0, 0, 0), calib::Vector3(-9.999, -9.999, -9.999),
        calib::Vector3(1e27, 1e27, 1e27)}) {
    points[7].measured_m = wrong_m;
    write("off.csv", to_verification_csv(points));
    const auto ran = abbe("verify model.json --points off.csv");
    EXPECT_THAT(ran.out + ran.err, HasSubstr("off.csv:9: alone does not fit"))
        << wrong_m.transpose();
    EXPECT_THAT(ran.out + ran.err, Not(HasSubstr("off.csv:10"))) << wrong_m.transpose();
  }
  const auto right = abbe("verify model.json --points verification.csv --json");
  EXPECT_TRUE(nlohmann::json::parse(right.out)["points_off"].empty());
}

TEST_F(VerifyCli, NamesTheLineOfAPointThatIsOffByHalfAMillimetre) {
  const auto document = test::synthetic_document(3);
  write("tables.json", to_json(document));
  auto points = points_of(document);
  points[7].measured_m.x() += 0.5e-3;
  write("off.csv", to_verification_csv(points));
  const auto ran = abbe("verify tables.json --points off.csv");
  EXPECT_THAT(ran.out + ran.err, HasSubstr("off.csv:9: alone does not fit"));
  EXPECT_THAT(ran.out + ran.err, Not(HasSubstr("off.csv:10")));
}

TEST_F(VerifyCli, PrintsJsonAlsoForFileNamesInLatin1) {
  const std::string name = "b\xfc.json";
  fs::copy_file(folder_ / "model.json", folder_ / name);
  const auto ran = abbe("verify model.json '" + name + "' --points verification.csv --json");
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_EQ(nlohmann::json::parse(ran.out)["models"][1]["name"], "b\xef\xbf\xbd.json");
}

TEST_F(VerifyCli, ComparesSeveralModelsAtTheSamePoints) {
  const auto good = test::synthetic_document(3), other = test::synthetic_document(4);
  write("good.json", to_json(good));
  write("other.json", to_json(other));
  const auto tool = good.model.tool_offsets_m().front();
  std::vector<calib::verify::MeasuredPoint> points{{{1.0, 0.0, -0.2}, {1.0, 0.0, -0.2}}};
  for (int i = 0; i < 64; ++i) {
    const calib::Vector3 q(-0.3 + 0.2 * (i % 4), -0.3 + 0.2 * (i / 4 % 4), -0.4 + 0.1 * (i / 16));
    points.push_back({q, q + tool + good.model.V_at(q, tool)});
  }
  points.front().measured_m += tool;
  write("points.csv", to_verification_csv(points));

  const auto ran = abbe("verify good.json other.json --points points.csv --json");
  ASSERT_EQ(ran.exit, 8) << ran.err;
  const auto object = nlohmann::json::parse(ran.out);
  EXPECT_EQ(object["points"], 65);
  EXPECT_EQ(object["inside_all"], 64);
  EXPECT_LT(object["models"][0]["after"]["max_um"].get<double>(), 1e-3);
  EXPECT_EQ(object["models"][0]["effect"], "better");
  EXPECT_EQ(object["models"][1]["effect"], "worse");
  EXPECT_THAT(abbe("verify good.json other.json --points points.csv").out,
              AllOf(HasSubstr("at 64 of 65 places"), HasSubstr("without a model"),
                    HasSubstr("other.json")));
  for (const char* option : {"-o out", "--grid-mm 1,1,1", "--origin-mm 0,0,0", "--planes-mm 0,0,0",
                             "--least-distance-mm 1"}) {
    const auto refused =
        abbe(fmt::format("verify good.json other.json --points points.csv {}", option));
    EXPECT_EQ(refused.exit, 2) << option;
    EXPECT_THAT(refused.err, HasSubstr("is for one model")) << option;
  }
}

/// Nodes every 50 mm, points farther apart: what interpolating between them costs is far above
/// 0.09 um.
std::string points_of_tables(const ModelDocument& document, double factor) {
  std::vector<calib::verify::MeasuredPoint> points;
  const auto tool = document.model.tool_offsets_m().front();
  for (int i = 0; i < 343; ++i) {
    const calib::Vector3 q(-0.3 + 0.1 * (i % 7), -0.3 + 0.1 * (i / 7 % 7), -0.4 + 0.05 * (i / 49));
    const calib::Vector3 noise =
        0.05e-6 * calib::Vector3(std::sin(7.0 * i), std::sin(11.0 * i), std::sin(13.0 * i));
    points.push_back({q, q + tool + factor * document.model.V_at(q, tool) + noise});
  }
  return to_verification_csv(points);
}

TEST_F(VerifyCli, GivesNoRatioForAGoodModelOnACoarseGrid) {
  const auto document = test::synthetic_document(3);
  write("tables.json", to_json(document));
  write("points.csv", points_of_tables(document, 1.0));
  const auto ran = abbe("verify tables.json --points points.csv");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, AllOf(StartsWith("verdict     better with the model: 0.0"),
                             HasSubstr("\nR_resmag    not given: the error of interpolating"),
                             Not(HasSubstr("above 1"))));
}

TEST_F(VerifyCli, ReportsFirstThatABadModelIncreasesTheError) {
  const auto document = test::synthetic_document(3);
  write("tables.json", to_json(document));
  write("points.csv", points_of_tables(document, -1.0));
  const auto ran = abbe("verify tables.json --points points.csv -o out");
  ASSERT_EQ(ran.exit, 8) << ran.err;
  EXPECT_THAT(ran.out, StartsWith("verdict     WORSE with the model: do not use it"));
  const auto page = text_of(folder_ / "out/report.html");
  EXPECT_LT(page.find("WORSE with the model"), page.find("Residuals at the measured places"));
}

TEST_F(VerifyCli, StatesShotsAndPlaces) {
  const auto document = test::synthetic_document(3);
  write("tables.json", to_json(document));
  auto points = points_of(document);
  for (int i = 0; i < 5; ++i) {
    points.push_back(points[7]);
    points.back().measured_m.x() += 1e-6 * (i + 1);
  }
  write("shots.csv", to_verification_csv(points));
  const auto ran = abbe("verify tables.json --points shots.csv -o out");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out,
              HasSubstr("points      348 shots at 343 places, 1 to 6 each; their standard"));
  EXPECT_THAT(text_of(folder_ / "out/report.html"),
              AllOf(HasSubstr("348 shots at 343 places"), HasSubstr("(6 shots)")));
  const auto object =
      nlohmann::json::parse(abbe("verify tables.json --points shots.csv --json").out);
  EXPECT_EQ(object["points"], 348);
  EXPECT_EQ(object["places"], 343);
  EXPECT_GT(object["repeatability_um"].get<double>(), 0.5);
}

TEST_F(VerifyCli, RefusesModelsOfDifferentMachines) {
  auto document = test::synthetic_document(3);
  write("a.json", to_json(document));
  write("points.csv", to_verification_csv(points_of(document)));
  document.machine = "another mill";
  write("b.json", to_json(document));
  for (const std::string command : {"verify a.json b.json --points points.csv",
                                    "model compare a.json b.json", "model drift a.json b.json"}) {
    const auto refused = abbe(command);
    EXPECT_EQ(refused.exit, 2) << command;
    EXPECT_THAT(refused.err,
                AllOf(HasSubstr("b.json of \"another mill\""), HasSubstr("--other-machine")));
    const auto meant = abbe(command + " --other-machine");
    EXPECT_EQ(meant.exit, 0) << meant.err;
    EXPECT_THAT(meant.out, HasSubstr("different machines: a.json is of machine")) << command;
    EXPECT_THAT(abbe(command + " --other-machine --json").out, HasSubstr("another mill"));
  }
  const auto several = nlohmann::json::parse(
      abbe("verify a.json b.json --points points.csv --other-machine --json").out);
  EXPECT_THAT(several.at("different_machines").get<std::string>(), HasSubstr("b.json of "));
  EXPECT_TRUE(several.at("repeatability_um").is_null()) << "one shot of each place";
}

std::string watched_portal() {
  auto machine = config_tables::weak_portal();
  return to_toml(machine) + "[tracker]\nhost = \"127.0.0.1\"\nmode = \"stationary\"\n" +
         to_toml(config_tables::Encoder{});
}

/// Three seconds at every point, the next one reached at once.
void record_standstills(const fs::path& folder,
                        const std::vector<calib::verify::MeasuredPoint>& points) {
  using namespace std::chrono_literals;
  RecordingInfo info = example_info();
  info.configuration = watched_portal();
  auto recorder = Recorder::open(example_options(folder), info, Recorder::WallTime{});
  ASSERT_TRUE(recorder) << recorder.error().text;
  constexpr int kSteps = 30;  // of 100 ms

  for (std::size_t i = 0; i < kSteps * points.size(); ++i) {
    const auto& p = points[i / kSteps];
    protocol::AxisSample axes;
    axes.head.time = protocol::HostTime{1000s + static_cast<std::int64_t>(i) * 100ms};
    axes.axis_count = 3;
    std::copy_n(p.reading_m.data(), 3, axes.position.begin());

    if (i % (kSteps * 20) == 0) recorder->flush();  // twenty points a chunk
    recorder->record(axes, "encoder");
    if (i % 5 != 2) continue;
    protocol::TrackerPoint seen;
    seen.head.time = axes.head.time + 20ms;
    seen.device_time = protocol::DeviceTime{seen.head.time.time_since_epoch()};
    std::copy_n(p.measured_m.data(), 3, seen.p_tracker_m.begin());
    recorder->record(seen, "tracker");
  }

  ASSERT_TRUE(recorder->close());
}

TEST_F(VerifyCli, TakesTheStandstillsOfARecording) {
  const auto points = tracker_points(study::table3_machine());
  record_standstills(folder_, points);
  const auto ran = abbe("verify model.json --recording run.mcap --json -o out");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_EQ(nlohmann::json::parse(ran.out)["points"], points.size());

  const auto left_um = [&](const Ran& r) {
    return nlohmann::json::parse(r.out)["after"]["rms_um"].get<double>();
  };

  constexpr double kRounding = 1e-6;  // um: m to mm and back, through a rotation of metres
  for (const auto* file : {"verification.csv", "out/verification.csv"}) {
    const auto again = abbe(fmt::format("verify model.json --points {} --json", file));
    ASSERT_EQ(again.exit, 0) << again.err;
    EXPECT_NEAR(left_um(again), left_um(ran), kRounding) << file;
  }
}

TEST_F(VerifyCli, RefusesARecordingOfAnotherMachine) {
  record_standstills(folder_, tracker_points(study::table3_machine()));
  const auto document = test::synthetic_document(3);
  write("tables.json", to_json(document));
  const auto refused = abbe("verify tables.json --recording run.mcap -o kept");
  EXPECT_EQ(refused.exit, 2);
  EXPECT_THAT(refused.err, HasSubstr("run.mcap of \"weak portal\""));
  EXPECT_FALSE(fs::exists(folder_ / "kept"));
}

TEST_F(VerifyCli, ADamagedRecordingShowsItsResultAndEndsWithOne) {
  const auto points = tracker_points(study::table3_machine());
  record_standstills(folder_, points);
  damage_chunk(folder_ / "run.mcap", 5);
  const auto ran = abbe("verify model.json --recording run.mcap --json -o out");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, HasSubstr("the recording is damaged: chunk 6"));
  const auto summary = nlohmann::json::parse(ran.out);
  EXPECT_LT(summary["points"], points.size());
  EXPECT_THAT(summary["cut_short"].get<std::string>(),
              HasSubstr("the recording is damaged: chunk 6"));
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("the recording is damaged: chunk 6"));
}

/// A daemon that has found `points`.
std::unique_ptr<ControlServer> daemon_with(
    const fs::path& socket, const std::vector<calib::verify::MeasuredPoint>& points) {
  return std::move(*ControlServer::open(socket, [points](const nlohmann::json& request,
                                                         const ControlPeer&) {
    const auto list = [](const calib::Vector3& v) { return nlohmann::json{v.x(), v.y(), v.z()}; };
    if (request.at("step") == "begin")
      return nlohmann::json{{"ok", true}, {"number", 7}, {"machine", "weak portal"}};
    EXPECT_EQ(request.at("number"), 7);
    const auto from = request.at("from").get<std::size_t>();
    nlohmann::json found = nlohmann::json::array();
    for (std::size_t i = from; i < points.size(); ++i)
      found.push_back({{"reading_m", list(points[i].reading_m)},
                       {"tracker_m", list(points[i].measured_m)},
                       {"tracker_points", 4},
                       {"scatter_m", 1e-6}});
    return nlohmann::json{{"ok", true}, {"standing", 0}, {"points", found}};
  }));
}

TEST_F(VerifyCli, CollectsThePointsOfTheRunningDaemon) {
  const auto points = tracker_points(study::table3_machine());
  const auto server = daemon_with(folder_ / "control.sock", points);
  const auto ran = abbe(fmt::format(
      "verify model.json --live --socket control.sock --count {} --json -o out", points.size()));
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.err, HasSubstr(fmt::format("{}: ", points.size())));
  EXPECT_EQ(nlohmann::json::parse(ran.out)["points"], points.size());
  EXPECT_EQ(text_of(folder_ / "out/verification.csv"), text_of(folder_ / "verification.csv"));
}

TEST_F(VerifyCli, CollectsNoPointsOfAnotherMachine) {
  const auto points = tracker_points(study::table3_machine());
  const auto server = daemon_with(folder_ / "control.sock", points);
  write("tables.json", to_json(test::synthetic_document(3)));
  const auto ran = abbe("verify tables.json --live --socket control.sock --count 5 -o out");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, HasSubstr("the daemon of \"weak portal\""));
  EXPECT_FALSE(fs::exists(folder_ / "out/verification.csv"));
}

TEST_F(VerifyCli, KeepsCollectedPointsThatAllowNoResult) {
  auto points = tracker_points(study::table3_machine());
  points.resize(3);
  const auto server = daemon_with(folder_ / "control.sock", points);
  EXPECT_EQ(abbe("verify model.json --live --socket control.sock --count 3 -o out").exit, 1);
  EXPECT_TRUE(fs::exists(folder_ / "out/verification.csv"));
  EXPECT_EQ(abbe("verify model.json --live --socket control.sock").exit,
            2);  // nowhere to keep them
}

TEST_F(VerifyCli, ReportsThatTheDaemonStoppedAndEvaluatesThePointsCollected) {
  const auto points = tracker_points(study::table3_machine());
  const auto live = daemon_with(folder_ / "live.sock", points);

  // Sends all its points, then reports that no collection runs, as a daemon that restarted.
  const auto server = std::move(*ControlServer::open(
      folder_ / "control.sock",
      [&](const nlohmann::json& request, const ControlPeer&) -> nlohmann::json {
        if (request.at("step") != "begin" && request.at("from") == points.size())
          return {{"ok", false}, {"code", "refused"}, {"error", "no points are being collected"}};
        return ask_daemon(folder_ / "live.sock", request).value();
      }));
  const auto ran = abbe("verify model.json --live --socket control.sock --json -o out");
  EXPECT_EQ(ran.exit, 4) << ran.err;
  EXPECT_THAT(ran.err, HasSubstr(fmt::format("after {} points", points.size())));
  EXPECT_EQ(nlohmann::json::parse(ran.out)["points"], points.size());
  EXPECT_TRUE(fs::exists(folder_ / "out/report.html"));
}

TEST_F(VerifyCli, KeepsPointsAsTheyComeWhateverEndsIt) {
  const auto points = tracker_points(study::table3_machine());
  const auto server = daemon_with(folder_ / "control.sock", points);
  const auto exit_after = [&](const char* signal) {
    fs::remove_all(folder_ / "out");
    write("ended.sh",
          fmt::format(
              "'{}' verify model.json --live --socket control.sock -o out & p=$!\n"
              "for i in $(seq 1000); do test -e out/verification.csv && break; sleep 0.02; done\n"
              "kill -{} $p; wait $p\n",
              ABBE_PROGRAM, signal));
    const int status = std::system(
        fmt::format("cd '{}' && bash ended.sh >stdout 2>stderr", folder_.string()).c_str());
    EXPECT_EQ(text_of(folder_ / "out/verification.csv"), text_of(folder_ / "verification.csv"))
        << signal;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };

  EXPECT_EQ(exit_after("KILL"), 128 + SIGKILL);
  EXPECT_EQ(exit_after("TERM"), 0);
  EXPECT_EQ(exit_after("HUP"), 0);
  EXPECT_TRUE(fs::exists(folder_ / "out/report.html"));
}

TEST_F(VerifyCli, NamesFileAndLineOfBadPoints) {
  write("verification.csv",
        "x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm\n0,0,0,1,2,nan\n1,2,3\n");
  const auto ran = abbe("verify model.json --points verification.csv");
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("verification.csv:2:"), HasSubstr("tracker_z_mm"),
                             HasSubstr("verification.csv:3:")));
}

TEST_F(VerifyCli, ReportsThatTheDataAllowNoResult) {
  auto points = tracker_points(study::table3_machine());
  points.resize(3);
  write("verification.csv", to_verification_csv(points));
  EXPECT_EQ(abbe("verify model.json --points verification.csv").exit, 1);
  auto mirrored = tracker_points(study::table3_machine());
  for (auto& p : mirrored) p.measured_m.x() = -p.measured_m.x();
  write("verification.csv", to_verification_csv(mirrored));
  const auto ran = abbe("verify model.json --points verification.csv");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, HasSubstr("left-handed"));
}

TEST_F(VerifyCli, RefusesInvalidCommandLines) {
  EXPECT_EQ(abbe("verify model.json").exit, 2);
  EXPECT_EQ(abbe("verify model.json --points verification.csv --grid-mm 1,2").exit, 2);
  EXPECT_EQ(abbe("verify model.json --points verification.csv --frame best").exit, 2);
}

}  // namespace
}  // namespace abbe::daemon
