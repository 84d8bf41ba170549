/// Two abbed with one configuration: the second leaves, the first does not notice.

#include <gmock/gmock.h>

#include "spine.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::HasSubstr;

#ifdef ABBE_WITH_DDS
constexpr const char* kDds = "child";
#else
constexpr const char* kDds = "off";
#endif

TEST_F(Spine, SecondDaemonEndsAndTheFirstIsUnaffected) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  write_configuration(kDds);
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const bool with_dds = std::string{kDds} == "child";
  ASSERT_TRUE(!with_dds || eventually([this] { return status()["dds"]["connected"] == true; }));

  const auto second = run({ABBED_PROGRAM, "--config", file("abbed.toml")});
  EXPECT_EQ(second.code, 4);
  EXPECT_THAT(second.err, HasSubstr("another daemon already answers there"));
  EXPECT_THAT(second.err, HasSubstr(file("run/")));

  EXPECT_TRUE(goes_on("encoder"));
  EXPECT_EQ(recordings().size(), 1u);
  const json dds = status().value("dds", json{{"connections", 1}});
  EXPECT_EQ(dds["connections"], 1);  // its abbe-dds was never cut off
}

}  // namespace
}  // namespace abbe::test
