/// `[[tracker.nest]]` in the configuration, and the drift of the tracker in what `abbe identify
/// otf` prints and writes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/config/calibration_input.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "config_fixture.hpp"
#include "made_run_files.hpp"
#include "nest_run.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using calib::Vector3;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

TEST(ConfigNests, AreReadWithNamePositionAndRadius) {
  const auto config = parse_config(
      kMachine +
          "[tracker]\nnest_repeatability_um = 4\n"
          "[[tracker.nest]]\nname = \"A\"\nposition_mm = [1500, -900, 200]\n"
          "[[tracker.nest]]\nname = \"B\"\nposition_mm = [1800, 950, 150]\nradius_mm = 20\n",
      "machine.toml");
  ASSERT_TRUE(config) << config.error().text;
  const calib::otf::NestOptions nests = nest_options(config->otf);
  EXPECT_DOUBLE_EQ(nests.u_repeatability_m, 4e-6);
  ASSERT_THAT(nests.nests, SizeIs(2));
  EXPECT_EQ(nests.nests[0].name, "A");
  EXPECT_NEAR(nests.nests[0].position_tracker_m.y(), -0.9, 1e-12);
  EXPECT_NEAR(nests.nests[0].radius_m, 10e-3, 1e-12);
  EXPECT_NEAR(nests.nests[1].radius_m, 20e-3, 1e-12);
}

TEST(ConfigNests, FaultsNameTheNestAndTheKey) {
  const auto faults = [](const std::string& nests) {
    return faults_of(kMachine + "[tracker]\n" + nests);
  };
  EXPECT_THAT(faults("[[tracker.nest]]\nname = \"A\"\nposition_mm = [1500, -900]\n"),
              ElementsAre(AllOf(HasSubstr("tracker.nest[0].position_mm"), HasSubstr("three"))));
  EXPECT_THAT(faults("[[tracker.nest]]\nposition_mm = [1500, -900, 200]\n"),
              ElementsAre(AllOf(HasSubstr("tracker.nest[0].name"), HasSubstr("missing"))));
  EXPECT_THAT(faults("nest = [{ name = \"A\", position_mm = [1500, -900, 200] },\n"
                     "        { name = \"B\", position_mm = [1500, -905, 200] }]\n"),
              ElementsAre(AllOf(HasSubstr("tracker.nest[1]"), HasSubstr("apart"))));
  EXPECT_THAT(faults("nest_repeatability_um = -3\n"),
              ElementsAre(HasSubstr("tracker.nest_repeatability_um")));
}

/// A run with drift, and its configuration, in a folder.
fs::path nest_run_files(const tests::otf::NestRunOptions& wanted) {
  const fs::path folder = fs::path(::testing::TempDir()) / fmt::format("nests_{}", ::getpid());
  fs::create_directories(folder);
  const auto run = tests::otf::make_nest_run(wanted);
  std::string machine = test::made_machine_toml(run.machine.target_offset_m) + "[tracker]\n";
  for (const auto& nest : run.options.nests.nests) {
    const Vector3 p_mm = 1e3 * nest.position_tracker_m;
    machine += fmt::format("[[tracker.nest]]\nname = \"{}\"\nposition_mm = [{}, {}, {}]\n",
                           nest.name, p_mm.x(), p_mm.y(), p_mm.z());
  }
  test::write_text(folder / "machine.toml", machine);
  test::write_text(folder / "path.csv", test::made_path_csv(run.path));
  test::write_text(folder / "tracker.csv", test::made_tracker_csv(run.samples));
  return folder;
}

TEST(CliNests, TheDriftIsInSummaryAndFiles) {
  const Vector3 drift_m(16e-6, -16e-6, 16e-6);
  const fs::path folder = nest_run_files({.drift_m = drift_m});
  const std::string command =
      "identify otf --machine machine.toml --path path.csv --tracker tracker.csv "
      "--accept-path-orientation -o out";
  EXPECT_THAT(test::run_abbe(folder, command).out, HasSubstr("drift       of the tracker"));
  EXPECT_THAT(test::text_of(folder / "out/report.html"), HasSubstr("Drift of the tracker"));

  const auto document = read_model(folder / "out/model.json");
  ASSERT_TRUE(document) << document.error().text;
  ASSERT_TRUE(document->tracker_drift);
  const TrackerDriftFigures& drift = *document->tracker_drift;
  EXPECT_GE(drift.visits, 15u);
  EXPECT_NEAR(drift.largest_m.norm(), drift_m.norm(), 0.2 * drift_m.norm());

  const auto printed = nlohmann::json::parse(test::run_abbe(folder, command + " --json").out);
  EXPECT_NEAR(printed.at("tracker_drift").at("largest_um").at(0).get<double>(),
              1e6 * drift.largest_m.x(), 1e-6);
  fs::remove_all(folder);
}

}  // namespace
}  // namespace abbe::daemon
