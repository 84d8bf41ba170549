/// `abbe reference` and `abbe calibrate probe`: the commands, the daemon and the simulator, on the
/// wire.

#include <gmock/gmock.h>

#include "counter_card_run.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

/// In real time: how well two cards lie beside each other is a matter of this machine's
/// punctuality.
struct ReferenceRun : CounterCardRun {
  static constexpr double kStart_mm = -15.0;  // X and Y; Z 100 mm below

  void SetUp() override {
    speed_ = "1";
    write("sim.toml", at_speed(replaced(text_of(file("sim.toml")), "standstill_s = [0-9]+",
                                        "standstill_s = 5")));
  }
  /// Over the first marks of every scale at 4 mm/s, again and again.
  void write_traverses() const {
    std::string text = "x_mm,y_mm,z_mm,feed_mm_per_min\n-15,-15,-115,415\n";
    for (int i = 0; i < 10; ++i) text += "-3,-3,-103,415\n-15,-15,-115,415\n";
    write("path.csv", text);
  }
  static std::string marks(const std::string& axis, int channel, double zero_mm) {
    return "  { axis = \"" + axis + "\", channel = " + std::to_string(channel) +
           ", signal_period_um = 200, increment = 20, length_mm = 32, zero_mark_mm = " +
           std::to_string(zero_mm) + " },\n";
  }
  static std::string second_card() {
    return "[reference]\ntransport = \"usbip\"\nport = PORT_2\nserial_number = "
           "\"01ABBE08\"\nclock_MHz = 1\n"
           "scan_rate_hz = 1000\nu_alignment_us = 8000\ntolerance_um = 50\naxes = [\n" +
           marks("X", 0, -18) + marks("Y", 1, -18) + marks("Z", 2, -118) + "]\n";
  }
};

TEST_F(ReferenceRun, FindsThePositionsAtWhichTheCountersStarted) {
  write_traverses();
  ASSERT_NO_FATAL_FAILURE(start_both(second_card()));
  ASSERT_TRUE(eventually([&] { return samples("counter_card") > 100; })) << status().dump(1);
  EXPECT_FALSE(status()["reference"]["axes"][0]["known"].get<bool>());
  write_path("path.csv", path());
  const auto too_early =
      run({ABBE_PROGRAM, "calibrate", "otf", "-c", file("abbed.toml"), "--path", file("path.csv")});
  EXPECT_EQ(too_early.code, 5);
  EXPECT_THAT(too_early.err, HasSubstr("axes X, Y, Z are not referenced")) << too_early.out;
  const auto found = run({ABBE_PROGRAM, "reference", "-c", file("abbed.toml"), "--json"});
  ASSERT_EQ(found.code, 0) << found.out << found.err;
  const json axes = json::parse(found.out)["axes"];
  ASSERT_EQ(axes.size(), 3u);
  // The counters started while the machine was at the first vertex.
  for (const auto& axis : axes) {
    const double start_mm = axis["axis"] == "Z" ? kStart_mm - 100.0 : kStart_mm;
    EXPECT_NEAR(1e3 * axis["reading_at_zero"].get<double>(), start_mm, 0.05) << axis.dump();
  }
  EXPECT_TRUE(status()["reference"]["axes"][2]["known"].get<bool>());

  // Both cards' bytes are recorded: the marks in them give the same zero once more.
  ASSERT_EQ(abbed_->stop(), 0) << abbed_->err();
  const auto again =
      run({ABBE_PROGRAM, "replay", "--raw", "--json", recordings().front().string()});
  const json zeros = json::parse(again.out)["reference"];
  ASSERT_EQ(zeros.size(), 3u) << again.out << again.err;
  for (const auto& zero : zeros) {
    ASSERT_TRUE(zero["again"].is_number()) << zero.dump();
    EXPECT_EQ(zero["again"].get<double>(), zero["live"].get<double>())
        << zero.dump();  // to the last bit
  }
}

struct ProbeRun : CounterCardRun {
  static constexpr double kDelay_us = 2000.0;

  /// One place from above at three feeds, four times each.
  void write_touches() const {
    std::string text = "x_mm,y_mm,z_mm,feed_mm_per_min\n0,0,-45,600\n";
    for (const int feed : {60, 240, 480})
      for (int i = 0; i < 4; ++i) text += "0,0,-50.5," + std::to_string(feed) + "\n0,0,-49.5,600\n";
    write("path.csv", text);
    write("sim.toml", text_of(file("sim.toml")) +
                          "[sim.probe]\naxis = \"Z\"\nsurface_mm = -50\ndelay_us = " +
                          std::to_string(kDelay_us) + "\njitter_us = 1\n");
  }
};

TEST_F(ProbeRun, CalibrationFindsTheDelayTheSimulatorHas) {
  write_touches();
  // Latch and clock begin in step: with an external clock the first touches are known to half a
  // scan only.
  wiring_ = "clock_source = \"timer0\"\n";

  ASSERT_NO_FATAL_FAILURE(start_both("[probe]\ndelay_us = 0\n"));
  ASSERT_TRUE(
      eventually([&] { return simulator_->err().find("path driven") != std::string::npos; }));
  ASSERT_TRUE(goes_on("counter_card"));
  ASSERT_EQ(abbed_->stop(), 0) << abbed_->err();
  const auto fit = run(
      {ABBE_PROGRAM, "calibrate", "probe", "--recording", recordings().front().string(), "--json"});
  ASSERT_EQ(fit.code, 0) << fit.out << fit.err;
  const json delay = json::parse(fit.out);
  EXPECT_EQ(delay["touches"], 12);
  EXPECT_NEAR(delay["delay_us"].get<double>(), kDelay_us, 20.0) << delay.dump();
}

}  // namespace
}  // namespace abbe::test
