// A kind of device is named in few files of daemon; drivers/docs/adding_a_device.md lists them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

namespace {
namespace fs = std::filesystem;
using testing::Contains;
using testing::SizeIs;

const fs::path kFolder = ABBE_DAEMON_FOLDER;
constexpr std::size_t kMostFiles = 4;

struct KindWords {
  std::string key;                 ///< of its table
  std::vector<std::string> names;  ///< of its type and its entry in the table of kinds
  std::vector<std::string> own;    ///< its files, without the extension
};

const std::vector<KindWords> kKinds{
    {"tracker",
     {"TrackerConfig", "TrackerModeConfig", "WeatherConfig", "kTracker"},
     {"kinds/tracker", "kinds/tracker_lines", "devices/src/tracker", "devices/tracker_options"}},
    {"encoder",
     {"EncoderConfig", "EncoderNodeConfig", "SyncConfig", "kEncoder"},
     {"kinds/encoder", "devices/src/encoder", "devices/encoder_options"}},
    {"counter_card",
     {"CounterCardConfig", "kCounterCard"},
     {"kinds/counter_card", "devices/src/counter_card", "devices/counter_card_options"}},
    {"axis_lines",
     {"AxisLinesConfig", "AxisColumnConfig", "kAxisLines"},
     {"kinds/axis_lines", "devices/src/axis_lines", "devices/axis_lines_options"}},
    {"reference",
     {"ReferenceConfig", "kReferenceCard"},
     {"kinds/reference_card", "devices/src/reference_card"}},
    {"probe", {"ProbeConfig"}, {"kinds/touch_probe"}},
    {"cmm",
     {"CmmConfig", "cmm_reads_axes", "kMeasuringMachine"},
     {"kinds/measuring_machine", "devices/src/measuring_machine"}},
    {"environment",
     {"EnvironmentConfig", "kEnvironment"},
     {"kinds/environment", "devices/src/environment"}}};

bool is_word_character(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}

bool has_word(const std::string& text, const std::string& word) {
  for (auto at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) {
    const auto end = at + word.size();
    const bool begins = at == 0 || !is_word_character(text[at - 1]);
    if (begins && (end == text.size() || !is_word_character(text[end]))) return true;
  }
  return false;
}

bool names(const KindWords& kind, const std::string& text) {
  return text.find("[" + kind.key + "]") != std::string::npos ||
         std::ranges::any_of(kind.names, [&](const auto& name) { return has_word(text, name); });
}

bool is_own(const KindWords& kind, const fs::path& file) {
  const auto path = file.parent_path() / file.stem();
  return std::ranges::any_of(kind.own,
                             [&](const auto& own) { return path.string().ends_with("/" + own); });
}

/// Of the source files of daemon, relative to it.
std::vector<std::string> files_that_name(const KindWords& kind, bool own) {
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(kFolder)) {
    const auto extension = entry.path().extension();
    if ((extension != ".cpp" && extension != ".hpp") || is_own(kind, entry.path()) != own) continue;
    std::ostringstream text;
    text << std::ifstream(entry.path()).rdbuf();
    if (names(kind, text.str())) files.push_back(entry.path().lexically_relative(kFolder).string());
  }
  return files;
}

TEST(DeviceKinds, AreNamedInAtMostFourFilesOutsideTheirOwn) {
  for (const KindWords& kind : kKinds) {
    const auto files = files_that_name(kind, false);
    EXPECT_THAT(files, SizeIs(testing::Le(kMostFiles))) << kind.key;
    EXPECT_THAT(files, Contains("config/include/abbe/config/device_configs.hpp")) << kind.key;
  }
}

TEST(DeviceKinds, HaveAllTheirOwnFiles) {
  for (const KindWords& kind : kKinds)
    EXPECT_THAT(files_that_name(kind, true), SizeIs(testing::Gt(kind.own.size()))) << kind.key;
}

}  // namespace
