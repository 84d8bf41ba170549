/// `abbe calibrate bar`: the command, the daemon and a simulated measuring machine over I++ DME, on
/// which the bar is clamped for one pass after the other.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>

#include <filesystem>

#include "abbe/tables/mfb_files.hpp"
#include "config_tables.hpp"
#include "spine.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

struct BarReversal : Spine {
  static constexpr std::size_t kHoles = 6, kTouches = 148, kPasses = 4;

  static std::string machine(int port) {
    std::string text =
        "[machine]\nname = \"measuring\"\nchain = \"[w b X Y Z t]\"\n"
        "[target]\noffset_mm = [0, 0, 0]\n";
    for (const char axis : {'X', 'Y', 'Z'})
      text += fmt::format("[axes.{}]\nmin_mm = -100\nmax_mm = 800\n", axis);
    return text +
           fmt::format("[cmm]\nhost = \"127.0.0.1\"\nport = {}\nu_position_um = 0.4\n", port);
  }
  void start(const std::vector<std::string>& more = {}) {
    write("machine.toml", machine(0));
    write("sim.toml", fmt::format("[sim]\nmachine = \"machine.toml\"\nspeed = {}\n"
                                  "[sim.cmm]\ntravel_mm_per_s = 5000\nprobing_mm_per_s = 200\n",
                                  ABBE_SPINE_SPEED));
    std::vector<std::string> command{ABBE_SIM_PROGRAM,
                                     "bar",
                                     "--config",
                                     file("sim.toml"),
                                     "--ports-file",
                                     file("ports"),
                                     "-o",
                                     file("bar"),
                                     "--holes",
                                     std::to_string(kHoles),
                                     "--repeats",
                                     std::to_string(kPasses / 2)};
    command.insert(command.end(), more.begin(), more.end());
    ASSERT_NO_FATAL_FAILURE(start_simulator_as(std::move(command)));
    write("abbed.toml", machine(port("cmm_port")) + daemon_tables("off"));
    ASSERT_NO_FATAL_FAILURE(start_abbed());
    ASSERT_TRUE(eventually([&] { return samples("cmm") > 2; })) << status().dump(1);
  }
  [[nodiscard]] Outcome calibrate(const std::vector<std::string>& more) const {
    std::vector<std::string> command{ABBE_PROGRAM, "calibrate",        "bar",
                                     "-c",         file("abbed.toml"), "--yes"};
    for (const std::string name : {"bar", "plan", "gauge"}) {
      command.push_back("--" + name);
      command.push_back(file("bar") + (name == "bar" ? "/nominal.toml" : "/" + name + ".toml"));
    }
    command.insert(command.end(), {"-o", file("bar.toml")});
    command.insert(command.end(), more.begin(), more.end());
    return run(std::move(command));
  }
  void clamp_next() {
    const auto clamped = [&] {
      const std::string said = simulator_->err();
      std::size_t count = 0;
      for (auto at = said.find("on the table"); at != std::string::npos;
           at = said.find("on the table", at + 1))
        ++count;
      return count;
    };
    const std::size_t before = clamped();
    simulator_->signal(SIGUSR1);
    ASSERT_TRUE(eventually([&] { return clamped() == before + 1; })) << simulator_->err();
  }
  [[nodiscard]] std::size_t rows_of(const std::string& name) const {
    const std::string text = text_of(file(name));
    return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')) -
           (text.empty() ? 0 : 1);
  }
};

TEST_F(BarReversal, FindsThePointsOfTheBarWithinTheStatedUncertainty) {
  ASSERT_NO_FATAL_FAILURE(start());
  for (std::size_t pass = 1; pass <= kPasses; ++pass) {
    const auto one = calibrate({"--continue", "--at-most", "1"});
    ASSERT_EQ(one.code, 0) << one.out << one.err;
    EXPECT_EQ(rows_of("bar.points.csv"), pass * kTouches);
    ASSERT_NO_FATAL_FAILURE(clamp_next());
  }
  const auto again = calibrate({});  // without --continue
  EXPECT_EQ(again.code, 2) << again.out;
  EXPECT_THAT(again.err, HasSubstr("--continue uses its passes"));

  const auto done = calibrate({"--continue", "--json"});
  ASSERT_EQ(done.code, 0) << done.out << done.err;
  EXPECT_EQ(json::parse(done.out)["repeats"], kPasses / 2);
  const auto found = daemon::read_bar_toml(file("bar.toml"));
  ASSERT_TRUE(found) << found.error().text;
  const calib::mfb::Bar& bar = found->bar;

  std::vector<calib::Vector3> truth_m;
  std::istringstream lines(text_of(file("bar") + "/truebar.csv"));
  for (std::string line; std::getline(lines, line);) {
    double hole = 0.0;
    calib::Vector3 mm;
    if (std::sscanf(line.c_str(), "%lf,%lf,%lf,%lf", &hole, &mm.x(), &mm.y(), &mm.z()) == 4)
      truth_m.push_back(1e-3 * mm);
  }
  ASSERT_EQ(truth_m.size(), kHoles);
  for (std::size_t i = 0; i < kHoles; ++i)
    for (Eigen::Index k = 0; k < 3; ++k) {
      const auto row = 3 * static_cast<Eigen::Index>(i) + k;
      const double u_m = std::sqrt(bar.covariance_m2(row, row));
      EXPECT_LE(std::abs(bar.O_m[i](k) - truth_m[i](k)), 5.0 * u_m + 1e-12) << "hole " << i + 1;
      EXPECT_LT(u_m, 3e-6);  // not so large that anything would agree
    }

  // Offline the same files give the same bar.
  const auto offline =
      run({ABBE_PROGRAM, "identify", "bar", "--bar", file("bar") + "/nominal.toml", "--plan",
           file("bar") + "/plan.toml", "--points", file("bar.points.csv"), "--gauge",
           file("bar.gauge.toml"), "-o", file("again.toml")});
  ASSERT_EQ(offline.code, 0) << offline.err;
  EXPECT_EQ(text_of(file("again.toml")), text_of(file("bar.toml")));
}

TEST_F(BarReversal, ABarThatLiesTurnedIsNamedAndItsTouchesAreKeptAside) {
  ASSERT_NO_FATAL_FAILURE(start({"--turned", "N1=z"}));
  const auto turned = calibrate({});
  EXPECT_EQ(turned.code, 1) << turned.out;
  EXPECT_THAT(turned.err, HasSubstr("N1"));
  EXPECT_THAT(turned.err, HasSubstr("turned"));
  EXPECT_THAT(turned.err, HasSubstr("bar.partial.csv"));
  EXPECT_EQ(rows_of("bar.partial.csv"), kTouches);
  EXPECT_FALSE(std::filesystem::exists(file("bar.points.csv")));
  EXPECT_FALSE(std::filesystem::exists(file("bar.toml")));
}

TEST_F(BarReversal, ATouchThatFindsNothingEndsThePassAndKeepsTheOthers) {
  ASSERT_NO_FATAL_FAILURE(start({"--clamping-mm", "2", "--seed", "3"}));
  const auto missed = calibrate({});
  EXPECT_EQ(missed.code, 1) << missed.out;
  EXPECT_THAT(missed.err, HasSubstr("N1: "));
  EXPECT_THAT(missed.err, HasSubstr("the tip may be low"));
  EXPECT_TRUE(std::filesystem::exists(file("bar.partial.csv")));
}

TEST_F(BarReversal, WithoutAnOperatorOrFilesItIsRefused) {
  ASSERT_NO_FATAL_FAILURE(start());
  write("empty.toml", "");
  const auto bad = run({ABBE_PROGRAM, "calibrate", "bar", "-c", file("abbed.toml"), "--bar",
                        file("empty.toml"), "--plan", file("bar") + "/plan.toml", "--gauge",
                        file("bar") + "/gauge.toml", "-o", file("bar.toml")});
  EXPECT_EQ(bad.code, 3) << bad.err;
  EXPECT_THAT(bad.err, HasSubstr("empty.toml"));

  write("half.toml", replaced(text_of(file("bar") + "/gauge.toml"), "distance_mm = 0\n",
                              "distance_mm = 0\nreadings_mm = [[25.0, 325.0, 175.0]]\n"));
  const auto half = run({ABBE_PROGRAM, "calibrate", "bar", "-c", file("abbed.toml"), "--bar",
                         file("bar") + "/nominal.toml", "--plan", file("bar") + "/plan.toml",
                         "--gauge", file("half.toml"), "-o", file("bar.toml")});
  EXPECT_EQ(half.code, 3) << half.err;
  EXPECT_THAT(half.err, HasSubstr("all have them or none"));

  write("bar.gauge.toml",
        replaced(replaced(text_of(file("bar") + "/gauge.toml"), "(distance_mm = .*)",
                          "$1\nreadings_mm = [[25.0, 325.0, 175.0]]"),
                 "u_um = [0-9.e-]+", "u_um = 0.5"));
  const auto stale = calibrate({});
  EXPECT_EQ(stale.code, 2) << stale.err;
  EXPECT_THAT(stale.err, HasSubstr("bar.gauge.toml: exists: --continue uses its readings"));
  const auto other = calibrate({"--continue"});
  EXPECT_EQ(other.code, 3) << other.err;
  EXPECT_THAT(other.err, HasSubstr("bar.gauge.toml: its readings are of gauge"));
  std::filesystem::remove(file("bar.gauge.toml"));

  write("bar.points.csv", "measurement,feature,index,side,k,x_mm,y_mm,z_mm\nN1,hole,1,,0,1,2,3\n");
  const auto torn = calibrate({"--continue"});
  EXPECT_EQ(torn.code, 3) << torn.err;
  EXPECT_THAT(torn.err, HasSubstr("\"N1\" has 1 rows, a pass has 148 touches"));
}

}  // namespace
}  // namespace abbe::test
