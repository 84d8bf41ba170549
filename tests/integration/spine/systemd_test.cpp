/// The units as systemd itself judges them, with the built programs in place of the installed ones.

#include <gmock/gmock.h>

#include "spine.hpp"

namespace abbe::test {
namespace {

constexpr const char* kAnalyze = "/usr/bin/systemd-analyze";
constexpr double kExposedAtMost = 3.0;  // of 10; systemd calls it OK

struct Systemd : Spine {
  void SetUp() override {
    if (!std::filesystem::exists(kAnalyze)) GTEST_SKIP() << kAnalyze << " is missing";
    for (const std::string unit : {"abbed.service", "abbe-dds.service", "abbe-web.service",
                                   "abbe-mtconnect.service", "abbe-notify.service"}) {
      std::string text = text_of(std::filesystem::path{ABBE_UNIT_DIR} / unit);
      const std::string installed = "ExecStart=/usr/bin/";
      const auto at = text.find(installed);
      ASSERT_NE(at, std::string::npos) << unit;
      write(unit, text.replace(at, installed.size(), "ExecStart=" ABBE_BIN_DIR "/"));
    }
  }
  [[nodiscard]] double exposure(const std::string& unit) const {
    const auto judged = run({kAnalyze, "security", "--offline=true", "--no-pager", file(unit)});
    const std::string level = "Overall exposure level for " + unit + ": ";
    const auto at = judged.out.find(level);
    EXPECT_NE(at, std::string::npos) << judged.out << judged.err;
    return at == std::string::npos ? 10.0 : std::stod(judged.out.substr(at + level.size()));
  }
};

TEST_F(Systemd, FindsNothingWrongWithTheUnits) {
  std::vector<std::string> command{kAnalyze,
                                   "verify",
                                   "--man=no",
                                   file("abbed.service"),
                                   file("abbe-web.service"),
                                   file("abbe-mtconnect.service"),
                                   file("abbe-notify.service")};
#ifdef ABBE_WITH_DDS
  command.push_back(file("abbe-dds.service"));
#endif
  const auto verified = run(command);
  EXPECT_EQ(verified.code, 0);
  EXPECT_THAT(verified.err, testing::Not(testing::HasSubstr(".service:"))) << verified.err;
}

using Installation = Spine;

TEST_F(Installation, HoldsAllOfIt) {
  const auto installed =
      run({ABBE_CMAKE, "-DCMAKE_INSTALL_PREFIX=" + file("usr"), "-P", ABBE_SYSTEMD_INSTALL});
  ASSERT_EQ(installed.code, 0) << installed.err;
  for (const char* name : {"lib/systemd/system/abbed.service", "lib/sysusers.d/abbe.conf",
                           "lib/tmpfiles.d/abbe.conf", "lib/udev/rules.d/60-abbe.rules"})
    EXPECT_FALSE(text_of(file("usr") + "/" + name).empty()) << name;
}

TEST_F(Installation, UnitsStartTheProgramsBelowTheChosenPrefix) {
  const auto installed =
      run({ABBE_CMAKE, "-DCMAKE_INSTALL_PREFIX=" + file("opt"), "-P", ABBE_SYSTEMD_INSTALL});
  ASSERT_EQ(installed.code, 0) << installed.err;
  const auto unit = text_of(file("opt/lib/systemd/system/abbed.service"));
  EXPECT_THAT(unit, testing::HasSubstr("ExecStart=" + file("opt/bin/abbed") + " --config"));
  EXPECT_THAT(unit, testing::HasSubstr("file://" + file("opt/share/doc/abbe/README.md")));
}

TEST_F(Installation, UnitsOfTheRootPrefixStartTheProgramsInBin) {
  const auto staged = run({"/usr/bin/env", "DESTDIR=" + file("root"), ABBE_CMAKE,
                           "-DCMAKE_INSTALL_PREFIX=/", "-P", ABBE_SYSTEMD_INSTALL});
  ASSERT_EQ(staged.code, 0) << staged.err;
  const auto unit = text_of(file("root/lib/systemd/system/abbed.service"));
  EXPECT_THAT(unit, testing::HasSubstr("ExecStart=/bin/abbed --config"));
}

TEST_F(Installation, UnitsDoNotContainTheFolderOfAPackageThatIsBeingMade) {
  const auto staged = run({"/usr/bin/env", "DESTDIR=" + file("stage"), ABBE_CMAKE,
                           "-DCMAKE_INSTALL_PREFIX=/usr", "-P", ABBE_SYSTEMD_INSTALL});
  ASSERT_EQ(staged.code, 0) << staged.err;
  const auto unit = text_of(file("stage/usr/lib/systemd/system/abbed.service"));
  EXPECT_THAT(unit, testing::HasSubstr("ExecStart=/usr/bin/abbed --config"));
}

TEST_F(Systemd, UnitsAreHardened) {
  EXPECT_LE(exposure("abbed.service"), kExposedAtMost);
  EXPECT_LE(exposure("abbe-dds.service"), kExposedAtMost);
  EXPECT_LE(exposure("abbe-web.service"), kExposedAtMost);
  EXPECT_LE(exposure("abbe-mtconnect.service"), kExposedAtMost);
  EXPECT_LE(exposure("abbe-notify.service"), kExposedAtMost);
}

}  // namespace
}  // namespace abbe::test
