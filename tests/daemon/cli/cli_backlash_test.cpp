// `abbe identify otf --backlash`, on a run of a simulated machine with known backlash.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "model_eval_output.hpp"
#include "synthetic_otf_run.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::ContainsRegex;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kEXX_m = 4e-6, kEAY_rad = -20e-6;

sim::TruthMachine truth_with_backlash() {
  auto truth = test::synthetic_truth();
  truth.axis(sim::Axis::X).backlash[0] = kEXX_m;
  truth.axis(sim::Axis::Y).backlash[3] = kEAY_rad;
  return truth;
}

/// One folder for the whole suite.
class CliBacklash : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("cli_backlash_{}", ::getpid());
    const auto files = test::write_synthetic_run(folder_);
    test::write_text(files.tracker, test::synthetic_tracker_csv(truth_with_backlash()));
    with_ = identify("--backlash", "with");
    plain_ = identify("--backlash=none", "plain");
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static test::Ran identify(const std::string& more, const std::string& out = "out") {
    return test::run_abbe(folder_,
                          "identify otf --machine machine.toml --path path.csv --tracker "
                          "tracker.csv -o " +
                              out + " " + more);
  }
  static std::string text_of(const std::string& file) { return test::text_of(folder_ / file); }

  static inline fs::path folder_;
  static inline test::Ran with_, plain_;  ///< in the folders "with" and "plain"
};

/// Without noise the values are those of the machine within the second order, 0.1 um.
TEST_F(CliBacklash, PrintsTheValueOfEveryTable) {
  const auto ran = identify("--backlash --json");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto all = nlohmann::json::parse(ran.out).at("backlash");
  ASSERT_EQ(all.size(), 14u);
  EXPECT_EQ(all[0].at("name"), "EXX");
  EXPECT_NEAR(all[0].at("value_um").get<double>(), 1e6 * kEXX_m, 0.1);
  for (const auto& one : all) {
    if (one.at("name") == "EAY") {
      EXPECT_NEAR(one.at("value_urad").get<double>(), 1e6 * kEAY_rad, 1.0);
    } else if (one.at("name") != "EXX" && one.contains("value_um")) {
      EXPECT_NEAR(one.at("value_um").get<double>(), 0.0, 0.1) << one;
    }
  }
}

TEST_F(CliBacklash, IsInSummaryVerdictAndFiles) {
  ASSERT_EQ(with_.exit, 0) << with_.err;
  EXPECT_THAT(with_.out, HasSubstr("backlash    EXX 4.0"));
  EXPECT_THAT(with_.out,
              ContainsRegex("backlash, forward minus backward: EXX [34]\\.[0-9]+ um, EAY -"));
  EXPECT_THAT(text_of("with/tables.csv"), HasSubstr("\nEXX.backlash,,"));
  EXPECT_THAT(text_of("with/report.html"), HasSubstr("Backlash"));
  const auto document = read_model(folder_ / "with/model.json");
  ASSERT_TRUE(document);
  EXPECT_EQ(document->backlash.size(), 14u);
}

/// Of the last point.
double value_of(const test::Ran& ran, std::size_t column) {
  return test::rows_of(ran.out).back().at(column);
}

TEST_F(CliBacklash, IsInVOfADirection) {
  ASSERT_EQ(with_.exit, 0);
  test::write_text(folder_ / "point.csv", "x_mm,y_mm,z_mm\n10,20,-30\n");
  test::write_text(folder_ / "back.csv", "x_mm,y_mm,z_mm,dx,dy,dz\n10,20,-30,-,0,0\n");
  const auto eval = [](const std::string& more) {
    return test::run_abbe(folder_, "model eval with/model.json --points " + more);
  };
  constexpr std::size_t kEx = 3, kUx = 6;
  const auto mean = eval("point.csv"), forth = eval("point.csv --direction +,0,0"),
             back = eval("back.csv");
  ASSERT_EQ(mean.exit + forth.exit + back.exit, 0) << forth.err << back.err;
  EXPECT_NEAR(value_of(forth, kEx) - value_of(mean, kEx), 0.5e6 * kEXX_m, 0.1);
  EXPECT_NEAR(value_of(back, kEx) - value_of(mean, kEx), -0.5e6 * kEXX_m, 0.1);
  EXPECT_LT(value_of(forth, kUx), 0.8 * value_of(mean, kUx));
}

TEST_F(CliBacklash, DirectionIsRefusedWhereItHasNoMeaning) {
  ASSERT_EQ(with_.exit, 0);
  ASSERT_EQ(plain_.exit, 5);  // refused, but written
  test::write_text(folder_ / "point.csv", "x_mm,y_mm,z_mm\n10,20,-30\n");
  test::write_text(folder_ / "back.csv", "x_mm,y_mm,z_mm,dx,dy,dz\n10,20,-30,-,0,0\n");
  const auto error = [](const std::string& more) {
    return test::run_abbe(folder_, "model " + more).err;
  };
  EXPECT_THAT(error("eval with/model.json --points point.csv --direction +,1,0"),
              HasSubstr("--direction \"+,1,0\": must be three of +, -, 0"));
  EXPECT_THAT(error("eval with/model.json --points back.csv --direction +,+,+"),
              HasSubstr("back.csv has the columns dx, dy, dz"));
  EXPECT_THAT(error("eval plain/model.json --points back.csv"),
              HasSubstr("plain/model.json: the model has no backlash"));
  EXPECT_THAT(error("compare plain/model.json plain/model.json --direction +,+,+"),
              HasSubstr("the model has no backlash"));
}

TEST_F(CliBacklash, IsShownAndCompared) {
  ASSERT_EQ(with_.exit, 0);
  EXPECT_THAT(test::run_abbe(folder_, "model show with/model.json").out,
              HasSubstr("V depends on the direction of travel (backlash per-table)"));
  const auto compared = [](const std::string& more) {
    return nlohmann::json::parse(
        test::run_abbe(folder_, "model compare with/model.json plain/model.json --json " + more)
            .out);
  };
  ASSERT_EQ(plain_.exit, 5);  // refused, but written
  const auto mean = compared(""), forth = compared("--direction +,+,+");
  EXPECT_GT(forth.at("as_stated").at("mean_um").get<double>(),
            mean.at("as_stated").at("mean_um").get<double>() + 1.0);
}

TEST_F(CliBacklash, MayDependOnThePosition) {
  const auto ran = identify("--backlash=forward-backward --json");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto all = nlohmann::json::parse(ran.out).at("backlash");
  ASSERT_EQ(all.size(), 42u);  // three nodes
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(all[i].at("position_mm"), -60.0 + 60.0 * static_cast<double>(i));
    EXPECT_NEAR(all[i].at("value_um").get<double>(), 1e6 * kEXX_m, 0.3);
  }
}

TEST_F(CliBacklash, IsChosenByTheConfiguration) {
  const auto machine = test::synthetic_machine_toml();
  test::write_text(folder_ / "machine.toml", machine + "[otf]\nbacklash = \"per-table\"\n");
  EXPECT_THAT(identify("").out, HasSubstr("backlash    EXX 4.0"));
  EXPECT_THAT(identify("--backlash=none").out, Not(HasSubstr("backlash    ")));
  test::write_text(folder_ / "machine.toml", machine);
}

TEST_F(CliBacklash, IsNotEstimatedUnlessAskedFor) {
  const auto ran = identify("--json");
  EXPECT_FALSE(nlohmann::json::parse(ran.out).contains("backlash"));
  EXPECT_TRUE(read_model(folder_ / "out/model.json").value().backlash.empty());
  EXPECT_THAT(text_of("out/tables.csv"), Not(HasSubstr("backlash")));
  const auto refused = identify("--backlash=some");
  EXPECT_EQ(refused.exit, 2);
  EXPECT_THAT(refused.err, HasSubstr("some"));
}

}  // namespace
}  // namespace abbe::daemon
