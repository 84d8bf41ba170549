// The table of modules in daemon/README.md against what files include and libraries link.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

namespace {
namespace fs = std::filesystem;
using testing::Contains;
using testing::IsEmpty;
using testing::SizeIs;
using Modules = std::set<std::string>;

const fs::path kDaemon = ABBE_DAEMON_FOLDER;

std::string text_of(const fs::path& file) {
  std::ostringstream text;
  text << std::ifstream(file).rdbuf();
  return text.str();
}

/// All matches of the first group.
Modules found(const std::string& text, const std::string& pattern) {
  const std::regex expression(pattern);
  Modules out;
  for (std::sregex_iterator it(text.begin(), text.end(), expression), end; it != end; ++it) {
    out.insert((*it)[1]);
  }
  return out;
}

/// "| `config` | ... | base, messages |": what each module may use directly.
std::map<std::string, Modules> table() {
  std::map<std::string, Modules> may_use;
  std::istringstream lines(text_of(kDaemon / "README.md"));
  const std::regex row(R"(^\| `([a-z]+)` \| .* \| ([a-z, ]+|-) \|$)");
  std::smatch match;
  for (std::string line; std::getline(lines, line);) {
    if (std::regex_match(line, match, row)) {
      may_use[match[1]] = found(match[2], "([a-z]+)");
    }
  }
  return may_use;
}

/// With what these may use; a module itself, too.
void add_all_used(const std::map<std::string, Modules>& may_use, const std::string& module, Modules& all) {
  if (!all.insert(module).second) return;
  for (const std::string& used : may_use.at(module)) {
    add_all_used(may_use, used, all);
  }
}

/// "service/src/hub.cpp includes abbe/cli".
std::vector<std::string> forbidden_in(const fs::path& folder, const Modules& modules,
                                      const Modules& allowed) {
  std::vector<std::string> forbidden;
  const auto check = [&](const fs::path& file, const std::string& pattern) {
    for (const std::string& used : found(text_of(file), pattern)) {
      if (modules.contains(used) && !allowed.contains(used)) {
        forbidden.push_back(fs::relative(file, kDaemon).string() + " uses " + used);
      }
    }
  };
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    const auto extension = entry.path().extension();
    if (extension == ".cpp" || extension == ".hpp") check(entry.path(), R"(#include "abbe/([a-z]+)/)");
    if (entry.path().filename() == "CMakeLists.txt") check(entry.path(), "abbe::([a-z_]+)");
  }
  return forbidden;
}

TEST(DaemonModules, UseWhatTheTableAllows) {
  const auto may_use = table();
  ASSERT_THAT(may_use, SizeIs(15));
  Modules modules;
  for (const auto& [module, used] : may_use) modules.insert(module);
  for (const auto& [module, used] : may_use) {
    Modules allowed;
    add_all_used(may_use, module, allowed);
    EXPECT_THAT(forbidden_in(kDaemon / module, modules, allowed), IsEmpty());
  }
}

TEST(DaemonModules, HaveNoCycle) {
  const auto may_use = table();
  for (const auto& [module, used] : may_use) {
    Modules all;
    for (const std::string& name : used) add_all_used(may_use, name, all);
    EXPECT_FALSE(all.contains(module)) << module;
  }
}

TEST(DaemonModules, AreAllFoldersWithCode) {
  const auto may_use = table();
  for (const auto& entry : fs::directory_iterator(kDaemon)) {
    if (fs::is_directory(entry.path() / "src")) {
      EXPECT_THAT(may_use, Contains(testing::Key(entry.path().filename().string())));
    }
  }
}

TEST(DaemonModules, AForbiddenIncludeIsFound) {
  const fs::path folder = fs::path(testing::TempDir()) / "daemon_modules";
  fs::create_directories(folder);
  std::ofstream(folder / "a.cpp") << "#include \"abbe/service/hub.hpp\"\n";
  EXPECT_THAT(forbidden_in(folder, {"base", "service"}, {"base"}), SizeIs(1));
}

}  // namespace
