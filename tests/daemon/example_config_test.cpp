/// The abbed.toml that is installed for people to start from.

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <regex>
#include <sstream>

#include "abbe/daemon/config.hpp"

namespace abbe::daemon {
namespace {

std::string example() {
  std::ifstream in{ABBE_EXAMPLE_CONFIG};
  return {std::istreambuf_iterator<char>{in}, {}};
}

std::string faults(const std::string& text) {
  const auto config = parse_config(text, "/etc/abbe/abbed.toml");
  std::string out;
  if (!config) out = config.error().text;
  for (std::size_t i = 0; !config && i < config.error().details.size(); ++i)
    out += "\n" + config.error().details[i];
  return out;
}

/// With every default written out.
std::string uncommented() {
  return std::regex_replace(example(), std::regex{"\n#([a-z_A-Z]+ = )"}, "\n$1");
}

/// With the tables that are there by example only: blocks that begin with "# [[".
std::string with_example_tables() {
  std::istringstream lines{example()};
  std::string out;
  bool in_table = false;
  for (std::string line; std::getline(lines, line);) {
    in_table = line.rfind("# [[", 0) == 0 || (in_table && line.rfind("# ", 0) == 0);
    out += (in_table ? line.substr(2) : line) + "\n";
  }
  return out;
}

TEST(ExampleConfig, IsGood) {
  ASSERT_FALSE(example().empty());
  EXPECT_EQ(faults(example()), "");
}

TEST(ExampleConfig, ItsCommentedKeysAreGoodToo) {
  ASSERT_NE(uncommented(), example());
  EXPECT_EQ(faults(uncommented()), "");
}

TEST(ExampleConfig, ItsExampleTablesAreGoodToo) {
  EXPECT_EQ(faults(with_example_tables()), "");
  const auto config = parse_config(with_example_tables(), "/etc/abbe/abbed.toml").value();
  EXPECT_EQ(config.environment.size(), 3u);
  EXPECT_EQ(config.thermal.size(), 1u);
}

TEST(ExampleConfig, ItsCommentedKeysAreTheDefaults) {
  const auto plain = parse_config(example(), "/etc/abbe/abbed.toml").value();
  const auto full = parse_config(uncommented(), "/etc/abbe/abbed.toml").value();
  EXPECT_EQ(machine_hash(full), machine_hash(plain));
  EXPECT_EQ(full.machine, plain.machine);
  EXPECT_EQ(full.tracker->silence_timeout, plain.tracker->silence_timeout);
  EXPECT_EQ(full.tracker->weather, plain.tracker->weather);
  EXPECT_EQ(full.encoder->u_sampling_delay, plain.encoder->u_sampling_delay);
  EXPECT_EQ(full.air.wavelength_m, plain.air.wavelength_m);
  EXPECT_EQ(full.air.co2_ppm, plain.air.co2_ppm);
  EXPECT_EQ(full.air.u_relative_humidity, plain.air.u_relative_humidity);
  EXPECT_EQ(full.air.max_age, plain.air.max_age);
  EXPECT_EQ(full.daemon.watermark, plain.daemon.watermark);
  EXPECT_EQ(full.daemon.data_dir, plain.daemon.data_dir);
  EXPECT_EQ(full.recording.dir, plain.recording.dir);
  EXPECT_EQ(full.recording.chunk_bytes, plain.recording.chunk_bytes);
  EXPECT_EQ(full.recording.min_free_bytes, plain.recording.min_free_bytes);
  EXPECT_EQ(full.dds.socket, plain.dds.socket);
  EXPECT_EQ(full.dds.validity, plain.dds.validity);
  EXPECT_EQ(full.gate.max_error_m, plain.gate.max_error_m);
  EXPECT_EQ(full.gate.max_gradient, plain.gate.max_gradient);
  EXPECT_EQ(full.control.socket, plain.control.socket);
}

}  // namespace
}  // namespace abbe::daemon
