// `abbed --check-config`: what the file refers to on this computer, what abbe understood, and what
// is improbable.
#include "abbe/config/check_config.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "config_fixture.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

const std::string kDevices = kCanBus + kNodes + "[tracker]\nhost = \"10.0.0.7\"\n";

struct CheckConfig : ::testing::Test {
  [[nodiscard]] auto checked(const std::string& text) const {
    test::write_text(path("abbed.toml"), text);
    return check_config(path("abbed.toml"), 8);
  }
  [[nodiscard]] std::vector<std::string> faults(const std::string& text) const {
    const auto config = checked(text);
    return config ? std::vector<std::string>{} : config.error().details;
  }
  [[nodiscard]] std::vector<std::string> warnings(const std::string& text) const {
    const auto config = checked(text);
    return config ? config->warnings : config.error().details;
  }
  [[nodiscard]] std::string path(const std::string& name) const {
    return (folder_.path() / name).string();
  }
  TemporaryFolder folder_;
};

TEST_F(CheckConfig, AcceptsFoldersThatCanBeCreated) {
  EXPECT_THAT(faults(kMachine + kDevices + "[daemon]\ndata_dir = \"a/b/data\"\n"), IsEmpty());
}

TEST_F(CheckConfig, RefusesADataDirectoryBelowAFile) {
  test::write_text(path("file"), "");
  EXPECT_THAT(faults(kMachine + "[daemon]\ndata_dir = \"file/data\"\n"),
              ElementsAre(AllOf(HasSubstr("abbed.toml:19:12: daemon.data_dir:"),
                                HasSubstr(path("file") + " is a file"))));
}

TEST_F(CheckConfig, RefusesAFileInPlaceOfTheRecordings) {
  test::write_text(path("file"), "");
  EXPECT_THAT(faults(kMachine + "[recording]\ndir = \"file\"\n"),
              ElementsAre(HasSubstr("recording.dir:")));
}

TEST_F(CheckConfig, RefusesAMissingProfileAndMissingKeys) {
  EXPECT_THAT(faults(kMachine + "[dds]\nprofile = \"none.xml\"\nsecurity = \"none\"\n"),
              ElementsAre(AllOf(HasSubstr(":19:11: dds.profile:"), HasSubstr(path("none.xml"))),
                          AllOf(HasSubstr(":20:12: dds.security:"), HasSubstr("abbe dds keys"))));
}

TEST_F(CheckConfig, ReportsFaultsOfTheTextAndOfPathsTogether) {
  EXPECT_THAT(faults(kMachine + "[dds]\nprofile = \"none.xml\"\ndomain = 300\n"),
              ElementsAre(HasSubstr("dds.profile"), HasSubstr("dds.domain")));
}

TEST_F(CheckConfig, HasNoWarningForAnOrdinaryMachine) {
  EXPECT_THAT(warnings(kMachine + kDevices), IsEmpty());
}

TEST_F(CheckConfig, NamesWhatIsStillTheExample) {
  for (const char* name : {"abbed.toml", "first_abbed.toml"}) {
    const auto copied =
        check_config(std::filesystem::path(ABBE_DAEMON_EXAMPLES) / name, 8).value().of_the_example;
    EXPECT_THAT(copied, ElementsAre("machine.name \"mill 7\"", "the travel of X, Y and Z",
                                    "target.offset_mm", "tracker.host \"192.168.0.1\""))
        << name;
  }
  const auto edited = checked("[machine]\nname = \"mill 7\"\n" +
                              kMachine.substr(kMachine.find("chain =")) + kDevices);
  ASSERT_TRUE(edited);
  EXPECT_THAT(edited->of_the_example, ElementsAre("machine.name \"mill 7\"", "target.offset_mm"));
  EXPECT_THAT(checked(kMachine + kDevices).value().of_the_example, IsEmpty())
      << "one value alone may be true";
}

// Not a fault: the file may be checked on another computer.
TEST_F(CheckConfig, WarnsOfACpuThatThisComputerDoesNotHave) {
  EXPECT_THAT(warnings(kMachine + kDevices + "[daemon]\nhub_cpu = 7\ntracker_cpu = 99\n"),
              ElementsAre(AllOf(HasSubstr("daemon.tracker_cpu: CPU 99"), HasSubstr("0 to 7"))));
}

TEST_F(CheckConfig, WarnsOfDegreesInPlaceOfRadians) {
  EXPECT_THAT(
      warnings(kMachine + kDevices + "[axes.B]\nkind = \"rotary\"\nmin_rad = -90\nmax_rad = 90\n"),
      ElementsAre(AllOf(HasSubstr("axes.B.max_rad"), HasSubstr("not in degrees"))));
}

TEST_F(CheckConfig, WarnsOfCoarseSteps) {
  const std::string nodes =
      "nodes = [{axis = \"X\", node = 1, step_nm = 20000}, "
      "{axis = \"Y\", node = 2}, {axis = \"Z\", node = 3}]\n";
  EXPECT_THAT(warnings(kMachine + kCanBus + nodes + "[tracker]\nhost = \"t\"\n"),
              ElementsAre(HasSubstr("encoder.nodes[0].step_nm: one count is 20 um")));
}

TEST_F(CheckConfig, WarnsWhereNoDeviceReadsTheAxesOrMeasures) {
  EXPECT_THAT(warnings(kMachine), ElementsAre(HasSubstr("no device reads the axes"),
                                              HasSubstr("no device measures the errors")));
}

TEST_F(CheckConfig, WarnsOfAFolderThatOnlyAShellWouldExpand) {
  EXPECT_THAT(warnings(kMachine + kDevices + "[daemon]\ndata_dir = \"~/abbe\"\n"),
              ElementsAre(AllOf(HasSubstr("daemon.data_dir"), HasSubstr("used as written"))));
}

TEST_F(CheckConfig, WarnsOfATargetFarFromTheTool) {
  auto text = kMachine + kDevices;
  text.replace(text.find("-120"), 4, "-120000");
  EXPECT_THAT(warnings(text), ElementsAre(HasSubstr("target.offset_mm: the reflector is 120 m")));
}

TEST_F(CheckConfig, SummaryNamesMachineAxesDevicesAndFolders) {
  const auto config = checked(kMachine + kDevices + "[daemon]\ndata_dir = \"data\"\n");
  ASSERT_TRUE(config) << config.error().details.front();
  const auto lines = summary_of(config->config);
  EXPECT_THAT(lines, Contains(HasSubstr("\"mill\", chain [w X' b Y Z (C1) t]")));
  EXPECT_THAT(lines, Contains("axis X        -300 to 300 mm, travel 600 mm, 13 nodes"));
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("target"), HasSubstr("20, -15, -120 mm"))));
  EXPECT_THAT(lines, Contains(HasSubstr("10.0.0.7:700, 500 points per second")));
  EXPECT_THAT(lines, Contains(HasSubstr("can0, X node 1 step 1 nm; Y node 2")));
  EXPECT_THAT(lines, Contains(HasSubstr(path("data/recordings"))));
  EXPECT_THAT(lines, Contains(HasSubstr(path("data/models"))));
  EXPECT_THAT(lines, Not(Contains(HasSubstr("counter_card"))));
}

}  // namespace
}  // namespace abbe::daemon
