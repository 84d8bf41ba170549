/// The help of `abbe`, and what it answers to a command that it does not know.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "abbe_command.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using test::Ran;
using ::testing::AllOf;
using ::testing::HasSubstr;

class CliHelp : public ::testing::Test {
 protected:
  [[nodiscard]] Ran abbe(const std::string& arguments) const {
    return test::run_abbe(folder_.path(), arguments);
  }

  TemporaryFolder folder_;
};

TEST_F(CliHelp, HelpNamesTheExitCodesAndEnds0) {
  const auto ran = abbe("identify otf --help");
  EXPECT_EQ(ran.exit, 0);
  EXPECT_THAT(ran.out,
              AllOf(HasSubstr("--tracker"), HasSubstr("Exit codes"), HasSubstr("range_mm")));
}

TEST_F(CliHelp, NamesTheNearestCommand) {
  const auto ran = abbe("identfy otf");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("\"identfy\" is not a command"),
                             HasSubstr("the nearest one is `abbe identify`")));
  EXPECT_THAT(abbe("model lst").err, HasSubstr("the nearest one is `abbe model list`"));
  EXPECT_THAT(abbe("wacth").err, HasSubstr("the nearest one is `abbe watch`"));
  EXPECT_THAT(abbe("frobnicate").err, HasSubstr("known: status, "));
}

TEST_F(CliHelp, AGroupOfCommandsAloneListsThem) {
  const auto ran = abbe("calibrate");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("abbe calibrate needs one of its commands"),
                             HasSubstr("abbe calibrate otf: "), HasSubstr("abbe calibrate evemu: "),
                             HasSubstr("see `abbe calibrate --help`")));
}

TEST_F(CliHelp, AnErrorPointsToTheHelpOfItsCommand) {
  const auto ran = abbe("identify otf --out o --wrong");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("--wrong"), HasSubstr("see `abbe identify otf --help`")));
  EXPECT_THAT(abbe("model eval").err, HasSubstr("see `abbe model eval --help`"));
  EXPECT_THAT(abbe("").err, HasSubstr("see `abbe --help`"));
}

TEST_F(CliHelp, HelpIsACommand) {
  const auto help = abbe("help");
  EXPECT_EQ(help.exit, 0);
  EXPECT_EQ(help.out, abbe("--help").out);
  EXPECT_EQ(abbe("help model show").out, abbe("model show --help").out);
  EXPECT_EQ(abbe("help help").exit, 0);
}

TEST_F(CliHelp, HelpForAnUnknownCommandNamesTheNearestOne) {
  const auto ran = abbe("help identfy");
  EXPECT_EQ(ran.exit, 2);
  EXPECT_EQ(ran.out, "");
  EXPECT_THAT(ran.err, HasSubstr("the nearest one is `abbe identify`"));
  EXPECT_THAT(abbe("help model lst").err, HasSubstr("the nearest one is `abbe model list`"));
  EXPECT_EQ(abbe("identfy --help").exit, 2);
}

TEST_F(CliHelp, TheHelpOfEveryCommandHasAnExample) {
  for (const std::string command : {"status",
                                    "calibrate",
                                    "calibrate otf",
                                    "calibrate evemu",
                                    "calibrate probe",
                                    "calibrate artefact",
                                    "calibrate bar",
                                    "plan",
                                    "plan otf",
                                    "plan mfb",
                                    "reference",
                                    "sensors",
                                    "sensors accept",
                                    "machine",
                                    "machine where",
                                    "machine stop",
                                    "machine release",
                                    "tracker",
                                    "tracker status",
                                    "tracker initialize",
                                    "tracker home",
                                    "tracker find",
                                    "tracker reflector",
                                    "tracker reflector list",
                                    "tracker reflector set",
                                    "probe-lines",
                                    "replay",
                                    "identify",
                                    "identify otf",
                                    "identify evemu",
                                    "identify joint",
                                    "identify artefact",
                                    "verify",
                                    "report",
                                    "model",
                                    "model eval",
                                    "model compare",
                                    "model drift",
                                    "model list",
                                    "model show",
                                    "model activate",
                                    "model rollback",
                                    "model prune",
                                    "dds",
                                    "dds keys",
                                    "export"}) {
    EXPECT_THAT(abbe(command + " --help").out,
                AllOf(HasSubstr("Example: abbe " + command), HasSubstr("Exit codes: 0 done")));
  }
}

}  // namespace
}  // namespace abbe::daemon
