/// abbe-dds is killed: abbed starts another and continues to acquire.

#include <gmock/gmock.h>
#include <signal.h>

#include <fstream>

#include "spine.hpp"

namespace abbe::test {
namespace {

struct KilledDds : Spine {
  /// The one child abbed has; 0 while there is none.
  [[nodiscard]] pid_t abbe_dds() const {
    const std::string task = "/proc/" + std::to_string(abbed_->pid()) + "/task";
    for (const auto& thread : std::filesystem::directory_iterator(task)) {
      pid_t child = 0;
      if (std::ifstream{thread.path() / "children"} >> child) return child;
    }
    return 0;
  }
  [[nodiscard]] std::uint64_t connections() const {
    const auto now = status();
    return now.is_object() && now["dds"]["connected"]
               ? now["dds"]["connections"].get<std::uint64_t>()
               : 0;
  }
};

TEST_F(KilledDds, IsReplacedWhileAcquisitionGoesOn) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  write_configuration("child");

  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_TRUE(eventually([this] { return connections() == 1; }));
  const pid_t killed = abbe_dds();
  ASSERT_NE(killed, 0);
  ASSERT_EQ(::kill(killed, SIGKILL), 0);
  EXPECT_TRUE(goes_on("encoder"));
  EXPECT_TRUE(eventually([this] { return connections() == 2; }));
  EXPECT_NE(abbe_dds(), killed);
  EXPECT_TRUE(goes_on("encoder"));
  const auto encoder = stream("encoder");
  EXPECT_EQ(encoder["dropped"], 0);
}

TEST_F(KilledDds, IsKilledAndReplacedWhenItHangs) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  write_configuration("child");

  ASSERT_NO_FATAL_FAILURE(start_abbed());
  ASSERT_TRUE(eventually([this] { return connections() == 1; }));
  const pid_t hung = abbe_dds();
  ASSERT_EQ(::kill(hung, SIGSTOP), 0);
  EXPECT_TRUE(eventually([this] { return connections() == 2; }));
  const auto dds = status()["dds"];
  EXPECT_NE(dds["process"], hung);
  EXPECT_EQ(dds["restarts"], 1);
  EXPECT_THAT(dds["last_end"].get<std::string>(), testing::HasSubstr("did not answer"));
  EXPECT_THAT(dds["security"].get<std::string>(),
              testing::HasSubstr("DDS Security is off: anyone on domain"));
}

}  // namespace
}  // namespace abbe::test
