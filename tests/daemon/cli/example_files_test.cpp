/// `abbe example`: the readers accept each file that it prints.

#include <gmock/gmock.h>

#include <sstream>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/sim/path_motion.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "abbe/tables/gauge_file.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tables/measured_file.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "abbe/tables/parts_file.hpp"
#include "abbe_command.hpp"
#include "faults_text.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::StartsWith;

class ExampleFiles : public ::testing::Test {
 protected:
  test::Ran abbe(const std::string& arguments) const {
    return test::run_abbe(folder_.path(), arguments);
  }
  /// Prints the example to a file of that name.
  fs::path printed(const std::string& name) const {
    const auto ran = abbe("example " + name);
    EXPECT_EQ(ran.exit, 0) << ran.err;
    EXPECT_THAT(ran.out, StartsWith("# ")) << "an example begins with a comment";
    test::write_text(folder_.path() / name, ran.out);
    return folder_.path() / name;
  }

  TemporaryFolder folder_;
};

TEST_F(ExampleFiles, OfTheMachineAreAccepted) {
  for (const std::string name : {"abbed.toml", "machine.toml", "first_abbed.toml"}) {
    const auto file = printed(name);
    EXPECT_EQ(test::faults_text(parse_config(test::text_of(file), file)), "") << name;
  }
}

TEST_F(ExampleFiles, OfACalibrationOnTheFlyAreAccepted) {
  const auto path = printed("path.csv");
  EXPECT_EQ(test::faults_text(read_path_csv(path)), "");
  EXPECT_TRUE(sim::parse_path_csv(test::text_of(path), "path.csv"));
  EXPECT_EQ(test::faults_text(read_tracker_csv(printed("tracker.csv"))), "");
  EXPECT_EQ(test::faults_text(read_encoder_csv(printed("encoder.csv"))), "");
}

TEST_F(ExampleFiles, OfABallArrayAreAccepted) {
  EXPECT_EQ(test::faults_text(read_calibrator_toml(printed("calibrator.toml"))), "");
  EXPECT_EQ(test::faults_text(read_touches_csv(printed("touches.csv"))), "");
  EXPECT_EQ(test::faults_text(read_errors_csv(printed("errors.csv"))), "");
}

TEST_F(ExampleFiles, OfAMultiFeatureBarAreAccepted) {
  const auto bar = read_bar_toml(printed("bar.toml"));
  ASSERT_TRUE(bar) << test::faults_text(bar);
  const auto plan = read_bar_plan_toml(printed("plan.toml"), bar->bar);
  ASSERT_TRUE(plan) << test::faults_text(plan);
  calib::MachineNodes nodes;
  for (auto& axis : nodes) axis.nodes_m = {0.0, 0.05, 0.5, 0.55};
  EXPECT_EQ(
      test::faults_text(read_bar_points_csv(printed("barpoints.csv"), bar->bar, *plan, nodes)), "");
  EXPECT_EQ(test::faults_text(read_gauge_toml(printed("gauge.toml"))), "");
}

TEST_F(ExampleFiles, OfAJointIdentificationAreAccepted) {
  EXPECT_EQ(test::faults_text(read_parts_toml(printed("parts.toml"))), "");
}

TEST_F(ExampleFiles, OfModelCommandsAreAccepted) {
  EXPECT_EQ(test::faults_text(read_points_csv(printed("points.csv"))), "");
  EXPECT_EQ(test::faults_text(read_verification_csv(printed("verification.csv"))), "");
  EXPECT_EQ(test::faults_text(read_measured_csv(printed("measured.csv"))), "");
}

TEST_F(ExampleFiles, OfTheSimulatorAreAccepted) {
  for (const std::string name : {"sim.toml", "machine.toml", "path.csv", "truth.csv", "points.csv"})
    printed(name);
  const auto ran = abbe("sim truth --config sim.toml --truth truth.csv --points points.csv");
  EXPECT_EQ(ran.exit, 0) << ran.err;
}

/// The commands that `abbe example --set` prints, run as they are printed.
class ExampleSet : public ExampleFiles, public ::testing::WithParamInterface<const char*> {
 protected:
  [[nodiscard]] std::vector<std::string> printed_commands() const {
    const auto ran = abbe(fmt::format("example --set {} files", GetParam()));
    EXPECT_EQ(ran.exit, 0) << ran.err;
    std::vector<std::string> commands;
    std::istringstream lines(ran.out);
    for (std::string line; std::getline(lines, line);)
      if (line.starts_with("  abbe ")) commands.push_back(line.substr(7));
    return commands;
  }
};

TEST_P(ExampleSet, GivesAModelThatMakesItsMachineBetter) {
  const auto commands = printed_commands();
  ASSERT_EQ(commands.size(), 2U);
  const auto identified = test::run_abbe(folder_.path() / "files", commands[0]);
  ASSERT_EQ(identified.exit, 0) << identified.out << identified.err;
  EXPECT_THAT(identified.out, HasSubstr("would accept"));
  const auto verified = test::run_abbe(folder_.path() / "files", commands[1]);
  EXPECT_EQ(verified.exit, 0) << verified.err;
  EXPECT_THAT(verified.out, HasSubstr("better with the model"));
}

INSTANTIATE_TEST_SUITE_P(Each, ExampleSet, ::testing::Values("otf", "evemu", "mfb", "joint"));

TEST_F(ExampleFiles, OfASetReplaceNoFile) {
  std::filesystem::create_directory(folder_.path() / "own");
  test::write_text(folder_.path() / "own" / "machine.toml", "mine");
  const auto ran = abbe("example --set mfb own");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, HasSubstr("own: is not empty; state a new folder"));
  EXPECT_EQ(test::text_of(folder_.path() / "own" / "machine.toml"), "mine");
}

TEST_F(ExampleFiles, OfASetNeedAKnownSetAndAFolder) {
  const auto unknown = abbe("example --set otv files");
  EXPECT_EQ(unknown.exit, 2);
  EXPECT_THAT(unknown.err, HasSubstr("otv"));
  const auto nowhere = abbe("example --set otf");
  EXPECT_EQ(nowhere.exit, 2);
  EXPECT_THAT(nowhere.err, HasSubstr("abbe example --set otf FOLDER"));
}

TEST_F(ExampleFiles, AreListed) {
  const auto ran = abbe("example");
  EXPECT_EQ(ran.exit, 0) << ran.err;
  for (const char* name : {"abbed.toml",
                           "machine.toml",
                           "first_abbed.toml",
                           "sim.toml",
                           "calibrator.toml",
                           "path.csv",
                           "tracker.csv",
                           "encoder.csv",
                           "touches.csv",
                           "bar.toml",
                           "plan.toml",
                           "barpoints.csv",
                           "gauge.toml",
                           "parts.toml",
                           "errors.csv",
                           "points.csv",
                           "verification.csv",
                           "certificate.toml",
                           "mtconnect-devices.xml",
                           "truth.csv"})
    EXPECT_THAT(ran.out, HasSubstr(name));
  std::istringstream lines(ran.out.substr(0, ran.out.find("\n\n")));
  for (std::string line; std::getline(lines, line);)
    EXPECT_THAT(line, ::testing::MatchesRegex("[a-z_.-]+ +[a-z].*")) << "without a purpose";
  EXPECT_THAT(abbe("--help").out, HasSubstr("example"));
}

TEST_F(ExampleFiles, MayBeNamedWithoutExtension) {
  EXPECT_EQ(abbe("example path").out, abbe("example path.csv").out);
}

TEST_F(ExampleFiles, OfAnotherNameAreAUsageError) {
  const auto ran = abbe("example calibratr.toml");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.out, IsEmpty());
  EXPECT_THAT(ran.err, AllOf(HasSubstr("\"calibratr.toml\" is not an example"),
                             HasSubstr("did you mean \"calibrator.toml\"?"),
                             HasSubstr("known: abbed.toml, machine.toml")));
}

}  // namespace
}  // namespace abbe::daemon
