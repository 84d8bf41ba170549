#include "abbe/config/config.hpp"

#include <gmock/gmock.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <string>

#include "abbe/config/unmeasured_air.hpp"
#include "abbe/devices/tracker_options.hpp"
#include "config_fixture.hpp"

namespace abbe::daemon {
namespace {

using std::chrono::microseconds;

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;

TEST(Config, ReadsAMachineInSI) {
  const auto config = parse_config(kMachine, "machine.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  const auto& machine = config->machine;
  EXPECT_EQ(machine.find_axis("X")->min, -0.3);
  EXPECT_EQ(machine.target_offset_m, (std::array<double, 3>{0.02, -0.015, -0.12}));
  EXPECT_THAT(machine.nodes_m.at("X"), SizeIs(13));
  EXPECT_EQ(machine.nodes_m.at("X").back(), 0.3);
}

std::string dotted(int parts) {
  std::string key = "a";
  for (int i = 1; i < parts; ++i) key += ".a";
  return key;
}

TEST(Config, NestingIsBoundedBeforeParsing) {
  const std::string quoted_dots = "# a.a.a.a\n[x]\nname = \"" + dotted(200) + "\"\n";
  EXPECT_THAT(faults_of(quoted_dots), Not(Contains(HasSubstr("nested deeper"))));
  std::string numbers = "many = [0.5";
  for (int i = 0; i < 200; ++i) numbers += ", 0.5";
  EXPECT_THAT(faults_of(numbers + "]\n"), Not(Contains(HasSubstr("nested deeper"))));
  const auto deep = StartsWith("abbed.toml:2:");

  for (const auto& text :
       {dotted(40'000) + " = 1\n", "[" + dotted(40'000) + "]\n", "[[" + dotted(40'000) + "]]\n",
        "x = {" + dotted(40'000) + " = 1}\n", "x = " + std::string(40'000, '['),
        "\"\".'b' . " + dotted(40'000) + " = 1\n",
        "x = [\"\"\"\\\"\"\"\"\"\", " + std::string(40'000, '[')}) {
    EXPECT_THAT(faults_of("\n" + text),
                ElementsAre(AllOf(deep, HasSubstr("nested deeper than 64"))))
        << text.substr(0, 30);
  }
}

TEST(Config, LevelsOfTablesKeysAndValuesAddUp) {
  EXPECT_THAT(faults_of("[" + dotted(30) + "]\n" + dotted(30) + " = {" + dotted(30) + " = 1}\n"),
              ElementsAre(HasSubstr("nested deeper")));
}

TEST(Config, ATextOfMoreThanAMegabyteIsNotParsed) {
  const auto config = parse_config(std::string((1u << 20) + 1, '#'), "abbed.toml");
  ASSERT_FALSE(config);
  EXPECT_THAT(config.error().text, HasSubstr("at most 1048576 are read"));
}

TEST(Config, PutsTheReferenceAtZeroIfInsideElseAtTheMinimum) {
  const auto config = parse_config(kMachine, "machine.toml");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->machine.find_axis("X")->reference, 0.0);
  EXPECT_EQ(config->machine.find_axis("Y")->reference, 0.01);
  EXPECT_EQ(config->machine.find_axis("Z")->reference, -0.4);
}

TEST(Config, OfAMachineAloneHasNoDevices) {
  const auto config = parse_config(kMachine + "[tracker]\nsigma_range_um = 1.5\n", "machine.toml");
  ASSERT_TRUE(config);
  EXPECT_DOUBLE_EQ(config->machine.sigma_range_m, 1.5e-6);
  EXPECT_FALSE(config->of<TrackerConfig>());
  EXPECT_FALSE(config->of<EncoderConfig>());
}

TEST(Config, ReadsWhereTheTrackerStandsAndItsVertical) {
  const auto config = parse_config(
      kMachine + "[tracker]\nvertical = \"-Y\"\nposition_mm = [2100, 900, -300]\n", "machine.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  EXPECT_EQ(config->machine.tracker_vertical, TrackerVertical::MinusY);
  EXPECT_EQ(config->machine.tracker_position_m, (std::array{2.1, 0.9, -0.3}));
}

TEST(Config, RefusesAVerticalThatIsNoAxisAndAPlaceOfTwoNumbers) {
  const auto config = parse_config(
      kMachine + "[tracker]\nvertical = \"up\"\nposition_mm = [2100, 900]\n", "machine.toml");
  ASSERT_FALSE(config);
  EXPECT_THAT(config.error().details, UnorderedElementsAre(HasSubstr("tracker.vertical"),
                                                           AllOf(HasSubstr("tracker.position_mm"),
                                                                 HasSubstr("three numbers"))));
}

TEST(Config, ReadsDevicesOfTheDaemon) {
  const auto config = parse_config(kMachine + R"(
[tracker]
host = "10.0.0.7"
max_constant_delay_us = 1500
weather = "read"
[encoder]
transport = "udp"
peer_host = "10.0.0.8"
peer_port = 20000
sync_period_us = 500
nodes = [{axis = "X", node = 1, step_nm = 10, invert = true}, {axis = "Y", node = 2}, {axis = "Z", node = 3}]
)",
                                   "abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  EXPECT_EQ(config->of<TrackerConfig>()->max_constant_delay, microseconds{1500});
  EXPECT_EQ(config->of<TrackerConfig>()->weather, WeatherConfig::Read);
  EXPECT_EQ(config->of<EncoderConfig>()->sync_period, microseconds{500});
  EXPECT_DOUBLE_EQ(config->of<EncoderConfig>()->nodes[0].step, -1e-8);
  EXPECT_DOUBLE_EQ(config->of<EncoderConfig>()->nodes[1].step, 1e-9);
}

TEST(Config, ReadsWhichReflectorTheTrackerHoldsAndHowItGetsThere) {
  const std::string tracker = kMachine + "[tracker]\nhost = \"h\"\n";
  const auto plain = parse_config(tracker + "reflector = \"\"\n", "abbed.toml");
  ASSERT_TRUE(plain) << plain.error().details.front();
  EXPECT_EQ(plain->of<TrackerConfig>()->reflector, "");
  EXPECT_FALSE(plain->of<TrackerConfig>()->home_after_initialize ||
               plain->of<TrackerConfig>()->search);
  EXPECT_FALSE(device_options(*plain->of<TrackerConfig>(), 1.0).session.search);
  const auto config = parse_config(tracker + R"(reflector = "SMR 1.5\""
home_after_initialize = true
search_radius_mm = 30
search_timeout_s = 7.5
)",
                                   "abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  const auto session = device_options(*config->of<TrackerConfig>(), 1.0).session;
  EXPECT_EQ(session.reflector, "SMR 1.5\"");
  EXPECT_TRUE(session.home_after_initialize);
  ASSERT_TRUE(session.search);
  EXPECT_DOUBLE_EQ(session.search->radius, 30.0);
  EXPECT_EQ(session.search->timeout_ms, 7500);
}

TEST(Config, RefusesASearchWithoutBothBoundsAndUnknownReflectorNames) {
  const std::string tracker = kMachine + "[tracker]\nhost = \"h\"\n";
  EXPECT_THAT(
      faults_of(tracker + "search_radius_mm = 30\n"),
      ElementsAre(AllOf(HasSubstr("tracker.search_timeout_s"), HasSubstr("takes both or none"))));
  EXPECT_THAT(
      faults_of(tracker + "search_timeout_s = 30\n"),
      ElementsAre(AllOf(HasSubstr("tracker.search_radius_mm"), HasSubstr("takes both or none"))));
  EXPECT_THAT(
      faults_of(tracker + "search_radius_mm = 0\nsearch_timeout_s = 1e9\n"),
      ElementsAre(HasSubstr("tracker.search_radius_mm"), HasSubstr("tracker.search_timeout_s")));
  EXPECT_THAT(faults_of(tracker + "home_after_initialize = 1\n"),
              ElementsAre(HasSubstr("tracker.home_after_initialize: must be true or false")));
  EXPECT_THAT(faults_of(tracker + "reflector = \"" + std::string(97, 'x') + "\"\n"),
              ElementsAre(HasSubstr("tracker.reflector: must be at most 96 bytes")));
}

TEST(Config, TheControllersAirIsUncertainIfItCorrectsForIt) {
  const auto u_scale = [](const std::string& more) {
    return parse_config(kMachine + "[tracker]\nhost = \"t\"\n" + more, "abbed.toml")
        ->of<TrackerConfig>()
        ->u_scale;
  };
  EXPECT_DOUBLE_EQ(u_scale(""), 0.2e-6);
  EXPECT_EQ(u_scale("weather = \"read\"\n[air]\nassumed_index = 1.00027\n"), 0.0);
  EXPECT_DOUBLE_EQ(u_scale("weather = \"none\"\nu_scale_ppm = 1\n"), 1e-6);
  EXPECT_EQ(u_scale("u_scale_ppm = 0\n"), 0.0);
}

// 1.044e-5 by quadrature over 15 to 30 C, 950 to 1050 hPa, 10 to 90 %: see
// tests/calib/refractive_index_test.cpp.
TEST(Config, UncorrectedAirHasTheUncertaintyOfShopFloorAir) {
  for (const char* weather : {"none", "read"}) {
    const auto config = parse_config(
        kMachine + "[tracker]\nhost = \"t\"\nweather = \"" + weather + "\"\n", "abbed.toml");
    ASSERT_TRUE(config);
    EXPECT_NEAR(config->of<TrackerConfig>()->u_scale, 1.044e-5, 2e-7);
    EXPECT_THAT(unmeasured_air_text(*config, config->of<TrackerConfig>()->u_scale).value_or(""),
                HasSubstr(weather));
  }
}

TEST(Config, TheControllerIsSetToTheStatedAir) {
  const auto config =
      parse_config(kMachine + "[tracker]\nhost = \"t\"\nweather = \"none\"\n", "abbed.toml");
  ASSERT_TRUE(config);
  const auto set = device_options(*config->of<TrackerConfig>(), 1.0).session.environment;
  EXPECT_NEAR(set.temperature, 20.0, 1e-9);
  EXPECT_NEAR(set.pressure, 1013.25, 1e-9);
  EXPECT_NEAR(set.humidity, 50.0, 1e-9);
  EXPECT_THAT(unmeasured_air_text(*config, 0.0).value_or(""), HasSubstr("20 C, 1013.25 hPa, 50 %"));
}

TEST(Config, ARateOfZeroMeansAtEveryNewSample) {
  const auto config =
      parse_config(kMachine + "[dds]\nsnapshot_hz = 0\ncompensation_hz = 0\n", "abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  EXPECT_EQ(config->dds.snapshot_hz, 0.0);
  EXPECT_EQ(config->dds.compensation_hz, 0.0);
}

TEST(Config, DdsSecurityKeyPathsAreRelativeToTheFile) {
  const auto config =
      parse_config(kMachine + "[dds]\nsecurity = \"keys/daemon\"\n", "/etc/abbe/abbed.toml");
  ASSERT_TRUE(config) << config.error().details.front();
  EXPECT_EQ(config->dds.security, "/etc/abbe/keys/daemon");
  EXPECT_EQ(parse_config(kMachine, "abbed.toml")->dds.security, "");
}

TEST(Config, RefusesANegativeRate) {
  EXPECT_THAT(faults_of(kMachine + "[dds]\nsnapshot_hz = -1\n"),
              ElementsAre(HasSubstr("snapshot_hz")));
}

TEST(Config, AnchorsRelativePathsAtTheFile) {
  const auto config = parse_config(
      kMachine + "[daemon]\ndata_dir = \"data\"\nruntime_dir = \"/run/x\"\n", "/etc/a/b.toml");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->recording.dir, "/etc/a/data/recordings");
  EXPECT_EQ(config->control.socket, "/run/x/control.sock");
}

TEST(Config, ReportsThreeFaultsWithTheirLines) {
  const auto faults = faults_of(
      kMachine +
      "[daemon]\nhub_period_us = \"fast\"\n[dds]\ndomian = 3\n[gate]\nmax_error_mm = -1\n");
  EXPECT_THAT(
      faults,
      ElementsAre(
          AllOf(StartsWith("abbed.toml:19:17: daemon.hub_period_us:"), HasSubstr("a number")),
          AllOf(StartsWith("abbed.toml:21:1: dds.domian:"), HasSubstr("did you mean \"domain\"")),
          AllOf(StartsWith("abbed.toml:23:16: gate.max_error_mm:"), HasSubstr("positive"))));
}

TEST(Config, SuggestsTheKeyWithItsUnit) {
  auto text = kMachine;
  text.replace(text.find("min_mm"), 6, "min");
  EXPECT_THAT(faults_of(text),
              ElementsAre(HasSubstr("axes.X.min_mm: missing"),
                          AllOf(HasSubstr("axes.X.min: unknown key"), HasSubstr("\"min_mm\""))));
}

std::string unknown_keys(int count) {
  std::string text = kMachine + "[daemon]\n";
  for (int i = 0; i < count; ++i) text += "nonsense_" + std::to_string(i) + " = 1\n";
  return text;
}

TEST(Config, ReportsAllFaults) {
  const auto faults = faults_of(unknown_keys(30));
  EXPECT_THAT(faults, SizeIs(30));
  EXPECT_THAT(faults.front(), HasSubstr("nonsense_0"));
  EXPECT_THAT(faults.back(), HasSubstr("nonsense_29"));
}

TEST(Config, CountsTheFaultsBeyondAThousand) {
  const auto faults = faults_of(unknown_keys(1100));
  EXPECT_THAT(faults, SizeIs(1001));
  EXPECT_THAT(faults.back(), HasSubstr("and 100 more"));
}

// Each of the three axes reads the spacing.
TEST(Config, ReportsARepeatedFaultOnceWithItsCount) {
  auto text = kMachine;
  text.replace(text.find("node_spacing_mm = 50"), 20, "node_spacing_mm = -5");
  const auto config = parse_config(text, "abbed.toml");
  ASSERT_FALSE(config);
  EXPECT_EQ(config.error().text, "abbed.toml: 1 fault");
  EXPECT_THAT(config.error().details,
              ElementsAre(AllOf(HasSubstr("model.node_spacing_mm"), HasSubstr("(3 times)"))));
}

TEST(Config, RefusesATravelThatNoMachineHas) {
  auto text = kMachine;
  text.replace(text.find("max_mm = 300"), 12, "max_mm = -299.7");
  EXPECT_THAT(faults_of(text),
              ElementsAre(AllOf(HasSubstr("abbed.toml:6:"), HasSubstr("axes.X.max_mm"),
                                HasSubstr("only 0.3 mm"), HasSubstr("at least 1 mm"))));
}

TEST(Config, RefusesAHostThatCannotBeOne) {
  for (const std::string host :
       {"192.168.0.300", "10.0.256", "10.0.0.7:700", "http://tracker", "a b"})
    EXPECT_THAT(faults_of(kMachine + "[tracker]\nhost = \"" + host + "\"\n"),
                ElementsAre(AllOf(StartsWith("abbed.toml:19:8: tracker.host:"), HasSubstr(host))));
}

TEST(Config, TakesNamesAndAddressesAsHosts) {
  for (const std::string host :
       {"192.168.0.255", "192.168.001.002", "10.1", "tracker", "at960.shop-floor.local", "7a.",
        "pr\u00fcfstand.local", "fd00::7", "fe80::1%eth0"})
    EXPECT_THAT(faults_of(kMachine + "[tracker]\nhost = \"" + host + "\"\n"), SizeIs(0)) << host;
}

TEST(Config, ChecksTheHostsOfAllDevices) {
  const std::string bad = "host = \"10.0.0.256\"\n";
  EXPECT_THAT(faults_of(kMachine + "[cmm]\n" + bad), ElementsAre(HasSubstr("cmm.host")));
  EXPECT_THAT(
      faults_of(kMachine + "[encoder]\ntransport = \"udp\"\npeer_port = 9\npeer_" + bad + kNodes),
      ElementsAre(HasSubstr("encoder.peer_host")));
  EXPECT_THAT(faults_of(kMachine + "[[environment]]\nname = \"a\"\n" + bad +
                        "map = \"vaisala-indigo520-hmp\"\n"),
              ElementsAre(HasSubstr("environment[0].host")));
}

TEST(Config, NamesThePlaceOfASyntaxFault) {
  EXPECT_THAT(faults_of(kMachine + "[daemon\n"), ElementsAre(StartsWith("abbed.toml:18:8:")));
}

TEST(Config, RefusesAnotherSpeedForRealDevices) {
  EXPECT_THAT(faults_of(kMachine + "[daemon]\nspeed = 10\n"),
              ElementsAre(HasSubstr("simulated = true")));
  EXPECT_THAT(faults_of(kMachine + "[daemon]\nspeed = 10\nsimulated = true\n"), SizeIs(0));
}

TEST(Config, RefusesAKinematicChainThatIsNotAChain) {
  auto text = kMachine;
  text.replace(text.find("Y Z (C1)"), 8, "Y Y (C1)");
  EXPECT_THAT(faults_of(text), ElementsAre(HasSubstr("machine.chain:")));
}

TEST(Config, TheSamplingInstantOfARealNodeIsNeverPerfectlyKnown) {
  const auto silent = parse_config(kMachine + kCanBus + kNodes, "abbed.toml");
  ASSERT_TRUE(silent);
  EXPECT_GT(silent->of<EncoderConfig>()->u_sampling_delay.count(), 0);
  const std::string zero = kMachine + kCanBus + "u_sampling_delay_us = 0\n" + kNodes;
  EXPECT_THAT(faults_of(zero),
              ElementsAre(HasSubstr("encoder.u_sampling_delay_us: must be positive")));
  EXPECT_THAT(faults_of(zero + "[daemon]\nsimulated = true\n"), SizeIs(0));
}

TEST(Config, RefusesNamesThatNoMessageCanCarry) {
  const auto with = [](std::string text, const std::string& what, std::size_t length) {
    return text.replace(text.find(what), what.size(), std::string(length, 'm'));
  };

  EXPECT_THAT(faults_of(with(kMachine, "mill", 64)), SizeIs(0));
  EXPECT_THAT(faults_of(with(kMachine, "mill", 65)),
              ElementsAre(HasSubstr("machine.name: must be at most 64")));
  const std::string devices = kMachine + "[tracker]\nhost = \"h\"\nname = \"TTT\"\n" + kCanBus +
                              "name = \"EEE\"\n" + kNodes;
  EXPECT_THAT(faults_of(with(devices, "TTT", 32)), SizeIs(0));
  EXPECT_THAT(faults_of(with(devices, "TTT", 33)),
              ElementsAre(HasSubstr("tracker.name: must be at most 32")));
  EXPECT_THAT(faults_of(with(devices, "EEE", 33)),
              ElementsAre(HasSubstr("encoder.name: must be at most 32")));
}

TEST(Config, RefusesAModelOfMoreParametersThanCanBePublished) {
  auto text = kMachine;
  text.replace(text.find("node_spacing_mm = 50"), 20, "node_spacing_mm = 5");
  EXPECT_THAT(faults_of(text), ElementsAre(AllOf(HasSubstr("model.node_spacing_mm"),
                                                 HasSubstr("can be published"))));
}

TEST(Config, TakesThePointRatesATrackerHas) {
  const auto rate = [](const std::string& hz) {
    const auto config = parse_config(
        kMachine + "[tracker]\nhost = \"h\"\npoint_rate_hz = " + hz + "\n", "abbed.toml");
    return config ? config->of<TrackerConfig>()->point_rate_hz : 0.0;
  };
  EXPECT_EQ(rate("1000"), 1000.0);
  EXPECT_EQ(rate("500"), 500.0);
  EXPECT_DOUBLE_EQ(rate("333"), 1e3 / 3.0);
  EXPECT_THAT(faults_of(kMachine + "[tracker]\nhost = \"h\"\npoint_rate_hz = 300\n"),
              ElementsAre(AllOf(HasSubstr("tracker.point_rate_hz"), HasSubstr("250 or 333.3"))));
}

TEST(Config, ReadsBothModesOfATracker) {
  const std::string tracker = kMachine + "[tracker]\nhost = \"h\"\n";
  EXPECT_EQ(parse_config(tracker, "abbed.toml")->of<TrackerConfig>()->mode,
            TrackerModeConfig::Continuous);
  const auto config =
      parse_config(tracker + "mode = \"stationary\"\nstationary_time_ms = 800\n", "abbed.toml");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->of<TrackerConfig>()->mode, TrackerModeConfig::Stationary);
  EXPECT_EQ(config->of<TrackerConfig>()->stationary_time, std::chrono::milliseconds{800});
  EXPECT_THAT(faults_of(tracker + "mode = \"stationary\"\npoint_rate_hz = 500\n"),
              ElementsAre(HasSubstr("tracker.point_rate_hz")));
  EXPECT_THAT(faults_of(tracker + "stationary_time_ms = 500\n"),
              ElementsAre(HasSubstr("tracker.stationary_time_ms")));
}

TEST(Config, TheProcessorsIdleStatesAreNotLimitedByDefault) {
  EXPECT_FALSE(parse_config(kMachine, "abbed.toml")->daemon.cpu_latency);
  const auto config = parse_config(kMachine + "[daemon]\ncpu_latency_us = 0\n", "abbed.toml");
  ASSERT_TRUE(config);
  EXPECT_EQ(config->daemon.cpu_latency, std::chrono::microseconds{0});
  EXPECT_THAT(faults_of(kMachine + "[daemon]\ncpu_latency_us = -1\n"),
              ElementsAre(HasSubstr("daemon.cpu_latency_us")));
}

TEST(Config, RefusesPeriodsTheLivenessRulesForbid) {
  EXPECT_THAT(faults_of(kMachine + "[daemon]\nhub_period_us = 60000\n"),
              ElementsAre(HasSubstr("hub_period_us")));
  EXPECT_THAT(faults_of(kMachine + kCanBus + "sync_period_us = 200000\n" + kNodes),
              ElementsAre(HasSubstr("sync_period_us")));
}

TEST(Config, RefusesNodesThatDoNotSpanTheTravel) {
  auto text = kMachine + "nodes_mm = { X = [-300, 0, 299] }\n";
  EXPECT_THAT(faults_of(text), ElementsAre(HasSubstr("model.nodes_mm.X: first and last node")));
}

TEST(Config, RefusesInfinity) {
  auto text = kMachine;
  text.replace(text.find("-300"), 4, "-inf");
  EXPECT_THAT(faults_of(text), ElementsAre(HasSubstr("axes.X.min_mm: must be finite")));
}

TEST(Config, NamesTheFileThatCannotBeRead) {
  const auto config = load_config("/nonexistent/abbed.toml");
  ASSERT_FALSE(config);
  EXPECT_EQ(config.error().code, ErrorCode::Io);
  EXPECT_THAT(config.error().text,
              AllOf(HasSubstr("/nonexistent/abbed.toml"), HasSubstr("No such file")));
}

TEST(Config, KeepsTheParticipantBehindTheHub) {
  EXPECT_THAT(
      faults_of(kMachine + "[daemon]\nhub_priority = 15\n"),
      ElementsAre(AllOf(HasSubstr("priority"), HasSubstr("below [daemon] hub_priority 15"))));
  EXPECT_THAT(faults_of(kMachine + "[daemon]\nhub_priority = 15\n[dds]\npriority = 14\n"),
              SizeIs(0));
}

TEST(Config, DeviceNamesAreUniqueAndDifferFromThoseOfTheDaemonsParts) {
  const auto with = [](const std::string& tracker) {
    return faults_of(kMachine + "[tracker]\nhost = \"10.0.0.7\"\nname = \"" + tracker + "\"\n" +
                     kCanBus + kNodes);
  };
  EXPECT_THAT(with("laser"), SizeIs(0));
  EXPECT_THAT(with("encoder"),
              ElementsAre(HasSubstr("encoder.name: two devices are called \"encoder\"")));
  for (const char* own : {"recorder", "models", "dds", "dds_security", "identity"})
    EXPECT_THAT(with(own), ElementsAre(AllOf(HasSubstr("tracker.name"),
                                             HasSubstr("reserved for a part of the daemon"))));
}

TEST(Config, RecordingsAreSplitAndKeptForeverByDefault) {
  const auto silent = parse_config(kMachine, "abbed.toml");
  ASSERT_TRUE(silent);
  EXPECT_EQ(silent->recording.max_file_bytes, 4096ull << 20);
  EXPECT_EQ(silent->recording.keep.count(), 0);
  const auto told =
      parse_config(kMachine + "[recording]\nmax_file_MB = 10\nkeep_days = 30\n", "abbed.toml");
  ASSERT_TRUE(told) << told.error().details.front();
  EXPECT_EQ(told->recording.max_file_bytes, 10ull << 20);
  EXPECT_EQ(told->recording.keep, std::chrono::days{30});
}

TEST(Config, TheHubStaysBelowTheDevices) {
  EXPECT_THAT(
      faults_of(kMachine + "[daemon]\nhub_priority = 40\n"),
      ElementsAre(AllOf(HasSubstr("daemon.hub_priority"), HasSubstr("below tracker_priority 40"))));
  EXPECT_THAT(faults_of(kMachine + "[daemon]\nencoder_priority = 30\n"),
              ElementsAre(HasSubstr("encoder_priority 30")));
  EXPECT_THAT(faults_of(kMachine + "[daemon]\nhub_priority = 39\n"), SizeIs(0));
}

}  // namespace
}  // namespace abbe::daemon
