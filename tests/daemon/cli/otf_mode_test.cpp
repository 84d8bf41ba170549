#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/methods/calibration_request.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "synthetic_otf_recording.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using calib::otf::Mode;
using test::Ran;
using ::testing::AllOf;
using ::testing::HasSubstr;

Config configuration(const std::string& more) {
  return *parse_config(test::synthetic_machine_toml() + more, "machine.toml");
}

/// The mode of a request as it is recorded.
std::optional<Mode> recorded_mode(const OtfRequest& request, const Config* config) {
  const auto task = task_from_json(to_json(request), config);
  const auto recorded = from_attachment(to_attachment(CalibrationRequest{*task, {}}));
  return std::get<OtfRequest>(recorded->task).mode;
}

TEST(OtfModeConfig, IsOnTheFlyUnlessStated) {
  EXPECT_EQ(configuration("").otf.mode, OtfMode::OnTheFly);
  const Config stands = configuration("[otf]\nmode = \"standstill\"\nu_repeatability_um = 2\n");
  EXPECT_EQ(stands.otf.mode, OtfMode::Standstill);
  EXPECT_DOUBLE_EQ(stands.otf.u_repeatability_m, 2e-6);
  const auto refused =
      parse_config(test::synthetic_machine_toml() + "[otf]\nmode = \"static\"\n", "machine.toml");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().details.front(),
              AllOf(HasSubstr("otf.mode"), HasSubstr("standstill")));
}

TEST(OtfModeRequest, IsRecordedWithTheModeOfTheConfiguration) {
  const Config stands = configuration("[otf]\nmode = \"standstill\"\n");
  EXPECT_EQ(recorded_mode({}, &stands), Mode::Standstill);
  EXPECT_EQ(recorded_mode({{}, Mode::OnTheFly}, &stands), Mode::OnTheFly);
}

TEST(OtfModeRequest, WithoutAModeIsThatOfAnEarlierVersion) {
  EXPECT_EQ(recorded_mode({}, nullptr), std::nullopt);
}

TEST(OtfModeRequest, IsRefusedWithAnotherMode) {
  nlohmann::json object = to_json(OtfRequest{});
  object["mode"] = "static";
  EXPECT_THAT(task_from_json(object).error().text, HasSubstr("mode \"static\": must be"));
}

class StandstillRun : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("otf_mode_{}", ::getpid());
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  [[nodiscard]] ModelDocument model() const { return *read_model(folder_ / "out" / "model.json"); }

  fs::path folder_;
};

TEST_F(StandstillRun, IdentifiesFromFilesWhereTheMachineStood) {
  test::write_synthetic_run(folder_);
  const std::string files = "--machine machine.toml --path path.csv --tracker tracker.csv -o out";
  const Ran ran = test::run_abbe(folder_, "identify otf --mode standstill " + files);
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("61 of 61 standstills used"));
  EXPECT_EQ(model().mode, "standstill");
  EXPECT_EQ(model().statistics.observations, 183u);
  EXPECT_LT(model().statistics.after.rms_m, 0.1e-6);
  EXPECT_THAT(test::text_of(folder_ / "out" / "report.html"),
              HasSubstr("laser tracker (otf, standstill), estimator two-step"));
}

TEST_F(StandstillRun, ErrorsNameFileAndTime) {
  test::write_synthetic_run(folder_);
  std::string path = test::synthetic_path_csv();
  path.erase(path.rfind('\n', path.size() - 2) + 1);
  for (int i = 0; i < 20; ++i) path.erase(path.rfind('\n', path.size() - 2) + 1);
  test::write_text(folder_ / "path.csv", path);
  const Ran ran = test::run_abbe(folder_,
                                 "identify otf --mode standstill --machine machine.toml "
                                 "--path path.csv --tracker tracker.csv -o out");
  EXPECT_EQ(ran.exit, 1) << ran.out << ran.err;
  EXPECT_THAT(ran.err, AllOf(HasSubstr("tracker.csv: standstills:"), HasSubstr(" s at (")));
}

TEST_F(StandstillRun, OfARecordedRequestIsUsedByTheReplay) {
  const fs::path recording = test::record_synthetic_run(folder_, Mode::Standstill);
  const Ran ran = test::run_abbe(
      folder_, fmt::format("identify otf --recording '{}' -o out", recording.string()));
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  EXPECT_EQ(model().mode, "standstill");

  // The recording begins at 100 s of 1970, its offset to UTC is 0.
  const auto [first, last] = model().run->conditions->measured.value();
  EXPECT_GE(first, protocol::UtcTime{std::chrono::seconds{100}});
  EXPECT_LT(last, protocol::UtcTime{std::chrono::hours{1}});
  EXPECT_LT(first, last);
}

}  // namespace
}  // namespace abbe::daemon
