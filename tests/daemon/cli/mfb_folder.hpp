#pragma once
/// `abbe identify mfb` as people use it, with the files of the reference data.

#include <gmock/gmock.h>

#include <filesystem>
#include <sstream>
#include <string>
#include <vector>

#include "abbe_command.hpp"
#include "bar_files.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon::test {

inline constexpr const char* kIdentifyMfb =
    "identify mfb --machine machine.toml --bar bar.toml --plan plan.toml --points points.csv "
    "--json -o out ";

/// The cells of a row.
inline std::vector<std::string> cells_of(const std::string& row) {
  std::vector<std::string> cells;
  std::istringstream in(row);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

/// A folder with machine.toml, bar.toml, plan.toml and points.csv.
class MfbFolder : public ::testing::Test {
 protected:
  void SetUp() override { write_reference_files(folder_.path()); }
  static void write_reference_files(const std::filesystem::path& folder) {
    static const std::string bar = reference_bar_toml(), plan = reference_plan_toml(),
                             points = reference_points_csv();
    write_text(folder / "machine.toml", reference_machine_toml());
    write_text(folder / "bar.toml", bar);
    write_text(folder / "plan.toml", plan);
    write_text(folder / "points.csv", points);
  }
  void write(const std::string& name, const std::string& text) const {
    write_text(folder_.path() / name, text);
  }
  Ran abbe(const std::string& arguments) const { return run_abbe(folder_.path(), arguments); }
  std::filesystem::path out(const std::string& name) const { return folder_.path() / "out" / name; }

  /// Replaces `what` in a file.
  void change(const std::string& name, const std::string& what, const std::string& with) const {
    auto text = text_of(folder_.path() / name);
    const auto at = text.find(what);
    ASSERT_NE(at, std::string::npos) << what;
    write(name, text.replace(at, what.size(), with));
  }
  void expect_refused(int exit, const std::string& why) const {
    const auto ran = abbe(kIdentifyMfb);
    EXPECT_EQ(ran.exit, exit) << ran.err;
    EXPECT_THAT(ran.err, ::testing::HasSubstr(why));
    EXPECT_FALSE(std::filesystem::exists(folder_.path() / "out"));
  }

  TemporaryFolder folder_;
};

}  // namespace abbe::daemon::test
