/// Values of command line options: a number is decimal, and no value is empty, in every program.

#include <gmock/gmock.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <sstream>
#include <string>

#include "abbe/base/option_values.hpp"
#include "abbe_command.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class OptionValues : public ::testing::Test {
 protected:
  void expect_usage_error(const std::string& arguments, const std::string& what) {
    const auto ran = test::run_abbe(folder_.path(), arguments);
    EXPECT_EQ(ran.exit, 2) << arguments;
    EXPECT_THAT(ran.err, HasSubstr(what)) << arguments;
  }
  TemporaryFolder folder_;
};

TEST_F(OptionValues, AWholeNumberIsDecimal) {
  const std::string otf = "identify otf --machine m --path p --tracker t -o o --segment-samples ";
  for (const std::string value : {"010", "0xa", "0x10", "+-5", "1e1", "-3", "1_000", "''", "1,5"})
    expect_usage_error(otf + value, "--segment-samples");
}

TEST_F(OptionValues, AnotherNumberIsDecimalAndFinite) {
  for (const std::string value : {"0x10", "010", "nan", "inf", "1e", "0x1p3", "1,5", "''"})
    expect_usage_error("model compare a --measured m.csv --u-um " + value, "--u-um");
}

TEST_F(OptionValues, AnEmptyValueIsNotAnAbsentOption) {
  expect_usage_error("model compare a --measured ''", "empty");
  expect_usage_error("replay run.mcap --config ''", "--config: empty, needs a value");
}

TEST_F(OptionValues, TheUnitOfAnOptionMayBeLeftOut) {
  expect_usage_error("export m.json --to heidenhain-com --step ten -o out", "--step-mm");
  expect_usage_error("export m.json --to heidenhain-com --step=ten -o out", "--step-mm");
  expect_usage_error("export m.json --to heidenhain-com --stepp 10 -o out", "--stepp");
  // "--length" is no option of this command, with a unit or without.
  expect_usage_error("export m.json --to heidenhain-com --length 10 -o out", "--length");
}

TEST_F(OptionValues, EarlierNamesAreRead) {
  const std::string otf = "identify otf --machine m --path p --tracker t -o o ";
  expect_usage_error(otf + "--block-samples ten", "--segment-samples");
  const auto ran = test::run_abbe(folder_.path(), otf + "--estimator joint");
  EXPECT_EQ(ran.exit, 4) << "the file m is missing; " << ran.err;
  EXPECT_THAT(ran.err, testing::Not(HasSubstr("--estimator")));
}

TEST_F(OptionValues, EveryProgramChecksThem) {
  for (const fs::path folder : {"daemon", "sim", "linuxcnc", "demo"})
    for (const auto& entry :
         fs::recursive_directory_iterator(fs::path(ABBE_SOURCE_FOLDER) / folder)) {
      if (entry.path().extension() != ".cpp") continue;
      const std::string text = test::text_of(entry.path());
      if (text.find("app.parse(") == std::string::npos) continue;
      EXPECT_THAT(text, HasSubstr("check_option_values(app)")) << entry.path();
    }
}

TEST(OptionMessages, EscapeWhatIsNotPrintable) {
  CLI::App app{"", "abbed"};
  check_option_values(app);
  std::ostringstream text;
  try {
    app.parse(std::vector<std::string>{"--x\x1b[31m"});
    FAIL() << "accepted";
  } catch (const CLI::ParseError& error) {
    EXPECT_NE(app.exit(error, text, text), 0);
  }
  EXPECT_THAT(text.str(), HasSubstr("--x\\u{1B}[31m\nsee `abbed --help`\n"));
}

}  // namespace
}  // namespace abbe::daemon
