/// Golden recordings: what devices sent, one recording per device and fault class, and what
/// `abbe replay --raw --samples` makes of it. A line that changes here changes what is recorded on
/// a shop floor: its cause is in the same commit. tests/golden/record makes them again.

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;

const fs::path kGolden = ABBE_GOLDEN_RECORDINGS;

std::vector<std::string> names() {
  constexpr std::string_view kEnd = ".mcap.gz";
  std::vector<std::string> all;
  for (const auto& entry : fs::directory_iterator(kGolden)) {
    const std::string name = entry.path().filename().string();
    if (name.ends_with(kEnd)) all.push_back(name.substr(0, name.size() - kEnd.size()));
  }
  std::sort(all.begin(), all.end());
  return all;
}

std::vector<std::string> lines_of(const fs::path& file) {
  std::ifstream in(file);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

class Golden : public ::testing::TestWithParam<std::string> {
 protected:
  /// Standard output of a command that must succeed.
  std::vector<std::string> output_of(const std::string& command) {
    const auto out = folder_.path() / "out";
    const int status = std::system((command + " >'" + out.string() + "'").c_str());
    EXPECT_EQ(WIFEXITED(status) ? WEXITSTATUS(status) : -1, 0) << command;
    return lines_of(out);
  }
  std::string unpacked() {
    const auto file = (folder_.path() / "golden.mcap").string();
    const auto packed = (kGolden / (GetParam() + ".mcap.gz")).string();
    EXPECT_EQ(std::system(("gzip -dc '" + packed + "' >'" + file + "'").c_str()), 0);
    return file;
  }
  /// The samples that the raw bytes of the recording give; each is replayed once.
  const std::vector<std::string>& samples_of_raw_bytes() {
    static std::map<std::string, std::vector<std::string>> found;
    if (const auto one = found.find(GetParam()); one != found.end()) return one->second;
    return found
        .emplace(GetParam(), output_of("'" + std::string(ABBE_PROGRAM) +
                                       "' replay --raw --samples '" + unpacked() + "'"))
        .first->second;
  }
  TemporaryFolder folder_;
};

TEST_P(Golden, RawBytesGiveTheCheckedSamples) {
  const auto wanted = lines_of(kGolden / (GetParam() + ".chk"));
  const auto& found = samples_of_raw_bytes();
  ASSERT_FALSE(wanted.empty());
  const auto [w, f] = std::mismatch(wanted.begin(), wanted.end(), found.begin(), found.end());
  if (w == wanted.end() && f == found.end()) return;
  ADD_FAILURE() << "line " << w - wanted.begin() + 1
                << "\n  checked: " << (w == wanted.end() ? "(end)" : *w)
                << "\n  now:     " << (f == found.end() ? "(end)" : *f);
}

/// These recordings are without the cycles of the hub.
TEST_P(Golden, RawBytesGiveTheSamplesOfTheLiveRun) {
  auto live =
      output_of("'" + std::string(ABBE_PROGRAM) + "' replay --samples '" + unpacked() + "'");
  auto again = samples_of_raw_bytes();
  std::sort(live.begin(), live.end());
  std::sort(again.begin(), again.end());
  EXPECT_EQ(live, again);
}

INSTANTIATE_TEST_SUITE_P(Recordings, Golden, ::testing::ValuesIn(names()),
                         [](const auto& recording) {
                           std::string name = recording.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

}  // namespace
}  // namespace abbe::daemon
