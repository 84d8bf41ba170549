// The table of modules in daemon/README.md against what files include and libraries link.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <map>
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
using Names = std::set<std::string>;

const fs::path kDaemon = ABBE_DAEMON_FOLDER;
const Names kOuter{"protocol", "sections", "drivers", "calib", "sim"};
const Names kFastDds{"fastrtps", "dds_topics", "dds_endpoints", "subscriber_fastdds"};

struct ModuleRow {
  Names modules, outer;  ///< that it may use
};
using ModuleTable = std::map<std::string, ModuleRow>;

std::string text_of(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// All matches of the first group.
Names found(const std::string& text, const std::string& pattern) {
  const std::regex expression(pattern);
  Names out;
  for (std::sregex_iterator it(text.begin(), text.end(), expression), end; it != end; ++it) {
    out.insert((*it)[1]);
  }
  return out;
}

/// "| `config` | ... | base, messages | calib |"
ModuleTable table() {
  ModuleTable rows;
  std::istringstream lines(text_of(kDaemon / "README.md"));
  const std::regex pattern(R"(^\| `([a-z]+)` \| .* \| ([a-z, ]+|-) \| ([a-z, ]+|-) \|$)");
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_match(line, match, pattern)) {
      rows[match[1]] = {found(match[2], "([a-z]+)"), found(match[3], "([a-z]+)")};
    }
  }
  return rows;
}

/// A module and all that it may use, directly or not.
void add_all_used(const ModuleTable& rows, const std::string& module, Names& all) {
  if (!all.insert(module).second) return;
  for (const std::string& used : rows.at(module).modules) add_all_used(rows, used, all);
}

Names names_in(const fs::path& file) {
  const auto extension = file.extension();
  if (extension == ".cpp" || extension == ".hpp") {
    return found(text_of(file), R"(#\s*include\s*["<]abbe/([a-z_]+)/)");
  }
  // Not the words of abbe-subscriber-config.cmake.
  if (file.filename() == "CMakeLists.txt")
    return found(text_of(file), R"((?:^|[^-\w])(?:abbe::)?([a-z_]+)\b(?!-))");
  return {};
}

/// "service/src/hub.cpp uses cli": of modules and libraries of which `allowed` are allowed.
std::vector<std::string> forbidden_in(const fs::path& folder, const Names& known,
                                      const Names& allowed) {
  std::vector<std::string> forbidden;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    for (const std::string& used : names_in(entry.path())) {
      if (known.contains(used) && !allowed.contains(used)) {
        forbidden.push_back(entry.path().lexically_relative(folder).string() + " uses " + used);
      }
    }
  }
  return forbidden;
}

Names all_known(const ModuleTable& rows) {
  Names known = kOuter;
  known.insert(kFastDds.begin(), kFastDds.end());
  for (const auto& [module, row] : rows) known.insert(module);
  return known;
}

TEST(DaemonModules, UseWhatTheTableAllows) {
  const ModuleTable rows = table();
  ASSERT_THAT(rows, SizeIs(22));
  for (const auto& [module, row] : rows) {
    Names allowed = row.outer;
    add_all_used(rows, module, allowed);
    if (module == "dds" || module == "subscriber") allowed.insert(kFastDds.begin(), kFastDds.end());
    EXPECT_THAT(forbidden_in(kDaemon / module, all_known(rows), allowed), IsEmpty()) << module;
  }
}

TEST(DaemonModules, UseEverythingTheTableAllows) {
  for (const auto& [module, row] : table()) {
    Names used;
    for (const auto& entry : fs::recursive_directory_iterator(kDaemon / module))
      used.merge(names_in(entry.path()));
    EXPECT_THAT(used, testing::IsSupersetOf(row.modules)) << module;
    EXPECT_THAT(used, testing::IsSupersetOf(row.outer)) << module;
  }
}

TEST(DaemonModules, HaveNoCycle) {
  const ModuleTable rows = table();
  for (const auto& [module, row] : rows) {
    Names all;
    for (const std::string& name : row.modules) add_all_used(rows, name, all);
    EXPECT_FALSE(all.contains(module)) << module;
  }
}

TEST(DaemonModules, AreAllFoldersWithSources) {
  const ModuleTable rows = table();
  for (const auto& entry : fs::directory_iterator(kDaemon)) {
    if (fs::is_directory(entry.path() / "src") || fs::is_directory(entry.path() / "include")) {
      EXPECT_THAT(rows, Contains(Key(entry.path().filename().string())));
    }
  }
}

/// calib is compiled without ThreadSanitizer: the reason is in cmake/AbbeModule.cmake.
TEST(CalibSources, HaveNoSharedPointers) {
  std::size_t files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(kDaemon.parent_path() / "calib")) {
    const auto extension = entry.path().extension();
    if (extension != ".cpp" && extension != ".hpp") continue;
    ++files;
    EXPECT_EQ(text_of(entry.path()).find("shared_ptr"), std::string::npos) << entry.path();
  }
  EXPECT_GT(files, 100u);
}

TEST(DaemonModules, EveryKindOfForbiddenUseIsFound) {
  const fs::path folder =
      fs::path(testing::TempDir()) / ("daemon_modules_" + std::to_string(::getpid()));
  fs::remove_all(folder);
  fs::create_directories(folder);
  std::ofstream(folder / "quoted.cpp") << "#include \"abbe/service/hub.hpp\"\n";
  std::ofstream(folder / "angle.hpp") << "#  include <abbe/sim/truth_machine.hpp>\n";
  std::ofstream(folder / "CMakeLists.txt")
      << "target_link_libraries(abbe_base PUBLIC abbe::drivers fastrtps)\n";
  EXPECT_THAT(forbidden_in(folder, {"base", "service", "sim", "drivers", "fastrtps"}, {"base"}),
              SizeIs(4));
  fs::remove_all(folder);
}

}  // namespace
