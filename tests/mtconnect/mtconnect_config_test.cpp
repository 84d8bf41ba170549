#include "abbe/config/mtconnect_config.hpp"

#include <gmock/gmock.h>
#include <stdlib.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>
#include <string>

namespace abbe::daemon {
namespace {

using ::testing::HasSubstr;

class MtconnectConfigTest : public ::testing::Test {
 protected:
  MtconnectConfigTest() {
    std::string name = testing::TempDir() + "abbe-mtconnect-XXXXXX";
    folder_ = ::mkdtemp(name.data());
  }
  ~MtconnectConfigTest() override { std::filesystem::remove_all(folder_); }

  static std::string example() {
    std::ifstream in{ABBE_EXAMPLE_CONFIG};
    return {std::istreambuf_iterator<char>{in}, {}};
  }
  Result<MtconnectSettings> load(const std::string& text) {
    std::ofstream{folder_ / "abbed.toml"} << text;
    return load_mtconnect_settings(folder_ / "abbed.toml");
  }

  std::filesystem::path folder_;
};

TEST_F(MtconnectConfigTest, ShowsTheDefaultsInTheExample) {
  const std::string text = example();
  const auto uncommented = load(std::regex_replace(text, std::regex{"\n#([a-z_A-Z]+ = )"}, "\n$1"));
  ASSERT_TRUE(uncommented) << uncommented.error().text;
  const MtconnectConfig plain;
  EXPECT_EQ(uncommented->mtconnect.address, plain.address);
  EXPECT_EQ(uncommented->mtconnect.port, plain.port);
  EXPECT_EQ(uncommented->mtconnect.heartbeat, plain.heartbeat);
  EXPECT_EQ(uncommented->control_socket, MtconnectSettings{}.control_socket);
}

TEST_F(MtconnectConfigTest, TakesAllKeys) {
  const auto settings = load(example() + "address = \"::1\"\nport = 0\nheartbeat_s = 2.5\n");
  ASSERT_TRUE(settings) << settings.error().text;
  EXPECT_EQ(settings->mtconnect.address, "::1");
  EXPECT_EQ(settings->mtconnect.port, 0);
  EXPECT_EQ(settings->mtconnect.heartbeat, std::chrono::milliseconds{2500});
}

TEST_F(MtconnectConfigTest, RefusesWhatCannotBeUsed) {
  for (const char* line : {"address = \"localhost\"", "address = \"127.0.0.1:7878\"",
                           "port = 65536", "heartbeat_s = 0", "heartbeat_s = 61", "prt = 1"}) {
    const auto settings = load(example() + line + "\n");
    ASSERT_FALSE(settings) << line;
    const std::string key{line, std::string_view{line}.find(' ')};
    EXPECT_THAT(settings.error().details, ::testing::ElementsAre(HasSubstr("mtconnect." + key)));
  }
}

TEST_F(MtconnectConfigTest, RefusesAFileThatIsMissing) {
  const auto settings = load_mtconnect_settings(folder_ / "none.toml");
  ASSERT_FALSE(settings);
  EXPECT_EQ(settings.error().code, ErrorCode::Io);
}

}  // namespace
}  // namespace abbe::daemon
