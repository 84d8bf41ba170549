/// sim.toml, the example that documents every key of abbe-sim.

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>

#include "config_tables.hpp"

namespace abbe::sim {
namespace {

namespace fs = std::filesystem;
using testing::IsEmpty;

class SimExample : public testing::Test {
 protected:
  SimExample() : folder_(fs::path(testing::TempDir()) / ("sim_example_" + unique_name())) {
    fs::create_directories(folder_);
    write("machine.toml", to_toml(config_tables::half_metre_mill()) +
                              to_toml(config_tables::CounterCard{}) +
                              "[cmm]\nhost = \"127.0.0.1\"\n"
                              "[axis_lines]\ncolumns = [\"X\", \"Y\", \"Z\"]\n");
  }
  ~SimExample() override { fs::remove_all(folder_); }

  static std::string unique_name() {
    return testing::UnitTest::GetInstance()->current_test_info()->name();
  }
  static std::string example() {
    std::ifstream in(fs::path(ABBE_SIM_EXAMPLES) / "sim.toml");
    return {std::istreambuf_iterator<char>(in), {}};
  }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
  }

  /// What abbe-sim reports of this sim.toml; empty if it is valid.
  [[nodiscard]] std::string faults(const std::string& text) const {
    write("sim.toml", text);
    const std::string command = std::string(ABBE_SIM_PROGRAM) + " truth --grid 2 2 2 --config " +
                                (folder_ / "sim.toml").string() + " --machine " +
                                (folder_ / "machine.toml").string() + " -o " +
                                (folder_ / "out.csv").string() + " 2>&1";
    std::FILE* pipe = ::popen(command.c_str(), "r");
    std::string output;
    for (int c = std::fgetc(pipe); c != EOF; c = std::fgetc(pipe)) output += static_cast<char>(c);
    return ::pclose(pipe) == 0 ? "" : output;
  }

  /// The keys that the reader knows in `table` ("sim.path"), from its message for an unknown key.
  [[nodiscard]] std::set<std::string> known_keys(const std::string& table) const {
    const bool array =
        table == "sim.environment" || table == "sim.fault" || table == "sim.tracker.nest";
    const std::string output =
        faults((array ? "[[" + table + "]]" : "[" + table + "]") + "\nxxxxxxxxxxxx = 1\n");
    const std::regex list{table + (array ? "\\[0\\]" : "") +
                          "\\.xxxxxxxxxxxx: unknown key; the keys of this table are (.*)"};
    std::smatch found;
    std::set<std::string> keys;
    if (!std::regex_search(output, found, list)) return keys;

    std::string name;
    for (std::istringstream names(found[1]); names >> name;)
      keys.insert(name.ends_with(',') ? name.substr(0, name.size() - 1) : name);
    return keys;
  }

  fs::path folder_;
};

/// The text of the example from the header of each table to that of the next.
std::map<std::string, std::string> tables_of(const std::string& text) {
  const std::regex header{R"(^(?:# )?\[\[?(sim[.a-z_]*)\]\]?.*)"};
  std::map<std::string, std::string> tables;
  std::string table;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    std::smatch found;
    if (std::regex_match(line, found, header)) table = found[1];
    tables[table] += line + "\n";
  }
  return tables;
}

bool has_word(const std::string& text, const std::string& word) {
  return std::regex_search(text, std::regex{"\\b" + word + "\\b"});
}

/// "input0_swing" for "input7_swing": the example shows the first of the inputs.
std::string as_first_input(const std::string& key) {
  return std::regex_replace(key, std::regex{"^input[0-9]_"}, "input0_");
}

/// With every default written out, and with the tables that are there by example only.
std::string uncommented(const std::string& text) {
  const std::string keys =
      std::regex_replace(text, std::regex{"\n#(?:# )?([a-z_A-Z0-9]+ = )"}, "\n$1");
  return std::regex_replace(keys, std::regex{"\n# (\\[\\[?sim|[a-z_A-Z0-9]+ = )"}, "\n$1");
}

TEST_F(SimExample, HasEveryKeyThatTheReaderKnows) {
  const auto tables = tables_of(example());
  ASSERT_GT(tables.size(), 10u);

  for (const auto& [table, text] : tables) {
    if (table.empty()) continue;
    const auto keys = known_keys(table);
    EXPECT_THAT(keys, testing::Not(IsEmpty())) << table;
    for (const auto& key : keys) {
      const bool is_table = tables.contains(table + "." + key);
      EXPECT_TRUE(is_table || has_word(text, as_first_input(key))) << table << "." << key;
    }
  }
}

TEST_F(SimExample, IsValidWithEveryKeyWrittenOut) {
  const fs::path demo = ABBE_DEMO_DIR;
  fs::copy_file(fs::path(ABBE_SIM_EXAMPLES) / "truth.csv", folder_ / "truth.csv");
  fs::copy_file(demo / "../daemon/examples/calibrator.toml", folder_ / "calibrator.toml");
  std::string text = uncommented(example());
  text = std::regex_replace(text, std::regex{"\\.\\./\\.\\./demo"}, demo.string());
  text = std::regex_replace(text, std::regex{"\nlink = "}, "\n# ");  // instead of port
  ASSERT_NE(text, example());
  EXPECT_EQ(faults(text), "");
}

}  // namespace
}  // namespace abbe::sim
