/// abbed ends and starts again while the counter card counts on, or does not.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>

#include <fstream>

#include "abbe/pipeline/counting_state.hpp"
#include "counter_card_run.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// In real time, on a machine that stands at its first vertex.
struct CountingRun : CounterCardRun {
  void SetUp() override {
    speed_ = "1";
    write("sim.toml", at_speed(replaced(text_of(file("sim.toml")), "standstill_s = [0-9]+",
                                        "standstill_s = 600")));
    write_path("path.csv", path());

    ASSERT_NO_FATAL_FAILURE(start_both());
    ASSERT_EQ(abbed_->stop(), 0) << abbed_->err();
    without_zero_here();
    fs::remove(kept());
    ASSERT_NO_FATAL_FAILURE(start_abbed());
    ASSERT_TRUE(eventually([&] { return here().code == 0; })) << here().err;
    ASSERT_TRUE(eventually([&] { return referenced() && fs::exists(kept()); })) << status().dump(1);
    ASSERT_TRUE(
        eventually([&] { return text_of(kept()).find("reading_at_zero") != std::string::npos; }));
  }
  /// Without this any start of the counters would count as referenced.
  void without_zero_here() const {
    write("abbed.toml", replaced(text_of(file("abbed.toml")), "zero = \"here\"\n", ""));
  }
  [[nodiscard]] Outcome here() const {
    return run({ABBE_PROGRAM, "reference", "--here", "-c", file("abbed.toml")});
  }
  [[nodiscard]] fs::path kept() const { return directory_ / "data" / "counting-state.json"; }
  void kill_abbed() const {
    abbed_->signal(SIGKILL);
    ASSERT_EQ(abbed_->wait_for_end(), -SIGKILL);
  }
  void wait_for_samples() {
    ASSERT_TRUE(eventually([&] { return samples("counter_card") > 0; })) << abbed_->err();
    ASSERT_TRUE(eventually([&] { return status()["position_m"].size() >= 3; })) << status().dump(1);
  }
  [[nodiscard]] bool referenced() const {
    const json now = status();
    return now.is_object() && now["axes_without_zero"].empty() && now["position_m"].size() >= 3 &&
           now["position_m"][0].is_number();
  }
  [[nodiscard]] double x_m() const { return status()["position_m"][0].get<double>(); }

  static constexpr double kStands_m = 1e-5;  // the counts of a simulated scale scatter less
};

TEST_F(CountingRun, TheZeroIsKeptAfterAKillAndAfterAStop) {
  const double before_m = x_m();
  ASSERT_NO_FATAL_FAILURE(kill_abbed());
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_TRUE(eventually([&] { return referenced(); })) << abbed_->err() << status().dump(1);
  EXPECT_NEAR(x_m(), before_m, kStands_m);
  EXPECT_TRUE(eventually([&] { return abbed_->err().find("counted on") != std::string::npos; }));
  EXPECT_THAT(abbed_->err(), HasSubstr("X, Y, Z stay referenced"));

  ASSERT_EQ(abbed_->stop(), 0) << abbed_->err();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_TRUE(eventually([&] { return referenced(); })) << abbed_->err() << status().dump(1);
  EXPECT_NEAR(x_m(), before_m, kStands_m);

  // The recorded bytes give the recorded readings, to the last digit.
  ASSERT_TRUE(goes_on("counter_card"));
  const std::string recording = status()["recording"];
  ASSERT_EQ(abbed_->stop(), 0) << abbed_->err();
  const auto finished = recording.substr(0, recording.find(".part"));
  const auto live = run({ABBE_PROGRAM, "replay", "--samples", finished});
  const auto again = run({ABBE_PROGRAM, "replay", "--raw", "--samples", finished});
  ASSERT_FALSE(live.out.empty()) << live.err;
  EXPECT_TRUE(live.out == again.out) << live.out.substr(0, 500) << "\n" << again.out.substr(0, 500);
}

TEST_F(CountingRun, ACardThatWasWithoutPowerIsNotReferenced) {
  ASSERT_NO_FATAL_FAILURE(kill_abbed());
  simulator_.reset();
  fs::remove(file("ports"));
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  write_card_configuration(card_at_its_port());
  without_zero_here();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_NO_FATAL_FAILURE(wait_for_samples());
  EXPECT_EQ(status()["axes_without_zero"], json::array({"X", "Y", "Z"}));
  EXPECT_THAT(stream("counter_card")["last_fault"].get<std::string>(),
              HasSubstr("did not continue"));
}

TEST_F(CountingRun, AfterAnotherBootNothingIsReferenced) {
  ASSERT_NO_FATAL_FAILURE(kill_abbed());
  const auto state = daemon::counting_state_from_text(text_of(kept()), "kept");
  ASSERT_TRUE(state) << state.error().text;
  auto earlier = *state;
  earlier.boot_id = "00000000-0000-0000-0000-000000000000";
  std::ofstream{kept()} << daemon::to_text(earlier);
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_NO_FATAL_FAILURE(wait_for_samples());
  EXPECT_EQ(status()["axes_without_zero"], json::array({"X", "Y", "Z"}));
  EXPECT_THAT(abbed_->err(), HasSubstr("this computer was restarted since"));
}

TEST_F(CountingRun, ADamagedFileIsRenamedAndNothingIsReferenced) {
  ASSERT_NO_FATAL_FAILURE(kill_abbed());
  const auto text = text_of(kept());
  std::ofstream{kept()} << text.substr(0, text.size() / 2);
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_NO_FATAL_FAILURE(wait_for_samples());
  EXPECT_EQ(status()["axes_without_zero"], json::array({"X", "Y", "Z"}));
  EXPECT_THAT(abbed_->err(), HasSubstr("kept as " + kept().string() + ".damaged"));
  EXPECT_EQ(text_of(kept().string() + ".damaged"), text.substr(0, text.size() / 2));
}

}  // namespace
}  // namespace abbe::test
