/// Files of other programs: .rtl of a laser interferometer, exported points, logs of camonitor.
#include <fmt/format.h>
#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <random>

#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "encoder_run.hpp"
#include "made_run_files.hpp"
#include "synthetic_model.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using test::Ran;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

/// Error of the model along x at y = 50, z = -200 mm, as a laser program writes it.
std::string rtl_of(const calib::VolumetricModel& model) {
  std::string targets, rows;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  const calib::Vector3 tool_m = model.tool_offsets_m().front();
  for (int run = 1; run <= 6; ++run)
    for (int i = 0; i < 13; ++i) {
      const int target = run % 2 == 1 ? i : 12 - i;
      const calib::Vector3 q_m(-0.3 + 0.05 * target, 0.05, -0.2);
      rows += fmt::format("{}    {}    {:.3f}\r\n", run, target + 1,
                          1e6 * model.V_at(q_m, tool_m).x() + 0.2 * normal(random));
      if (run == 1) targets += fmt::format("{:.6f}  {}", 1e3 * q_m.x(), i % 5 == 4 ? "\r\n" : "");
    }
  return "HEADER::\r\nFile type  : rtl\r\nOwner      : Linear\r\n\r\nTARGET DATA::\r\n"
         "Target-count: 13\r\nTargets :\r\n" +
         targets + "\r\nFlags: 0 0 2 0\r\n\r\nRUNS::\r\nRun-count: 6\r\n\r\n" +
         "DEVIATIONS::\r\nRun Target Data:\r\n" + rows + "\r\nEOF::\r\n";
}

class LaserFileCli : public ::testing::Test {
 protected:
  LaserFileCli() {
    const auto document = test::synthetic_document(1);
    test::write_text(folder_.path() / "model.json", to_json(document));
    test::write_text(folder_.path() / "x.rtl", rtl_of(document.model));
  }
  [[nodiscard]] Ran compare(const std::string& options) const {
    return test::run_abbe(folder_.path(), "model compare model.json --measured " + options);
  }

  TemporaryFolder folder_;
};

TEST_F(LaserFileCli, AnRtlFileIsComparedWithItsModel) {
  const auto ran =
      compare("x.rtl --measured-error EXX --measured-line-mm=0,50,-200 --measured-unit um --json");
  ASSERT_EQ(ran.exit, 0) << ran.err << ran.out;
  const auto tables = nlohmann::json::parse(ran.out).at("tables");
  ASSERT_EQ(tables.size(), 1u);
  EXPECT_EQ(tables[0]["verdict"], "agrees");
  EXPECT_EQ(tables[0]["points"].size(), 13u);
  EXPECT_LT(tables[0]["mae"].get<double>(), 0.3);
}

TEST_F(LaserFileCli, TheUsualMistakesAreNamed) {
  const auto ran =
      compare("x.rtl --measured-error EXX --measured-line-mm=0,50,-200 --measured-unit mm");
  EXPECT_EQ(ran.exit, 5);
  EXPECT_THAT(ran.out, HasSubstr("fits with"));
}

TEST_F(LaserFileCli, WhatTheFileDoesNotStateIsAskedFor) {
  const auto ran = compare("x.rtl");
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err,
              AllOf(HasSubstr("x.rtl: an .rtl file (positioning of one axis) needs:"),
                    HasSubstr("--measured-error EXX, EYY or EZZ"),
                    HasSubstr("--measured-line-mm X,Y,Z"), HasSubstr("--measured-unit um or mm")));
  EXPECT_THAT(compare("x.rtl --measured-error EXX --measured-unit um").err,
              AllOf(HasSubstr("--measured-line-mm"), Not(HasSubstr("--measured-error"))));
}

TEST_F(LaserFileCli, AFileOfAbbeNeedsNoStatements) {
  test::write_text(folder_.path() / "m.csv", "name,position_mm,value,unit,run,direction\n");
  const auto ran = compare("m.csv --measured-unit um");
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, HasSubstr("leave out --measured-error"));
}

/// Points of a grid, seen by a tracker, in the format of SpatialAnalyzer; and their readings.
class ExportedPointsCli : public ::testing::Test {
 protected:
  ExportedPointsCli() {
    const auto document = test::synthetic_document(3);
    const calib::Vector3 tool_m = document.model.tool_offsets_m().front();
    const calib::RigidTransform T{
        Eigen::AngleAxisd(1.1, calib::Vector3(0.2, 0.1, 1.0).normalized()).toRotationMatrix(),
        calib::Vector3(3.0, -1.0, 0.4)};
    std::string inches, readings = "name,x_mm,y_mm,z_mm\n",
                        own = "x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm\n";
    for (int i = 0; i < 125; ++i) {
      const calib::Vector3 q(-0.3 + 0.15 * (i % 5), -0.3 + 0.15 * (i / 5 % 5),
                             -0.4 + 0.1 * (i / 25));
      const calib::Vector3 p = T * (q + tool_m + document.model.V_at(q, tool_m));
      const auto mm = [](const calib::Vector3& v, std::string_view separator, double per_m) {
        return fmt::format("{:.9f}{}{:.9f}{}{:.9f}", per_m * v.x(), separator, per_m * v.y(),
                           separator, per_m * v.z());
      };
      inches += fmt::format("measured,  grid,  P{},  {}\n", i, mm(p, ",  ", 1.0 / 0.0254));
      readings += fmt::format("P{},{}\n", i, mm(q, ",", 1e3));
      own += mm(q, ",", 1e3) + "," + mm(p, ",", 1e3) + "\n";
    }
    write("model.json", to_json(document));
    write("points.txt",
          "// SpatialAnalyzer SA 2022.2.0624.7 ( x64 )\n// Points Relative to Coordinate Frame "
          "'A::World'\n// Collection,  Group,  Point,  X,  Y,  Z\n\n" +
              inches);
    write("readings.csv", readings);
    write("own.csv", own);
  }
  void write(const std::string& name, const std::string& text) const {
    test::write_text(folder_.path() / name, text);
  }
  [[nodiscard]] Ran verify(const std::string& options) const {
    return test::run_abbe(folder_.path(), "verify model.json --json --points " + options);
  }

  TemporaryFolder folder_;
};

TEST_F(ExportedPointsCli, GiveTheResultOfVerificationCsv) {
  const auto own = verify("own.csv");
  const auto other = verify("points.txt --readings readings.csv --points-unit inch --frame fit");
  ASSERT_EQ(own.exit, 0) << own.err;
  ASSERT_EQ(other.exit, 0) << other.err;
  const auto a = nlohmann::json::parse(own.out), b = nlohmann::json::parse(other.out);
  EXPECT_EQ(a["places"], b["places"]);
  EXPECT_NEAR(a["before"]["rms_um"].get<double>(), b["before"]["rms_um"].get<double>(), 1e-3);
  EXPECT_LT(b["after"]["max_um"].get<double>(), 1e-2);
}

TEST_F(ExportedPointsCli, WhatTheFileDoesNotStateIsAskedFor) {
  const auto ran = verify("points.txt");
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("points.txt: an export of points needs:"),
                             HasSubstr("--readings FILE: name,x_mm,y_mm,z_mm"),
                             HasSubstr("--points-unit mm, m or inch"),
                             HasSubstr("--frame fit, if the axes of the frame (A::World)")));
  EXPECT_THAT(verify("own.csv --points-unit mm").err, HasSubstr("leave out --readings"));
}

TEST_F(ExportedPointsCli, APointThatAloneDoesNotFitIsNamed) {
  auto text = test::text_of(folder_.path() / "points.txt");
  text.replace(text.find("P7,  ") + 5, 1, "9");
  write("off.txt", text);
  const auto ran = verify("off.txt --readings readings.csv --points-unit inch --frame fit");
  EXPECT_THAT(ran.out + ran.err, HasSubstr("off.txt:12: alone does not fit"));
}

/// A run along a path: points in m without times, scale readings as a log of camonitor.
class RunOfProgramsCli : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<TemporaryFolder>();
    made_ = tests::otf::make_encoder_run({.seed = 3});
    std::string points;
    for (const auto& s : made_.run.samples)
      points += fmt::format("{:.12f} {:.12f} {:.12f}\r\n", s.p_tracker_m.x(), s.p_tracker_m.y(),
                            s.p_tracker_m.z());
    write("machine.toml", test::made_machine_toml(made_.run.machine.target_offset_m));
    write("path.csv", test::made_path_csv(made_.run.path));
    write("tracker.csv", test::made_tracker_csv(made_.run.samples));
    write("points.txt", points);
    write("run.log", log());
  }
  static void TearDownTestSuite() { folder_.reset(); }

  static void write(const std::string& name, const std::string& text) {
    test::write_text(folder_->path() / name, text);
  }
  /// An axis that stands still has no updates.
  static std::string log() {
    std::string text;
    std::array<std::string, 3> before;
    for (const auto& reading : made_.log.readings)
      for (int a = 0; a < 3; ++a) {
        const auto value = fmt::format("{:.6f}", 1e3 * reading.q_m[a]);
        if (value == before.at(static_cast<std::size_t>(a))) continue;
        before.at(static_cast<std::size_t>(a)) = value;
        const double time_s = 3600.0 + reading.time_s;
        text += fmt::format("{:<30} 2026-11-12 {:02d}:{:02d}:{:09.6f} {}  \n",
                            fmt::format("mill:{}.RBV", "XYZ"[a]), static_cast<int>(time_s / 3600.0),
                            static_cast<int>(std::fmod(time_s, 3600.0) / 60.0),
                            std::fmod(time_s, 60.0), value);
      }
    return text;
  }
  static Ran identify(const std::string& options) {
    return test::run_abbe(folder_->path(),
                          "identify otf --machine machine.toml --path path.csv --json " + options);
  }

  static inline std::unique_ptr<TemporaryFolder> folder_;
  static inline tests::otf::EncoderRun made_;
};

TEST_F(RunOfProgramsCli, GivesTheModelOfItsPointsAndClocks) {
  const auto ran = identify(
      "--tracker points.txt --tracker-unit m --tracker-points-per-s 250 --tracker-centre-mm=0,0,0 "
      "--encoder run.log --encoder-pv X=mill:X.RBV --encoder-pv Y=mill:Y.RBV --encoder-pv "
      "Z=mill:Z.RBV --encoder-unit mm -o out");
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  const auto clocks = nlohmann::json::parse(ran.out).at("clocks");
  EXPECT_GT(clocks.at("observations_along").get<int>(), 100);
  EXPECT_NEAR(clocks.at("drift_ppm").get<double>(), 30.0,
              4.0 * clocks.at("u_drift_ppm").get<double>());
  const auto other = read_model(folder_->path() / "out/model.json");
  ASSERT_TRUE(other);

  ASSERT_EQ(identify("--tracker tracker.csv --accept-path-orientation -o own").exit, 0);
  const auto own = read_model(folder_->path() / "own/model.json");
  ASSERT_TRUE(own);
  const Eigen::VectorXd u = own->model.covariance().diagonal().cwiseSqrt().cwiseMax(1e-12);
  EXPECT_LT((own->model.U() - other->model.U()).cwiseQuotient(u).cwiseAbs().maxCoeff(), 5.0);
}

TEST_F(RunOfProgramsCli, WhatTheFilesDoNotStateIsAskedFor) {
  EXPECT_THAT(identify("--tracker points.txt --tracker-points-per-s 250 -o none").err,
              AllOf(HasSubstr("points.txt: an export of points needs:"),
                    HasSubstr("--tracker-unit mm, m or inch"),
                    HasSubstr("--tracker-centre-mm X,Y,Z: where the tracker stands")));
  const auto log = identify("--tracker tracker.csv --encoder run.log -o none");
  EXPECT_EQ(log.exit, 3);
  EXPECT_THAT(log.err, AllOf(HasSubstr("run.log: a log of camonitor needs:"),
                             HasSubstr("--encoder-pv X=NAME"), HasSubstr("mill:X.RBV, mill:Y.RBV"),
                             HasSubstr("--encoder-unit mm, um, m or inch")));
}

TEST_F(RunOfProgramsCli, StatementsThatAreNotNeededAreRefused) {
  EXPECT_THAT(identify("--tracker tracker.csv --tracker-unit mm -o none").err,
              HasSubstr("leave out --tracker-unit"));
  EXPECT_EQ(identify("--tracker tracker.csv --encoder run.log --encoder-pv A=b -o none").exit, 2);
}

}  // namespace
}  // namespace abbe::daemon
