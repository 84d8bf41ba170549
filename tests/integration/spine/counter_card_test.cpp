/// The axes come from a counter card instead of CAN encoders: abbe-sim plays it over USB/IP, abbed reads it.

#include <gmock/gmock.h>

#include <string>

#include "program.hpp"
#include "spine.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

struct CounterCardRun : Spine {
  static std::string wiring(const std::string& more) {
    return "[counter_card]\ntransport = \"usbip\"\nserial_number = \"01ABBE08\"\nclock_MHz = 1\n"
           "scan_rate_hz = 1000\nlatch_channel = 6\n" +
           more +
           "axes = [\n"
           "  { axis = \"X\", channel = 0, step_nm = 10 },\n"
           "  { axis = \"Y\", channel = 1, step_nm = 10 },\n"
           "  { axis = \"Z\", channel = 2, step_nm = 10 },\n]\n";
  }
  /// The simulator reads the same wiring as the daemon.
  void start_both() {
    write_path("path.csv", path());
    write("machine.toml", text_of(file("machine.toml")) + wiring(""));
    ASSERT_NO_FATAL_FAILURE(start_simulator());
    const std::string ports = text_of(file("ports"));
    const auto at = ports.find("usbip_port=");
    ASSERT_NE(at, std::string::npos) << ports;
    write_card_configuration(wiring("port = " + std::to_string(std::stoi(ports.substr(at + 11))) + "\n"));
    ASSERT_NO_FATAL_FAILURE(start_abbed());
  }
  void write_card_configuration(const std::string& card) {
    write_configuration();
    std::string text = text_of(file("abbed.toml"));
    const auto encoder = text.find("[encoder]");
    text.replace(encoder, text.find("[daemon]") - encoder, card);
    write("abbed.toml", text);
  }
};

TEST_F(CounterCardRun, StreamsRecordsAndSaysWhatItTakesForGranted) {
  ASSERT_NO_FATAL_FAILURE(start_both());
  ASSERT_TRUE(eventually([&] { return samples("counter_card") > 1000; })) << status().dump(1);
  EXPECT_EQ(stream("counter_card")["state"], "streaming");
  EXPECT_TRUE(goes_on("counter_card"));
  EXPECT_EQ(abbed_->stop(), 0) << abbed_->err();
  EXPECT_THAT(abbed_->err(), HasSubstr("not yet seen on hardware"));
  ASSERT_EQ(recordings().size(), 1u);
  EXPECT_EQ(recordings().front().extension(), ".mcap");
}

TEST_F(CounterCardRun, IsRefusedByNameWithAWiringThatCannotBe) {
  write_card_configuration(wiring("port = 3240\nclock_channel = 1\n"));
  const auto checked = run({ABBED_PROGRAM, "--check-config", "-c", file("abbed.toml")});
  EXPECT_NE(checked.code, 0);
  EXPECT_THAT(checked.out + checked.err, HasSubstr("channel 1 is claimed by axis Y and the clock"));
}

}  // namespace
}  // namespace abbe::test
