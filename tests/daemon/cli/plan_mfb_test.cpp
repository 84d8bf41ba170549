/// `abbe plan mfb` as people use it, with the bar and the machine of the reference data.
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/methods/mfb/bar_plan.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "abbe_command.hpp"
#include "bar_files.hpp"
#include "mfb_planning.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
namespace mfb = calib::mfb;
using nlohmann::json;
using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr const char* kStar =
    " --stylus-mm=0,0,-150 --stylus-mm=-100,0,-150 --stylus-mm=100,0,-150 --stylus-mm=0,-100,-150 "
    "--stylus-mm=0,100,-150 ";

class PlanMfb : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    write("machine.toml", test::reference_machine_toml());
    write("bar.toml", test::reference_bar_toml());
  }
  void TearDown() override { fs::remove_all(folder_); }

  void write(const char* file, const std::string& text) const {
    test::write_text(folder_ / file, text);
  }
  [[nodiscard]] test::Ran plan(const std::string& more) const {
    return test::run_abbe(folder_, "plan mfb --machine machine.toml --bar bar.toml " + more);
  }
  /// The plan of the reference data without the measurements whose name begins so.
  [[nodiscard]] static std::string plan_without(const std::string& beginning) {
    const std::string text = test::reference_plan_toml(), table = "[[measurement]]\n";
    std::string kept;
    for (std::size_t at = 0; at < text.size();) {
      const std::size_t next = std::min(text.find(table, at + 1), text.size());
      const std::string part = text.substr(at, next - at);
      if (part.find("name = \"" + beginning) == std::string::npos) kept += part;
      at = next;
    }
    return kept;
  }

  const fs::path folder_ = fs::path(::testing::TempDir()) / fmt::format("plan_mfb_{}", ::getpid());
};

double rms_u(const json& prediction, const std::string& name) {
  for (const auto& error : prediction["errors"])
    if (error["name"] == name) return error["rms_u"];
  ADD_FAILURE() << "no error " << name;
  return 0.0;
}

TEST_F(PlanMfb, WritesAPlanThatIsJudgedAsItWasPlanned) {
  const auto planned =
      plan(std::string(kStar) + "--forward-only --tip-radius-mm 0 --json -o p.toml");
  ASSERT_EQ(planned.exit, 0) << planned.err;
  const json figures = json::parse(planned.out);
  EXPECT_EQ(figures["measurements"], 17);
  EXPECT_EQ(figures["clampings"], 14);
  EXPECT_LE(rms_u(figures["prediction"], "EZX"), 0.26);
  EXPECT_LE(rms_u(figures["prediction"], "EB0Z"), 1.4);

  const auto judged = plan("--check p.toml --json");
  ASSERT_EQ(judged.exit, 0) << judged.err;
  const json again = json::parse(judged.out);
  EXPECT_EQ(again["set"], "p.toml");
  EXPECT_EQ(again["readings_mm"], figures["readings_mm"]);
  for (const auto& error : figures["prediction"]["errors"])
    EXPECT_NEAR(rms_u(again["prediction"], error["name"]), error["rms_u"].get<double>(), 1e-6);
}

TEST_F(PlanMfb, NamesTheErrorsThatAPlanCannotShow) {
  write("p.toml", plan_without("D"));
  const auto ran = plan("--check p.toml --json");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("p.toml cannot show"), HasSubstr("EA0Z, EB0Z, EC0Y"),
                             HasSubstr("squareness needs bars along the diagonals")));
  const json figures = json::parse(ran.out);
  EXPECT_EQ(figures["not_seen"].back(), "EC0Y");
  EXPECT_EQ(figures["prediction"]["rank"], figures["prediction"]["unknowns"]);
}

TEST_F(PlanMfb, APlanForAnotherTravelIsNamed) {
  std::string longer = test::reference_machine_toml();
  const std::string last = "max_mm = 550";
  longer.replace(longer.rfind(last), last.size(), "max_mm = 750");  // of Z
  write("machine.toml", longer);
  write("p.toml", test::reference_plan_toml());
  const auto ran = plan("--check p.toml");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, HasSubstr("Z: the touches are from"));
  EXPECT_THAT(ran.err, HasSubstr("[axes.Z] is 0.0 to 750.0 mm"));
}

TEST_F(PlanMfb, NamesTheStyliThatAreMissingAndWritesNothing) {
  const auto ran = plan("--stylus-mm=0,0,-150 --stylus-mm=100,0,-150 -o p.toml");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("cannot show"), HasSubstr("EBZ"),
                             HasSubstr("Z1 from the second side: no stylus has its stem along -X"),
                             HasSubstr("Z2: no stylus has its stem along Y")));
  EXPECT_FALSE(fs::exists(folder_ / "p.toml"));
}

TEST_F(PlanMfb, StatesAnglesAndClampingsOfRotaryAxes) {
  const auto ran = plan(std::string(kStar) + "--set indexed -o p.toml");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("17 measurements in 14 positions, 6 clampings"));
  EXPECT_THAT(test::text_of(folder_ / "p.toml"),
              HasSubstr("clamping 1, swivel axis 90 degrees, rotary axis 0 degrees"));
}

TEST_F(PlanMfb, ExchangesPositions) {
  const auto ran =
      plan(std::string(kStar) + "--set minimum --forward-only --best --exchanges 1 --json");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const json figures = json::parse(ran.out);
  EXPECT_EQ(figures["measurements"], 12);
  EXPECT_LE(figures["prediction"]["worst_of_limit"].get<double>(),
            figures["before_exchange"]["worst_of_limit"].get<double>());
}

struct BadBarPlan {
  const char* arguments;
  int exit;
  const char* what;
};
class PlanMfbInput : public PlanMfb, public ::testing::WithParamInterface<BadBarPlan> {};

TEST_P(PlanMfbInput, IsRefused) {
  const auto ran = plan(GetParam().arguments);
  EXPECT_EQ(ran.exit, GetParam().exit);
  EXPECT_THAT(ran.err, HasSubstr(GetParam().what));
}

INSTANTIATE_TEST_SUITE_P(
    Faults, PlanMfbInput,
    ::testing::Values(
        BadBarPlan{"", 2, "needs the styli, for example --stylus-mm=0,0,-150"},
        BadBarPlan{"--stylus-mm=0,0,deep", 2, "--stylus-mm \"0,0,deep\": must be x,y,z in mm"},
        BadBarPlan{"--stylus-mm=0,0,-150,-w", 2, "the direction of the stem"},
        BadBarPlan{"--stylus-mm=0,0,-150 --stylus-mm=0,0,-150", 3,
                   "two styli have the tool offset"},
        BadBarPlan{"--stylus-mm=0,0,-150 --tip-radius-mm 9", 3, "does not fit into holes"},
        BadBarPlan{"--stylus-mm=0,0,-150 --set best", 2, "--set"},
        BadBarPlan{"--stylus-mm=0,0,-150 --set indexed --rotary-at-mm 1,2", 2,
                   "--rotary-at-mm \"1,2\""},
        BadBarPlan{"--stylus-mm=0,0,-150 --check p.toml", 2, "excludes"},
        BadBarPlan{"--check none.toml", 4, "none.toml"},
        BadBarPlan{"--check bar.toml", 3, "bar.toml"},
        BadBarPlan{"--stylus-mm=0,0,-150 --stylus-mm=0,400,-150 --stylus-mm=0,-400,-150", 1,
                   "use styli with shorter arms"}));

/// A plan as the writer gets it, for a bar that expands.
BarPlan plan_to_write(const mfb::PlanTask& task) {
  BarPlan plan;
  plan.set = "rolled";
  plan.plan = mfb::plan_of(task, mfb::named_set(mfb::NamedSet::Rolled, task).value().positions);
  plan.plan.gravity = calib::Vector3(0, 1, -1).normalized();
  plan.readings = mfb::readings_of(task.bar, plan.plan);
  return plan;
}

TEST_F(PlanMfb, TheFileIsReadAsItWasWritten) {
  auto task = tests::mfb::task_for(12, {0.55, 0.55, 0.4});
  task.bar.expansion = calib::Expansivity{1e-6, 5e-8};
  task.backward = true;
  task.temperature_K = 295.15;
  task.settings.noise.u_temperature_K = 0.05;
  const BarPlan written = plan_to_write(task);
  write("p.toml", to_plan_toml(written, task.bar, "mill"));

  const auto read = read_bar_plan_toml(folder_ / "p.toml", task.bar);
  ASSERT_TRUE(read) << read.error().text;
  EXPECT_NEAR((read->plan.gravity - written.plan.gravity).norm(), 0.0, 1e-9);
  EXPECT_EQ(read->plan.noise.u_temperature_K, 0.05);
  ASSERT_EQ(read->plan.measurements.size(), written.plan.measurements.size());
  for (std::size_t i = 0; i < written.plan.measurements.size(); ++i) {
    const mfb::Measurement& r = read->plan.measurements[i];
    const mfb::Measurement& w = written.plan.measurements[i];
    EXPECT_EQ(r.name, w.name);
    EXPECT_EQ(r.position, w.position);
    EXPECT_EQ(r.direction, w.direction);
    EXPECT_NEAR(*r.temperature_K, *w.temperature_K, 1e-9);
    EXPECT_NEAR((r.origin_m - w.origin_m).norm(), 0.0, 1e-9);
    EXPECT_NEAR((r.axes() - w.axes()).norm(), 0.0, 1e-8);
    EXPECT_NEAR((r.tool_offset_m - w.tool_offset_m).norm(), 0.0, 1e-9);
  }
}

}  // namespace
}  // namespace abbe::daemon
