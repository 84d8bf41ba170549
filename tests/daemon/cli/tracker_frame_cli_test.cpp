/// `abbe identify otf` with points that were exported in machine coordinates.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "made_run_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::string in_columns(const std::string& columns, const tests::otf::MadeRun& run,
                       const calib::RigidTransform& T) {
  std::string text = "time_s," + columns + "\n";
  for (const auto& s : run.samples) {
    const calib::Vector3 p_mm = 1e3 * (T * s.p_tracker_m);
    text +=
        fmt::format("{:.17g},{:.17g},{:.17g},{:.17g}\n", s.time_s, p_mm.x(), p_mm.y(), p_mm.z());
  }
  return text;
}

class TrackerFrameCli : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("tracker_frame_{}", ::getpid());
    fs::create_directories(folder_);
    run_ = tests::otf::make_run({.rate_hz = 500.0});
    test::write_text(folder_ / "machine.toml",
                     test::made_machine_toml(run_.machine.target_offset_m));
    test::write_text(folder_ / "path.csv", test::made_path_csv(run_.path));
    test::write_text(folder_ / "tracker.csv", test::made_tracker_csv(run_.samples));
    test::write_text(folder_ / "machine.csv",
                     in_columns("x_mm,y_mm,z_mm", run_, run_.T_machine_tracker));
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static test::Ran identify(const std::string& points, const std::string& more) {
    return test::run_abbe(folder_,
                          fmt::format("identify otf --machine machine.toml --path path.csv "
                                      "--accept-path-orientation --tracker {} {}",
                                      points, more));
  }

  static inline fs::path folder_;
  static inline tests::otf::MadeRun run_;
};

TEST_F(TrackerFrameCli, ColumnsThatStateNoFrameAreRefused) {
  const auto ran = identify("machine.csv", "-o none");
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, HasSubstr("machine.csv: the columns x_mm, y_mm, z_mm do not state their"));
  EXPECT_FALSE(fs::exists(folder_ / "none"));
}

TEST_F(TrackerFrameCli, APlaceOfTheTrackerGivesTheModelOfItsFrame) {
  const calib::Vector3 at_mm = 1e3 * run_.T_machine_tracker.t_m;
  const auto of_tracker = identify("tracker.csv", "-o own");
  const auto of_machine = identify(
      "machine.csv",
      fmt::format("-o other --tracker-centre-mm={},{},{}", at_mm.x(), at_mm.y(), at_mm.z()));
  ASSERT_EQ(of_tracker.exit, 0) << of_tracker.out << of_tracker.err;
  ASSERT_EQ(of_machine.exit, 0) << of_machine.out << of_machine.err;
  const auto own = read_model(folder_ / "own/model.json"),
             other = read_model(folder_ / "other/model.json");
  ASSERT_TRUE(own && other);
  const Eigen::VectorXd u = own->model.covariance().diagonal().cwiseSqrt().cwiseMax(1e-12);
  EXPECT_LT((own->model.U() - other->model.U()).cwiseQuotient(u).cwiseAbs().maxCoeff(), 1e-3);
}

TEST_F(TrackerFrameCli, AWrongPlaceIsRefusedByTheNoiseOfThePoints) {
  const calib::Vector3 at_mm = 1e3 * run_.T_machine_tracker.t_m;
  // As far away as the tracker, in a direction across its beams.
  const calib::Vector3 wrong_mm = at_mm.norm() * at_mm.cross(calib::Vector3::UnitZ()).normalized();
  const auto ran =
      identify("machine.csv", fmt::format("-o wrong --json --tracker-centre-mm={},{},{}",
                                          wrong_mm.x(), wrong_mm.y(), wrong_mm.z()));
  EXPECT_EQ(ran.exit, 5) << ran.out;
  EXPECT_THAT(ran.out, HasSubstr("the noise of the points is smallest along ("));
}

TEST_F(TrackerFrameCli, APlaceBesideTheFrameOfTheTrackerIsRefused) {
  EXPECT_EQ(identify("tracker.csv", "-o none --tracker-centre-mm=0,0,1000").exit, 3);
  EXPECT_EQ(identify("machine.csv", "-o none --tracker-centre-mm=0,0").exit, 2);
  EXPECT_EQ(
      identify("machine.csv", "-o none --tracker-centre-mm=0,0,1 --tracker-centre-mm=1,0,0").exit,
      2);
}

}  // namespace
}  // namespace abbe::daemon
