/// `abbe` as people use it: the built program as a process, its files, output and exit codes.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/recording/recorder.hpp"
#include "abbe_command.hpp"
#include "model_eval_output.hpp"
#include "report_again.hpp"
#include "report_page.hpp"
#include "synthetic_otf_run.hpp"
#include "warm_scales.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using test::Ran;
using test::rows_of;
using test::text_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

/// One folder for the whole suite: making the run is the slow part.
class Cli : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("cli_{}", ::getpid());
    files_ = test::write_synthetic_run(folder_);
    identified_ = identify(files_.path, files_.tracker, folder_ / "out");
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static Ran abbe(const std::string& arguments) { return test::run_abbe(folder_, arguments); }
  static Ran identify(const fs::path& path, const fs::path& tracker, const fs::path& out,
                      const std::string& more = "") {
    return abbe(fmt::format("identify otf --machine '{}' --path '{}' --tracker '{}' -o '{}' {}",
                            files_.machine.string(), path.string(), tracker.string(), out.string(),
                            more));
  }
  /// The same run with JSON and a store that holds no other model; identified once.
  static const Ran& kept() {
    static const Ran ran = abbe(fmt::format(
        "identify otf --machine '{}' --path '{}' --tracker '{}' {}", files_.machine.string(),
        files_.path.string(), files_.tracker.string(), test::kKept));
    return ran;
  }
  static fs::path write(const std::string& name, const std::string& text) {
    test::write_text(folder_ / name, text);
    return folder_ / name;
  }

  static inline fs::path folder_;
  static inline test::OtfFiles files_;
  static inline Ran identified_;
};

TEST_F(Cli, IdentifiesTheTruthOfASimulatedMachine) {
  ASSERT_EQ(identified_.exit, 0) << identified_.err;
  std::string points = "x_mm,y_mm,z_mm\n";
  std::vector<calib::Vector3> grid_m, difference_m;
  for (const double x : {-30.0, -20.0, 10.0, 30.0})
    for (const double y : {-30.0, 5.0, 30.0})
      for (const double z : {-30.0, 0.0, 30.0}) points += fmt::format("{},{},{}\n", x, y, z);
  const auto ran =
      abbe(fmt::format("model eval '{}' --points '{}'", (folder_ / "out/model.json").string(),
                       write("points.csv", points).string()));
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto truth = test::synthetic_truth();

  for (const auto& row : rows_of(ran.out)) {
    ASSERT_EQ(row.size(), 10u);
    const calib::Vector3 q_m(row[0] / 1e3, row[1] / 1e3, row[2] / 1e3);
    grid_m.push_back(q_m + truth.target_offset_m);
    difference_m.push_back(calib::Vector3(row[3], row[4], row[5]) / 1e6 - sim::error_m(truth, q_m));
    EXPECT_EQ(row[9], 1.0);
  }

  const auto difference = calib::rigid_free(grid_m, difference_m);
  ASSERT_TRUE(difference);

  // Errors of 10 to 30 um; the two-step estimator leaves second-order terms of some 10 nm without
  // noise.
  EXPECT_LT(difference->rigid_free.max_m, 0.1e-6);
}

TEST_F(Cli, WritesTablesBesideTheModel) {
  EXPECT_THAT(text_of(folder_ / "out/tables.csv"),
              StartsWith("name,position_mm,value,u,unit\nEXX,-60,"));
  const auto document = read_model(folder_ / "out/model.json");
  ASSERT_TRUE(document);
  EXPECT_EQ(document->machine, "small mill");
  ASSERT_EQ(document->inputs.size(), 3u);
  EXPECT_EQ(document->inputs[2].name, "tracker.csv");
}

TEST_F(Cli, WritesAReportThatNeedsNoNetwork) {
  const std::string page = text_of(folder_ / "out/report.html");
  EXPECT_THAT(page, StartsWith("<!doctype html>"));
  const auto document = read_model(folder_ / "out/model.json");
  ASSERT_TRUE(document);
  for (const std::string& shown :
       {document->machine, model_id(*document), std::string("EXX"), std::string("Squareness")})
    EXPECT_THAT(page, HasSubstr(shown));
  EXPECT_THAT(page, Not(HasSubstr("src=")));
  EXPECT_THAT(page, AllOf(Not(HasSubstr("<link")), Not(HasSubstr("<script"))));
}

TEST_F(Cli, WritesAReportWhoseFiguresHaveTheDataOfTheModel) {
  for (const std::string options : {"", "--tables cubic", "--backlash=forward-backward"}) {
    const fs::path out = folder_ / (options.empty() ? "out" : "figures");
    const int exit = options.empty() ? identified_.exit
                                     : identify(files_.path, files_.tracker, out, options).exit;
    ASSERT_TRUE(exit == 0 || exit == 5) << options;  // a refused model has a report, too
    const std::string page = text_of(out / "report.html");
    EXPECT_TRUE(test::every_figure_has_data(page)) << options;
    EXPECT_EQ(test::maps_of(page).size(), 4u) << options;  // one of them on the first page
    const auto charts = test::charts_of(page);
    EXPECT_FALSE(test::dataset_of(charts, "as predicted").is_null());

    const auto document = read_model(out / "model.json");
    ASSERT_TRUE(document);
    for (const auto& p : document->model.parameters()) {
      if (!p.position_m || *p.position_m > -0.059) continue;  // the first node of each table
      EXPECT_NEAR(test::dataset_of(charts, p.name + ",")["data"][0]["y"].get<double>(),
                  1e6 * p.value, 1e-6)
          << p.name << options;
    }
  }
}

/// The tracker's file has one time per sample, so that the residuals have times.
TEST_F(Cli, TheReportOfAKeptModelIsMadeAgainFromTheStore) {
  const std::string page = test::expect_same_report_from_store(folder_, kept());
  const auto document = read_model(folder_ / "kept_out/model.json");
  ASSERT_TRUE(document && document->run && document->run->series);
  EXPECT_FALSE(document->run->parts.empty());
  const auto chart = test::chart_named(page, "Residuals of the fit over time");
  ASSERT_FALSE(chart.is_null());
  EXPECT_EQ(chart["datasets"][0]["data"].size(), document->run->series->points.size());
}

TEST_F(Cli, KeepsAModelWithTheVerdictAgainstTheActiveOne) {
  const auto store = folder_ / "with_active";
  const auto keep = fmt::format("--keep '{}'", store.string());
  ASSERT_EQ(identify(files_.path, files_.tracker, folder_ / "k1", keep).exit, 0);
  const auto id = model_id(*read_model(folder_ / "k1/model.json"));
  ASSERT_EQ(abbe(fmt::format("model activate {} --store '{}'", id, store.string())).exit, 0);
  const auto again = identify(files_.path, files_.tracker, folder_ / "k2", keep + " --json");
  ASSERT_EQ(again.exit, 5) << again.err;
  EXPECT_TRUE(fs::exists(folder_ / "k2/report.html"));
  const auto gate = nlohmann::json::parse(again.out).at("gate");
  EXPECT_FALSE(gate.at("accepted"));
  EXPECT_THAT(gate.at("reasons").at(0).get<std::string>(),
              HasSubstr("the active model remains valid"));
}

TEST_F(Cli, AModelOfAnotherConfigurationDoesNotLockOutItsReplacement) {
  const auto store = folder_ / "replaced";
  const auto keep = fmt::format("--keep '{}' --json", store.string());
  const auto before =
      nlohmann::json::parse(identify(files_.path, files_.tracker, folder_ / "r1", keep).out);

  ASSERT_EQ(abbe(fmt::format("model activate {} --store '{}'", before.at("id").get<std::string>(),
                             store.string()))
                .exit,
            0);
  auto machine = text_of(files_.machine);
  machine.replace(machine.find("small mill"), 10, "moved mill");
  const auto ran =
      abbe(fmt::format("identify otf --machine '{}' --path '{}' --tracker '{}' -o '{}' {}",
                       write("moved.toml", machine).string(), files_.path.string(),
                       files_.tracker.string(), (folder_ / "r2").string(), keep));
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto after = nlohmann::json::parse(ran.out);
  EXPECT_TRUE(after.at("gate").at("accepted")) << ran.out;
  EXPECT_THAT(after.at("gate").at("notes").dump(), HasSubstr("another machine"));
  EXPECT_EQ(after.at("hash"), before.at("hash"));
  EXPECT_NE(after.at("id"), before.at("id"));
}

TEST_F(Cli, ReportsThatFilesHoldNoTemperaturesOfScales) {
  const auto warm = write("warm.toml", text_of(files_.machine) + test::kWarmScales);
  const auto command = [&](const std::string& more) {
    return abbe(fmt::format("identify otf --machine '{}' --path '{}' --tracker '{}' -o '{}' {}",
                            warm.string(), files_.path.string(), files_.tracker.string(),
                            (folder_ / "warm").string(), more));
  };
  const auto refused = command("");
  EXPECT_EQ(refused.exit, 3) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("--scales-corrected"));
  EXPECT_EQ(command("--scales-corrected").exit, 0);
}

TEST_F(Cli, WithoutEvidenceOfThePathsOrientationTheGateRefuses) {
  auto machine = text_of(files_.machine);
  machine.erase(machine.find(test::kTrackerPlacement));
  const auto command = [&](const std::string& more) {
    return abbe(fmt::format("identify otf --machine '{}' --path '{}' --tracker '{}' -o '{}' {}",
                            write("bare.toml", machine).string(), files_.path.string(),
                            files_.tracker.string(), (folder_ / "bare").string(), more));
  };
  const auto refused = command("");
  EXPECT_EQ(refused.exit, 5);
  EXPECT_THAT(refused.out, AllOf(HasSubstr("turned by 180 degrees about X, Y or Z"),
                                 HasSubstr("tracker.position_mm")));
  EXPECT_EQ(command("--accept-path-orientation").exit, 0);
}

/// `identify otf` with another machine.toml.
std::string with_machine(const test::OtfFiles& files, const fs::path& machine, const fs::path& path,
                         const fs::path& out) {
  return fmt::format("identify otf --machine '{}' --path '{}' --tracker '{}' -o '{}'",
                     machine.string(), path.string(), files.tracker.string(), out.string());
}

/// Readings at 100 Hz: 0.5 s at every vertex, 0.1 s from one to the next.
std::string scales_csv(double factor) {
  std::string text = "time_s,x_mm,y_mm,z_mm\n";
  double time_s = 0.0;
  const auto path = test::synthetic_path_m();
  for (std::size_t i = 0; i < path.size(); ++i) {
    for (int k = 0; k < 60; ++k, time_s += 0.01) {
      const double share = i + 1 < path.size() ? std::max(0.0, (k - 50) / 10.0) : 0.0;
      const Eigen::Vector3d q =
          1e3 * factor * (path[i] + share * (path[std::min(i + 1, path.size() - 1)] - path[i]));
      text += fmt::format("{:.2f},{:.6f},{:.6f},{:.6f}\n", time_s, q.x(), q.y(), q.z());
    }
  }
  return text;
}

TEST_F(Cli, ScalesThatAgreeWithThePathAreEvidenceOfItsOrientation) {
  auto machine = text_of(files_.machine);
  machine.erase(machine.find(test::kTrackerPlacement));
  const auto ran =
      abbe(with_machine(files_, write("bare.toml", machine), files_.path, folder_ / "scales") +
           fmt::format(" --encoder '{}'", write("encoder.csv", scales_csv(1.0)).string()));
  EXPECT_EQ(ran.exit, 0) << ran.out << ran.err;
  const auto document = read_model(folder_ / "scales/model.json");
  ASSERT_TRUE(document);
  EXPECT_EQ(document->inputs.back().name, "encoder.csv");
}

TEST_F(Cli, ScalesThatContradictThePathAreNamedByVertexAndAxis) {
  const auto ran =
      identify(files_.path, files_.tracker, folder_ / "scaled",
               fmt::format("--encoder '{}'", write("scaled.csv", scales_csv(0.999)).string()));
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(
      ran.err,
      AllOf(HasSubstr("scaled.csv: the scales contradict the path: at vertex 0 X reads -59.940"),
            HasSubstr("the path has -60.000 mm")));
  EXPECT_FALSE(fs::exists(folder_ / "scaled"));
}

TEST_F(Cli, ScalesOfAnotherPathAreRefusedWithTheVertexTheyMiss) {
  std::string text = scales_csv(1.0);
  text.resize(text.rfind('\n', text.size() / 2) + 1);
  const auto ran = identify(files_.path, files_.tracker, folder_ / "half_scales",
                            fmt::format("--encoder '{}'", write("half.csv", text).string()));
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, HasSubstr("half.csv: the scales do not reach vertex"));
}

TEST_F(Cli, NamesTheSignsThatAreReversedInThePath) {
  std::string turned = "x_mm,y_mm,z_mm\n";
  for (const auto& q : test::synthetic_path_m())
    turned += fmt::format("{},{},{}\n", -q[0] * 1e3, -q[1] * 1e3, q[2] * 1e3);
  const auto ran = identify(write("turned.csv", turned), files_.tracker, folder_ / "turned");
  EXPECT_EQ(ran.exit, 5) << ran.err;
  EXPECT_THAT(ran.out,
              AllOf(HasSubstr("180 degrees about Z"), HasSubstr("signs of the other two axes")));
}

TEST_F(Cli, AnUncertainIndexOfTheAirWidensTheModel) {
  const auto ran = identify(files_.path, files_.tracker, folder_ / "air", "--u-scale-ppm 10");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto plain = read_model(folder_ / "out/model.json"),
             wide = read_model(folder_ / "air/model.json");
  ASSERT_TRUE(plain && wide);
  EXPECT_EQ(plain->model.U(), wide->model.U());
  EXPECT_GT(wide->model.covariance().trace(), 1.01 * plain->model.covariance().trace());
}

TEST_F(Cli, TheSummaryHasTheOffsetOfTheRanges) {
  const auto command = [&](const std::string& more) {
    const auto machine =
        write("offset.toml", test::synthetic_machine_toml() + more /* of [tracker] */);
    return nlohmann::json::parse(
        abbe(with_machine(files_, machine, files_.path, folder_ / "offset") + " --json").out);
  };
  const auto by_default = nlohmann::json::parse(kept().out),
             none = command("u_range_offset_um = 0\n");
  EXPECT_LE(by_default.at("u_range_offset_um").get<double>(), 6.0);
  EXPECT_GT(by_default.at("u_range_offset_um").get<double>(), 0.0);
  EXPECT_EQ(none.at("u_range_offset_um").get<double>(), 0.0);
  EXPECT_NE(by_default.at("hash"), none.at("hash"));
}

TEST_F(Cli, TheVerdictNamesAirThatIsNotMeasured) {
  const auto machine = write(
      "no_air.toml", test::synthetic_machine_toml() +
                         "host = \"t\"\nweather = \"none\"\nu_scale_ppm = 1\n" /* of [tracker] */);
  const auto ran = abbe(with_machine(files_, machine, files_.path, folder_ / "no_air"));
  EXPECT_THAT(ran.out, AllOf(HasSubstr("air not measured"), HasSubstr("20 C, 1013.25 hPa, 50 %")))
      << ran.err;
}

TEST_F(Cli, NamesLineAndColumnOfAVertexOutsideTheTravel) {
  auto text = test::synthetic_path_csv();
  text += "10,60.5,0\n";
  const auto ran = identify(write("outside.csv", text), files_.tracker, folder_ / "outside");
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("outside.csv:63:1: y_mm: 60.5"),
                             HasSubstr("axis Y travels -60 to 60 mm")));
  EXPECT_FALSE(fs::exists(folder_ / "outside"));
}

TEST_F(Cli, DoesNotReadAMissingTargetAsZero) {
  auto text = test::synthetic_machine_toml();
  const auto target = text.find("[target]");
  text.erase(target, text.find("[model]") - target);
  const auto ran =
      abbe(with_machine(files_, write("no_target.toml", text), files_.path, folder_ / "no_target"));
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, HasSubstr("add [target] with offset_mm = [x, y, z]"));
}

TEST_F(Cli, NamesAPathThatIsAMirrorImage) {
  std::string text = "x_mm,y_mm,z_mm\n";
  for (const auto& q : test::synthetic_path_m())
    text += fmt::format("{},{},{}\n", -1e3 * q[0], 1e3 * q[1], 1e3 * q[2]);
  const auto ran = identify(write("mirrored.csv", text), files_.tracker, folder_ / "mirrored");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("they fit with"), HasSubstr("X reversed")));
}

TEST_F(Cli, ComparesTwoModels) {
  const auto model = (folder_ / "out/model.json").string();
  const auto same = abbe(fmt::format("model compare '{0}' '{0}' --json", model));
  ASSERT_EQ(same.exit, 0) << same.err;
  const auto figures = nlohmann::json::parse(same.out);
  EXPECT_GT(figures.at("points").get<int>(), 8);
  EXPECT_EQ(figures.at("as_stated").at("max_um"), 0.0);
  EXPECT_EQ(
      abbe(fmt::format("model compare '{}' '{}'", model, (folder_ / "none.json").string())).exit,
      4);
}

TEST_F(Cli, PrintsNothingOnStderrWhenItIsNotATerminal) {
  EXPECT_THAT(identified_.err, IsEmpty());
  EXPECT_THAT(identified_.out, Not(HasSubstr("\x1b")));
}

TEST_F(Cli, GivesTheSummaryAsJson) {
  ASSERT_EQ(kept().exit, 0) << kept().err;
  const auto summary = nlohmann::json::parse(kept().out);
  const auto first = read_model(folder_ / "out/model.json");
  ASSERT_TRUE(first);
  EXPECT_EQ(summary.at("hash"), model_hash(*first));  // the same input gives the same bits
  EXPECT_LT(summary.at("held_out_rms_after_um").get<double>(),
            summary.at("held_out_rms_before_um").get<double>());
}

TEST_F(Cli, CorrectsCommandsByTheErrorAtTheCorrectedPlace) {
  const auto points = write("one.csv", "x_mm,y_mm,z_mm\n10,20,-30\n");
  const auto model = (folder_ / "out/model.json").string();
  const auto c =
      abbe(fmt::format("model eval '{}' --points '{}' --correction", model, points.string()));

  ASSERT_EQ(c.exit, 0) << c.err;
  EXPECT_THAT(c.out, StartsWith("# quantity = command_correction\nx_mm,y_mm,z_mm,cx_um,"));
  const auto correction = rows_of(c.out).at(0);
  const auto corrected =
      write("corrected.csv",
            fmt::format("x_mm,y_mm,z_mm\n{:.17g},{:.17g},{:.17g}\n", 10 + correction[3] / 1e3,
                        20 + correction[4] / 1e3, -30 + correction[5] / 1e3));
  const auto error =
      rows_of(abbe(fmt::format("model eval '{}' --points '{}'", model, corrected.string())).out)
          .at(0);
  for (std::size_t i = 3; i < 6; ++i)
    EXPECT_NEAR(correction[i], -error[i], 1e-3);  // um: solved to 1 nm
}

TEST_F(Cli, RefusesAToolTheModelDoesNotHoldFor) {
  const auto points = write("one.csv", "x_mm,y_mm,z_mm\n10,20,-30\n");
  const auto ran = abbe(fmt::format("model eval '{}' --points '{}' --tool-mm -20,0,-200",
                                    (folder_ / "out/model.json").string(), points.string()));
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.out, IsEmpty());
  EXPECT_THAT(ran.err, HasSubstr("is not valid for it"));
}

TEST_F(Cli, ExitsWith1WhenThePathIsAnother) {
  auto path = test::synthetic_path_csv();
  path.resize(path.rfind('\n', path.size() / 2) + 1);  // half the legs are missing
  const auto ran = identify(write("half.csv", path), files_.tracker, folder_ / "half");
  EXPECT_EQ(ran.exit, 1) << ran.err;
  EXPECT_FALSE(fs::exists(folder_ / "half/model.json"));
}

TEST_F(Cli, ExitsWith2OnUsage) {
  EXPECT_EQ(abbe("").exit, 2);
  EXPECT_EQ(abbe("identify otf").exit, 2);
  EXPECT_EQ(abbe("frobnicate").exit, 2);
  const auto ran = identify(files_.path, files_.tracker, folder_ / "x", "--estimator three-step");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, HasSubstr("three-step"));
}

TEST_F(Cli, ExitsWith3OnABadFileAndListsItsFaults) {
  auto text = test::synthetic_tracker_csv();
  text.resize(text.size() - 5);
  const auto ran = identify(files_.path, write("cut.csv", text), folder_ / "cut");
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("cut.csv"), HasSubstr("the last line does not end")));
  EXPECT_FALSE(fs::exists(folder_ / "cut"));
}

TEST_F(Cli, ExitsWith4WhenAFileIsMissingOrNotWritable) {
  EXPECT_EQ(identify(files_.path, folder_ / "missing.csv", folder_ / "x").exit, 4);
  const auto ran = identify(files_.path, files_.tracker, files_.machine / "below-a-file");
  EXPECT_EQ(ran.exit, 4) << ran.err;
}

TEST_F(Cli, ShowsAModelFile) {
  const auto ran = abbe("model show out/model.json");
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, AllOf(HasSubstr("file        out/model.json"), HasSubstr("EXX,")));
}

TEST_F(Cli, AModelFileWithASyntaxErrorIsNamedWithLineAndColumn) {
  const auto file = write("broken.json", "{\n \"schema\" 1}");
  const auto ran = abbe(fmt::format("model show '{}'", file.string()));
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("broken.json: line 2, column 11: "),
                             HasSubstr("expected ':'"), Not(HasSubstr("json.exception"))));
}

TEST_F(Cli, ReportsAMissingProgramOfItsOwn) {
  // An empty folder beside a copy of abbe: no abbe-sim next to it, none in this PATH.
  const auto copy = folder_ / "alone" / "abbe";
  fs::create_directories(copy.parent_path());
  fs::copy_file(ABBE_PROGRAM, copy, fs::copy_options::overwrite_existing);
  const auto err = folder_ / "alone" / "err";
  const int status = std::system(
      fmt::format("PATH=/nonexistent '{}' sim 2>'{}'", copy.string(), err.string()).c_str());
  EXPECT_EQ(WEXITSTATUS(status), 4);
  EXPECT_THAT(text_of(err), HasSubstr("abbe-sim"));
}

TEST_F(Cli, RunsAProgramBesideItself) {
  const auto copy = folder_ / "beside" / "abbe";
  fs::create_directories(copy.parent_path());
  fs::copy_file(ABBE_PROGRAM, copy, fs::copy_options::overwrite_existing);
  const auto out = folder_ / "beside" / "out";
  test::write_text(copy.parent_path() / "abbe-sim", "#!/bin/sh\necho \"sim got $*\"\nexit 7\n");
  fs::permissions(copy.parent_path() / "abbe-sim", fs::perms::owner_all);
  const int status =
      std::system(fmt::format("'{}' sim --seed 3 >'{}'", copy.string(), out.string()).c_str());
  EXPECT_EQ(WEXITSTATUS(status), 7);
  EXPECT_EQ(text_of(out), "sim got --seed 3\n");
}

/// A recording in which the daemon reported an identified model, and which holds no run that
/// gives one.
fs::path recording_of_a_lost_model(const fs::path& directory) {
  fs::create_directories(directory);
  RecorderOptions options;
  options.directory = directory;
  options.name = "run";
  auto recorder = Recorder::open(
      options, {.machine = "mill", .configuration = test::synthetic_machine_toml()}, {});
  EXPECT_TRUE(recorder);
  v1::CalibrationEvent event;
  event.machine("mill");
  event.method("otf");
  event.state("active");
  event.model_id("0123456789abcdef");
  recorder->record(event);

  return recorder->close().value().file;
}

TEST_F(Cli, AReplayThatDoesNotGiveTheLiveModelFails) {
  const auto recording = recording_of_a_lost_model(folder_ / "recordings");
  const auto ran = abbe(fmt::format("replay '{}'", recording.string()));
  EXPECT_EQ(ran.exit, 1) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("NOT the same as live"));
  const auto other =
      abbe(fmt::format("replay '{}' -c '{}'", recording.string(), files_.machine.string()));
  EXPECT_EQ(other.exit, 1) << other.err;
  EXPECT_THAT(other.out, HasSubstr("no snapshot in"));
}

}  // namespace
}  // namespace abbe::daemon
