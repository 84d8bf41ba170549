// The files of `abbe export --to linuxcnc-comp` in a running LinuxCNC.
#include <gtest/gtest.h>

#include "abbe_command.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

TEST(ExportInLinuxcnc, MovesTheMotorsByTheCorrection) {
  if (std::system("command -v linuxcnc >/dev/null") != 0)
    GTEST_SKIP() << "linuxcnc-uspace is not installed: scripts/test-linuxcnc --install";

  const TemporaryFolder folder;
  const auto log = folder.path() / "log";
  const auto command =
      fmt::format("'{}/scripts/test-linuxcnc' --require --abbe '{}' --places 2 --once >'{}' 2>&1",
                  ABBE_SOURCE_FOLDER, ABBE_PROGRAM, log.string());
  EXPECT_EQ(std::system(command.c_str()), 0) << test::text_of(log);
}

}  // namespace
}  // namespace abbe::daemon
