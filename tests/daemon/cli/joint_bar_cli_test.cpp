/// `abbe identify joint` with a Multi-Feature Bar beside a run, as files.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "bar_files.hpp"
#include "joint_triple.hpp"
#include "made_run_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
namespace mfb = calib::mfb;
using calib::Vector3;
using test::Ran;
using ::testing::HasSubstr;

std::string triple_machine_toml(const Vector3& target_m) {
  std::string text =
      "[machine]\nname = \"cube\"\nchain = \"[w X' b Y Z (C1) t]\"\n"
      "[model]\nbasis = \"linear\"\nnode_spacing_mm = 110\n[tracker]\nvertical = \"+Z\"\n";
  text += fmt::format("[target]\noffset_mm = [{}, {}, {}]\n", 1e3 * target_m.x(),
                      1e3 * target_m.y(), 1e3 * target_m.z());
  for (const char axis : {'X', 'Y', 'Z'})
    text += fmt::format("[axes.{}]\nmin_mm = 0\nmax_mm = 550\n", axis);
  return text;
}

/// reference_bar_toml() with other points of interest.
std::string bar_toml_of(const mfb::Bar& bar) {
  std::string text = test::reference_bar_toml();
  text.resize(text.find("[[point]]"));
  for (std::size_t i = 0; i < bar.O_m.size(); ++i) {
    const bool first = i == 0, last = i + 1 == bar.O_m.size();
    text += fmt::format(
        "[[point]]\nhole = {}\nx_mm = {:.17g}\ny_mm = {:.17g}\nz_mm = {:.17g}\nu_um = [{}, {}, "
        "{}]\n",
        i + 1, 1e3 * bar.O_m[i].x(), 1e3 * bar.O_m[i].y(), 1e3 * bar.O_m[i].z(), first ? 0.0 : 0.2,
        first || last ? 0.0 : 0.35, first || last ? 0.0 : 0.35);
  }
  return text;
}

std::string bar_points_csv(const mfb::Plan& plan, const std::vector<mfb::PassTouches>& passes) {
  constexpr std::array kFeatures{"hole", "rod", "plane"};
  std::string text = "measurement,feature,index,side,k,x_mm,y_mm,z_mm\n";
  for (std::size_t p = 0; p < passes.size(); ++p)
    for (const mfb::Touch& t : passes[p]) {
      const bool plane = t.target.feature == mfb::Feature::Plane;
      const char* side = !plane ? "" : t.target.side == mfb::Side::Left ? "L" : "R";
      text += fmt::format("{},{},{},{},{},{:.17g},{:.17g},{:.17g}\n", plan.measurements[p].name,
                          kFeatures[static_cast<std::size_t>(t.target.feature)], t.target.index + 1,
                          side, t.target.k, 1e3 * t.reading_m.x(), 1e3 * t.reading_m.y(),
                          1e3 * t.reading_m.z());
    }
  return text;
}

const std::string kTripleRun =
    "[[run]]\npath = \"path.csv\"\ntracker = \"tracker.csv\"\n"
    "tracker_position_mm = [-750, -620, -350]\n";

std::string touched_bar(const std::string& points) {
  return fmt::format("[[bar]]\nbar = \"bar.toml\"\nplan = \"plan.toml\"\npoints = \"{}\"\n",
                     points);
}

class JointBarCli : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("joint_bar_cli_{}", ::getpid());
    fs::create_directories(folder_);
    const auto m = tests::joint::triple_machine(1);
    write("machine.toml", triple_machine_toml(m.run.machine.target_offset_m));
    write("path.csv", test::made_path_csv(m.run.path));
    write("tracker.csv", test::made_tracker_csv(m.run.samples));
    mfb::Plan plan = tests::mfb::paper_plan();
    plan.tip_radius_m = 0.0;  // as in reference_plan_toml()
    auto probed = tests::joint::probed_bar(m, plan);
    write("bar.toml", bar_toml_of(probed.bar));
    write("plan.toml", test::reference_plan_toml());
    write("points.csv", bar_points_csv(plan, probed.touches));
    for (auto& pass : probed.touches)
      for (mfb::Touch& touch : pass) touch.reading_m *= 1.0 - 20e-6;
    write("short.csv", bar_points_csv(plan, probed.touches));
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static void write(const std::string& name, const std::string& text) {
    test::write_text(folder_ / name, text);
  }
  static Ran identify(const std::string& parts, const std::string& out) {
    write("parts.toml", parts);
    return test::run_abbe(
        folder_,
        fmt::format("identify joint --machine machine.toml --parts parts.toml -o {} --json", out));
  }

  static inline fs::path folder_;
};

TEST_F(JointBarCli, ARunAndABarGiveOneModel) {
  const auto ran = identify(kTripleRun + touched_bar("points.csv"), "out");
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  const auto summary = nlohmann::json::parse(ran.out);
  EXPECT_EQ(summary["parts"][1]["name"], "bar 1");
  EXPECT_EQ(summary["parts"][1]["method"], "mfb");
  EXPECT_FALSE(summary["pairs"][0]["contradiction"]);
  for (const auto& part : summary["parts"])
    EXPECT_GT(part["u_alone_um"].get<double>(), summary["u_um"].get<double>());
  const auto document = read_model(folder_ / "out/model.json");
  ASSERT_TRUE(document) << document.error().text;
  EXPECT_EQ(document->inputs.size(), 7u);
}

/// Readings that are too small by 20 um/m: the bar states lengths that are too large.
TEST_F(JointBarCli, ABarOfWrongLengthIsNamedWithItsValue) {
  const auto ran = identify(kTripleRun + touched_bar("short.csv"), "none");
  EXPECT_EQ(ran.exit, 1) << ran.out;
  EXPECT_THAT(ran.err, HasSubstr("bar 1: its lengths are larger by 2"));
  EXPECT_THAT(ran.err, HasSubstr("wrong length or temperature of the bar, or wrong scale of the "
                                 "tracker's ranges"));
  EXPECT_FALSE(fs::exists(folder_ / "none"));
}

TEST_F(JointBarCli, WrongFilesAreNamedWithThePart) {
  const auto ran = identify(kTripleRun + touched_bar("missing.csv"), "none");
  EXPECT_EQ(ran.exit, 4) << ran.out;
  EXPECT_THAT(ran.err, HasSubstr("bar 1: "));
  EXPECT_THAT(ran.err, HasSubstr("missing.csv"));
  const auto without = identify(kTripleRun + "[[bar]]\nbar = \"bar.toml\"\n", "none");
  EXPECT_EQ(without.exit, 3) << without.out;
  EXPECT_THAT(without.err, HasSubstr("bar[0].plan"));
}

}  // namespace
}  // namespace abbe::daemon
