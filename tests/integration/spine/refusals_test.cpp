/// Message and exit code of abbed when it cannot start.

#include <gmock/gmock.h>

#include "spine.hpp"

namespace abbe::test {
namespace {

using testing::AllOf;
using testing::HasSubstr;

struct Refusals : Spine {
  /// No device answers at these ports; abbed has to cope with that anyway.
  Refusals() {
    tracker_port_ = 1;
    can_port_ = 1;
    write_configuration();
  }
  [[nodiscard]] std::string line_of(const std::string& word) const {
    const std::string text = text_of(file("abbed.toml"));
    const auto at = text.find(word);
    EXPECT_NE(at, std::string::npos);
    return std::to_string(
        1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n'));
  }
  void replace(const std::string& what, const std::string& by) {
    write("abbed.toml", replaced(text_of(file("abbed.toml")), what, by));
  }
  [[nodiscard]] Outcome run_abbed(const std::string& option = "") const {
    std::vector<std::string> command{ABBED_PROGRAM, "--config", file("abbed.toml")};
    if (!option.empty()) command.push_back(option);
    return run(command);
  }
};

TEST_F(Refusals, ValidConfigurationIsReportedAsValidWithItsContent) {
  const auto outcome = run_abbed("--check-config");
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("abbed.toml: valid\n"), HasSubstr("axis X "),
                                 HasSubstr("127.0.0.1:1"), HasSubstr(file("data") + "/models")));
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("warnings:\n"), HasSubstr("daemon.simulated")));
}

TEST_F(Refusals, DataDirectoryThatIsAFileIsAFaultOfTheConfiguration) {
  write("data", "");
  const auto outcome = run_abbed("--check-config");
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("abbed.toml:" + line_of("data_dir") + ":"));
}

TEST_F(Refusals, UnknownOptionIsUsage) {
  const auto outcome = run_abbed("--no-such-option");
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err, HasSubstr("--no-such-option"));
}

TEST_F(Refusals, ThreeErrorsOfAConfigurationAreReportedAtOnceWithTheirLines) {
  replace("(axes.X.\nmin_mm = -100\nmax_mm =) 100", "$1 -200");
  replace("point_rate_hz = 500", "point_rate_Hz = 500");
  replace("chunk_kB = 16", "chunk_kB = \"much\"");
  const auto outcome = run_abbed();
  EXPECT_EQ(outcome.code, 3);
  const auto fault = [this](const std::string& key) { return "abbed.toml:" + line_of(key) + ":"; };
  EXPECT_THAT(outcome.err, HasSubstr(fault("max_mm = -200")));
  EXPECT_THAT(outcome.err, HasSubstr(fault("point_rate_Hz")));
  EXPECT_THAT(outcome.err, HasSubstr(fault("chunk_kB")));
}

TEST_F(Refusals, MissingConfigurationIsNamed) {
  const auto outcome = run({ABBED_PROGRAM, "--config", file("none.toml")});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("none.toml"));
}

// systemd does not start it again: that takes a person.
TEST_F(Refusals, UnreadableConfigurationHasTheExitCodeOfABadOne) {
  std::filesystem::create_directory(file("folder.toml"));
  const auto outcome = run({ABBED_PROGRAM, "--config", file("folder.toml")});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, HasSubstr("folder.toml"));
}

/// As a disk that is read-only or not mounted: acquisition and live publishing come first.
TEST_F(Refusals, FileInPlaceOfTheDataDirectoryIsNamedAndAbbedRuns) {
  write("data", "");
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  EXPECT_THAT(stream("models").value("last_fault", ""), HasSubstr(file("data")));
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
  EXPECT_THAT(abbed_->err(), HasSubstr("warning"));
}

}  // namespace
}  // namespace abbe::test
