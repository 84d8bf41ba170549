// `abbe identify otf --smoothness-um` and [otf] smoothness, on a run of a simulated machine.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/methods/otf/inputs.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "config_fixture.hpp"
#include "synthetic_otf_run.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

/// One folder for the whole suite.
class CliSmoothness : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("cli_smoothness_{}", ::getpid());
    test::write_synthetic_run(folder_);
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static test::Ran identify(const std::string& more, const std::string& out = "out") {
    return test::run_abbe(folder_,
                          "identify otf --machine machine.toml --path path.csv --tracker "
                          "tracker.csv -o " +
                              out + " " + more);
  }

  static inline fs::path folder_;
};

/// Three nodes 60 mm apart: 14 tables with one bend each, of 10 um and 30 urad.
TEST_F(CliSmoothness, StatesThePriorThatWasUsed) {
  const auto ran = identify("--smoothness-um 20 --json");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto summary = nlohmann::json::parse(ran.out);
  const auto& prior = summary.at("smoothness");
  EXPECT_NEAR(prior.at("bend_um")[2].get<double>(), 20.0, 1e-9);
  EXPECT_EQ(prior.at("bends"), 14u);
  EXPECT_EQ(prior.at("left_out"), 0u);
  EXPECT_THAT(summary.at("gate").at("notes").dump(), HasSubstr("a prior for smooth tables"));
  EXPECT_THAT(test::text_of(folder_ / "out/report.html"), HasSubstr("a prior for smooth tables"));
}

TEST_F(CliSmoothness, TakesItsSizeFromTheConfiguration) {
  test::write_text(folder_ / "machine.toml",
                   test::synthetic_machine_toml() + "[otf]\nsmoothness_um = [20, 0, 30]\n");
  const auto configured = identify("", "text"), off = identify("--smoothness-um none", "off");
  test::write_text(folder_ / "machine.toml", test::synthetic_machine_toml());
  EXPECT_THAT(configured.out, HasSubstr("smoothness  prior 20 um (X), none (Y), 30 um (Z)"));
  EXPECT_EQ(off.exit, 0) << off.err;
  EXPECT_THAT(off.out, Not(HasSubstr("smoothness")));
}

TEST_F(CliSmoothness, NamesErrorsThatAreRougher) {
  const auto ran = identify("--smoothness-um 0.1");
  EXPECT_THAT(ran.out + ran.err, HasSubstr("not as smooth as the prior: EZZ at 0 mm"));
  EXPECT_THAT(ran.out, HasSubstr("left out: 12"));
}

TEST_F(CliSmoothness, RefusesWhatIsNoSize) {
  for (const char* text : {"-1", "0", "1,2", "1,2,x", "1e9", "nan", "estimated", "0,0,0"}) {
    const auto ran = identify(std::string("--smoothness-um=") + text, "none");
    EXPECT_EQ(ran.exit, 2) << text;
    EXPECT_THAT(ran.err, HasSubstr("must be none, or the standard deviation")) << text;
  }
  EXPECT_FALSE(fs::exists(folder_ / "none"));
}

TEST(SmoothnessConfig, IsReadAndPassedToTheIdentification) {
  EXPECT_FALSE(parse_config(kMachine, "abbed.toml")->otf.smoothness_m);
  const auto config = parse_config(kMachine + "[otf]\nsmoothness_um = [1, 0, 2.5]\n", "abbed.toml");
  ASSERT_TRUE(config) << config.error().text;
  const auto options = otf_options({}, *config);
  ASSERT_TRUE(options.smoothness);
  EXPECT_THAT(options.smoothness->bend_m, ElementsAre(1e-6, 0.0, 2.5e-6));
  EXPECT_FALSE(
      parse_config(kMachine + "[otf]\nsmoothness = \"none\"\n", "abbed.toml")->otf.smoothness_m);
}

TEST(SmoothnessConfig, RefusesTwoStatementsAndOtherSizes) {
  EXPECT_THAT(faults_of(kMachine + "[otf]\nsmoothness = \"estimated\"\n"),
              Contains(HasSubstr("otf.smoothness: must be")));
  EXPECT_THAT(faults_of(kMachine + "[otf]\nsmoothness = \"none\"\nsmoothness_um = [1, 1, 1]\n"),
              Contains(HasSubstr("otf.smoothness_um: must not be given beside")));
  for (const char* size : {"[1, 1]", "[0, 0, 0]", "[1, -1, 1]", "[1, 1, 1e6]"}) {
    EXPECT_THAT(faults_of(kMachine + "[otf]\nsmoothness_um = " + size + "\n"),
                Contains(HasSubstr("otf.smoothness_um: must be three numbers")))
        << size;
  }
  EXPECT_THAT(
      faults_of(kMachine + "[otf]\nsmoothness_um = [1, 1, 1]\n[drift]\ncontinuous = true\n"),
      Contains(HasSubstr("needs [otf] without smoothness_um")));
}

}  // namespace
}  // namespace abbe::daemon
