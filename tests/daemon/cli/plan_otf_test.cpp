/// `abbe plan otf` as people use it, with a machine of few nodes.
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/methods/otf/path_program.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe_command.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kPlannedMachine =
    "--travel-mm=-150,150,-100,100,-200,0 --node-spacing-mm 100 --tool-mm 20,-15,-120 "
    "--chain '[w b X Y Z t]' ";
constexpr const char* kQuickPlan = "--lattice 3 --exchanges 300 --length-m 8 ";

class PlanOtf : public ::testing::Test {
 protected:
  void SetUp() override { fs::create_directories(folder_); }
  void TearDown() override { fs::remove_all(folder_); }
  [[nodiscard]] test::Ran plan(const std::string& more) const {
    return test::run_abbe(folder_, std::string("plan otf ") + kPlannedMachine + more);
  }

  const fs::path folder_ = fs::path(::testing::TempDir()) / fmt::format("plan_{}", ::getpid());
};

TEST_F(PlanOtf, WritesAPathThatIsBetterThanTheBasePath) {
  const auto ran = plan(std::string(kQuickPlan) +
                        "--tracker-at-mm=-700,-600,-100 --json -o out "
                        "--dialect linuxcnc --dialect heidenhain");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const json said = json::parse(ran.out);
  EXPECT_LE(said["prediction"]["length_m"].get<double>(), 8.0);
  EXPECT_GT(said["prediction"]["rms_u_um"].get<double>(), 0.0);
  EXPECT_EQ(said["prediction"]["datum_conditions"], 20);
  EXPECT_EQ(said["prediction"]["not_observable"], (json{"ECY", "EAZ", "EBZ", "ECZ"}));
  EXPECT_EQ(said, json::parse(test::text_of(folder_ / "out/plan.json")));

  const auto path = read_path_csv(folder_ / "out/path.csv");
  ASSERT_TRUE(path) << path.error().text;
  EXPECT_EQ(path->vertices_m.size(), said["legs"].get<std::size_t>() + 1);
  EXPECT_NEAR(path->feed_m_per_s.at(1), 2.5 / 60.0, 1e-12);
  EXPECT_TRUE(fs::exists(folder_ / "out/path.ngc"));
  EXPECT_TRUE(fs::exists(folder_ / "out/path.h"));
  EXPECT_FALSE(fs::exists(folder_ / "out/path.mpf"));
}

TEST_F(PlanOtf, PredictsAPathOfAFileAsItWasPlanned) {
  const std::string tracker = "--tracker-at-mm=-700,-600,-100 --json ";
  const auto planned = plan(kQuickPlan + tracker + "-o out");
  const auto predicted = plan(tracker + "--path out/path.csv");
  ASSERT_EQ(predicted.exit, 0) << predicted.err;
  EXPECT_EQ(json::parse(predicted.out)["prediction"], json::parse(planned.out)["prediction"]);
}

TEST_F(PlanOtf, ComparesPositionsOfTheTracker) {
  const auto ran = plan(
      "--lattice 3 --exchanges 0 --length-m 20 --tracker-at-mm=-5000,-5000,-100 "
      "--tracker-at-mm=-700,-600,-100");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, AllOf(HasSubstr("tracker     at -5000, -5000, -100 mm"),
                             HasSubstr("with a quick path (chosen)"), HasSubstr("base path")));
  EXPECT_LT(ran.out.find("-5000"), ran.out.find("(chosen)"));
}

struct BadPlan {
  std::string arguments;
  int exit;
  const char* what;
};

TEST_F(PlanOtf, RefusesWhatCannotBePlanned) {
  const std::string tracker = "--tracker-at-mm=-700,-600,-100 ";
  for (const BadPlan& bad :
       {BadPlan{tracker + "--lattice 3 --length-m 0.3", 3, "budget is too short"},
        BadPlan{"--tracker-at-mm=0,0,-200", 3, "inside the volume"},
        BadPlan{tracker + "--dialect fanuc", 2, "linuxcnc"},
        BadPlan{"", 2, "position of the tracker is unknown"},
        BadPlan{tracker + "--length-m 0", 2, "length"},
        BadPlan{"--tracker-at-mm 1,2", 2, "must be x,y,z"}}) {
    const auto ran = plan(bad.arguments);
    EXPECT_EQ(ran.exit, bad.exit) << bad.arguments << ran.out;
    EXPECT_THAT(ran.err, HasSubstr(bad.what)) << bad.arguments;
  }
  const auto without = test::run_abbe(folder_, "plan otf --tracker-at-mm=-700,-600,-100");
  EXPECT_EQ(without.exit, 2);
  EXPECT_THAT(without.err, HasSubstr("--machine or --travel-mm"));
}

TEST_F(PlanOtf, NamesWhatAPathOfAFileDoesNotDetermine) {
  test::write_text(folder_ / "flat.csv",
                   "x_mm,y_mm,z_mm\n-150,-100,0\n150,100,0\n-150,100,0\n150,-100,0\n0,0,0\n");
  const auto ran = plan("--tracker-at-mm=-700,-600,-100 --path flat.csv");
  EXPECT_EQ(ran.exit, 1) << ran.out;
  EXPECT_THAT(ran.err, AllOf(HasSubstr("does not determine EXX"), HasSubstr("EZZ")));
}

}  // namespace
}  // namespace abbe::daemon
