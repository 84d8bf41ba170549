// The tables of storeys and of rooms in calib/README.md against what files include and
// CMakeLists.txt links.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

namespace {
namespace fs = std::filesystem;
using testing::Contains;
using testing::IsEmpty;
using testing::Key;
using testing::SizeIs;
using StoreyNames = std::set<std::string>;

const fs::path kCalib = ABBE_CALIB_FOLDER;
/// Rooms on one line do not see each other.
const std::vector<StoreyNames> kRooms{{"run"},   {"samples"}, {"observe"},  {"nests", "standstill"},
                                      {"solve"}, {"judge"},   {"identify"}, {"live", "plan"}};

/// The storeys that have rooms.
StoreyNames methods() {
  StoreyNames found;
  for (const auto& entry : fs::directory_iterator(kCalib)) {
    if (fs::is_directory(entry.path() / "src" / "solve")) {
      found.insert(entry.path().filename().string());
    }
  }
  return found;
}

std::string text_of_file(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

StoreyNames words_in(const std::string& text) {
  static const std::regex word("[a-z]+");
  return {std::sregex_token_iterator(text.begin(), text.end(), word), std::sregex_token_iterator()};
}

/// "| `fit` | ... | geometry |": what each storey names.
std::map<std::string, StoreyNames> storeys() {
  std::map<std::string, StoreyNames> rows;
  const std::string text = text_of_file(kCalib / "README.md");
  const auto begin = text.find("| storey |"), end = text.find("\n\n", begin);
  std::istringstream lines(text.substr(begin, end - begin));
  static const std::regex pattern(R"(^\| `([a-z]+)` \| .* \| ([a-z, ]+|-) \|$)");
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_match(line, match, pattern)) {
      rows[match[1]] = words_in(match[2]);
    }
  }
  return rows;
}

/// The storey and all that it sees.
void add_seen(const std::map<std::string, StoreyNames>& rows, const std::string& storey,
              StoreyNames& all) {
  if (!all.insert(storey).second) return;
  for (const std::string& below : rows.at(storey)) add_seen(rows, below, all);
}

std::vector<fs::path> sources_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const auto extension = entry.path().extension();
    if (extension == ".cpp" || extension == ".hpp") files.push_back(entry.path());
  }
  return files;
}

struct CalibHeader {
  bool internal = false;
  std::string storey, room;  ///< no room: empty
};
/// The headers of calib that a text includes.
std::vector<CalibHeader> headers_in(const std::string& text) {
  static const std::regex pattern(
      R"(#\s*include\s*["<]abbe/calib/(internal/)?([a-z]+)/(?:([a-z]+)/)?[A-Za-z0-9_]+\.hpp[">])");
  std::vector<CalibHeader> headers;
  for (std::sregex_iterator it(text.begin(), text.end(), pattern), end; it != end; ++it) {
    headers.push_back({(*it)[1].matched, (*it)[2], (*it)[3]});
  }
  return headers;
}

std::optional<std::size_t> level_of(const std::string& room) {
  const auto at = std::find_if(kRooms.begin(), kRooms.end(),
                               [&](const StoreyNames& r) { return r.contains(room); });
  return at == kRooms.end() ? std::nullopt : std::optional<std::size_t>(at - kRooms.begin());
}

bool leaves_its_folder(const std::string& text) {
  static const std::regex pattern(R"(#\s*include\s*["<][^">]*\.\./)");
  return std::regex_search(text, pattern);
}

/// The room of a file of a method: the folder that it lies in.
std::string room_of(const fs::path& file) {
  return file.parent_path().filename().string();
}

/// "observe/segments.cpp includes solve" for each include of a room that is not before.
std::vector<std::string> forbidden_rooms(const fs::path& method, const std::string& name) {
  static const std::regex local(R"(#\s*include\s*["<](?!abbe/)([a-z]+)/[A-Za-z0-9_/]+\.hpp[">])");
  std::vector<std::string> forbidden;
  for (const fs::path& file : sources_in(method)) {
    const std::string room = room_of(file), text = text_of_file(file);
    const auto level = level_of(room);
    if (!level) {
      forbidden.push_back(file.string() + " is in no room");
      continue;
    }
    StoreyNames used;
    for (const CalibHeader& h : headers_in(text)) {
      if (h.storey == name) used.insert(h.room);
    }
    for (std::sregex_iterator it(text.begin(), text.end(), local), end; it != end; ++it) {
      used.insert((*it)[1]);
    }
    for (const std::string& other : used) {
      const auto of_other = level_of(other);
      if (other != room && (!of_other || *of_other >= *level)) {
        forbidden.push_back(room + "/" + file.filename().string() + " includes " + other);
      }
    }
  }
  return forbidden;
}

TEST(CalibStoreys, SeeWhatTheTableAllows) {
  const auto rows = storeys();
  ASSERT_THAT(rows, SizeIs(testing::Gt(10u)));
  for (const auto& [storey, below] : rows) {
    StoreyNames seen;
    add_seen(rows, storey, seen);
    for (const fs::path& file : sources_in(kCalib / storey)) {
      for (const CalibHeader& h : headers_in(text_of_file(file))) {
        EXPECT_TRUE(seen.contains(h.storey)) << file << " includes " << h.storey;
      }
    }
  }
}

TEST(CalibStoreys, HaveNoCircle) {
  const auto rows = storeys();
  for (const auto& [storey, below] : rows) {
    StoreyNames all;
    for (const std::string& name : below) add_seen(rows, name, all);
    EXPECT_FALSE(all.contains(storey)) << storey;
  }
}

TEST(CalibStoreys, AreLinkedAsInTheTable) {
  std::string text = text_of_file(kCalib / "CMakeLists.txt");
  text = std::regex_replace(text, std::regex(R"(\$\{below_methods\})"), "model environment probe");
  for (const auto& [storey, below] : storeys()) {
    std::smatch match;
    ASSERT_TRUE(std::regex_search(text, match,
                                  std::regex("\nabbe_calib_storey\\(" + storey + "([a-z ]*)\\)")))
        << storey;
    EXPECT_EQ(words_in(match[1]), below) << storey;
  }
}

TEST(CalibStoreys, AreAllFoldersWithSources) {
  const auto rows = storeys();
  for (const auto& entry : fs::directory_iterator(kCalib)) {
    if (fs::is_directory(entry.path() / "src") || fs::is_directory(entry.path() / "include")) {
      EXPECT_THAT(rows, Contains(Key(entry.path().filename().string())));
    }
  }
}

TEST(CalibStoreys, RoomsOfAMethodSeeOnlyThoseBefore) {
  ASSERT_THAT(methods(), testing::IsSupersetOf({"otf", "evemu", "mfb"}));
  for (const std::string& method : methods()) {
    EXPECT_THAT(forbidden_rooms(kCalib / method, method), IsEmpty());
  }
}

TEST(CalibStoreys, RoomsAreThoseOfTheTableInTheReadme) {
  const std::string text = text_of_file(kCalib / "README.md");
  const auto begin = text.find("| room |"), end = text.find("\n\n", begin);
  ASSERT_NE(begin, std::string::npos);
  const std::string rows = text.substr(begin, end - begin);
  static const std::regex pattern(R"(\n\| `([a-z]+)` \|)");
  std::vector<std::size_t> levels;
  for (std::sregex_iterator it(rows.begin(), rows.end(), pattern), last; it != last; ++it) {
    const auto level = level_of((*it)[1]);
    ASSERT_TRUE(level) << (*it)[1];
    levels.push_back(*level);
  }
  EXPECT_THAT(levels, SizeIs(10));
  EXPECT_TRUE(std::ranges::is_sorted(levels));
}

/// An include that leaves its folder by ".." would pass by the include roots.
TEST(CalibStoreys, IncludeNothingByARelativePath) {
  for (const fs::path& file : sources_in(kCalib)) {
    EXPECT_FALSE(leaves_its_folder(text_of_file(file))) << file;
  }
  EXPECT_TRUE(leaves_its_folder("#include \"../solve/solve.hpp\"\n"));
}

TEST(CalibStoreys, PublicHeadersIncludeNoInternalOnes) {
  std::size_t headers = 0;
  for (const fs::path& file : sources_in(kCalib)) {
    const std::string path = file.lexically_relative(kCalib).generic_string();
    if (path.find("/include/") == std::string::npos || path.find("/internal/") != std::string::npos)
      continue;
    ++headers;
    for (const CalibHeader& h : headers_in(text_of_file(file))) {
      EXPECT_FALSE(h.internal) << file;
    }
  }
  EXPECT_GT(headers, 80u);
}

TEST(CalibStoreys, OnlyCalibAndItsTestsIncludeInternalHeaders) {
  std::size_t files = 0;
  for (const char* const module : {"daemon", "drivers", "protocol", "sim", "python", "linuxcnc"}) {
    for (const fs::path& file : sources_in(kCalib.parent_path() / module)) {
      ++files;
      for (const CalibHeader& h : headers_in(text_of_file(file))) {
        EXPECT_FALSE(h.internal) << file;
      }
    }
  }
  EXPECT_GT(files, 500u);
}

TEST(CalibStoreys, EveryKindOfForbiddenRoomIsFound) {
  const fs::path folder =
      fs::path(testing::TempDir()) / ("calib_rooms_" + std::to_string(::getpid()));
  fs::remove_all(folder);
  for (const char* const room : {"observe", "nests", "elsewhere"}) {
    fs::create_directories(folder / "src" / room);
  }
  std::ofstream(folder / "src/observe/a.cpp") << "#include \"abbe/calib/otf/solve/solve.hpp\"\n";
  std::ofstream(folder / "src/observe/b.hpp")
      << "#  include <abbe/calib/internal/otf/judge/x.hpp>\n";
  std::ofstream(folder / "src/nests/c.cpp") << "#include \"standstill/d.hpp\"\n";
  std::ofstream(folder / "src/nests/g.cpp") << "#include <solve/deep/solve.hpp>\n";
  std::ofstream(folder / "src/nests/e.cpp") << "#include \"observe/b.hpp\"\n";
  std::ofstream(folder / "src/elsewhere/f.cpp") << "\n";
  EXPECT_THAT(forbidden_rooms(folder, "otf"), SizeIs(5));
  fs::remove_all(folder);
}

}  // namespace
