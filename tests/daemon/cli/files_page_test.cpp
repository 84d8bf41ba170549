/// docs/files.md against the readers and writers that it describes.

#include <gmock/gmock.h>

#include <algorithm>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "abbe/base/known_errors.hpp"
#include "abbe/calib/sparse/folds.hpp"
#include "abbe/config/config.hpp"
#include "abbe/sim/truth_table.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "abbe/tables/gauge_file.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tables/measured_file.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "abbe/tables/parts_file.hpp"
#include "abbe/tasks/verification_report.hpp"
#include "abbe_command.hpp"
#include "faults_text.hpp"
#include "synthetic_model.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Key;
using ::testing::Not;
using ::testing::SizeIs;

struct FileSection {
  std::string text;
  std::vector<std::string> examples;
};

/// The sections "### `NAME`" of the page, by the name of the file.
std::map<std::string, FileSection> sections_of_page() {
  std::map<std::string, FileSection> sections;
  FileSection* at = nullptr;
  bool in_example = false;
  std::istringstream lines(test::text_of(fs::path(ABBE_SOURCE_FOLDER) / "docs/files.md"));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("### `")) at = &sections[line.substr(5, line.find('`', 5) - 5)];
    if (line.starts_with("## ")) at = nullptr;
    if (at == nullptr) continue;
    at->text += line + "\n";
    if (line.starts_with("```")) {
      in_example = !in_example;
      if (in_example) at->examples.emplace_back();
    } else if (in_example) {
      at->examples.back() += line + "\n";
    }
  }
  return sections;
}

/// First line without comment.
std::string header_of_csv(const std::string& text) {
  std::istringstream lines(text);
  std::string line;
  while (std::getline(lines, line) && line.starts_with("#")) {
  }
  return line;
}

/// faults_text() of a reader for one file.
using FileReader = std::function<std::string(const fs::path&)>;

template <class Read>
FileReader reader(Read read) {
  return [read](const fs::path& file) { return test::faults_text(read(file)); };
}

std::string faults_of_config(const fs::path& file) {
  return test::faults_text(parse_config(test::text_of(file), file));
}

/// Writes the example of a file of the page beside `file`.
fs::path example_beside(const fs::path& file, const std::string& name) {
  const fs::path written = file.parent_path() / ("page_" + name);
  test::write_text(written, sections_of_page().at(name).examples.at(0));
  return written;
}

Result<BarPlanFile> read_plan_for_bar_of_page(const fs::path& file) {
  const auto bar = read_bar_toml(example_beside(file, "bar.toml"));
  if (!bar) return tl::make_unexpected(bar.error());
  return read_bar_plan_toml(file, bar->bar);
}

/// Touches of the bar and the plan of the page.
Result<BarPointsFile> read_touches_of_page(const fs::path& file) {
  const auto bar = read_bar_toml(example_beside(file, "bar.toml"));
  if (!bar) return tl::make_unexpected(bar.error());
  const auto plan = read_plan_for_bar_of_page(example_beside(file, "plan.toml"));
  if (!plan) return tl::make_unexpected(plan.error());
  calib::MachineNodes nodes;
  for (auto& axis : nodes) axis.nodes_m = {0.0, 0.05, 0.55};
  return read_bar_points_csv(file, bar->bar, *plan, nodes);
}

const std::map<std::string, FileReader> kTableReaders{
    {"path.csv", reader(read_path_csv)},
    {"tracker.csv", reader([](const fs::path& file) { return read_tracker_csv(file); })},
    {"encoder.csv", reader([](const fs::path& file) { return read_encoder_csv(file); })},
    {"touches.csv", reader(read_touches_csv)},
    {"barpoints.csv", reader(read_touches_of_page)},
    {"errors.csv", reader(read_errors_csv)},
    {"points.csv", reader(read_points_csv)},
    {"verification.csv", reader(read_verification_csv)},
    {"measured.csv", reader(read_measured_csv)},
    {"eval.csv", reader(read_known_errors_csv)}};

std::map<std::string, FileReader> all_readers() {
  auto readers = kTableReaders;
  readers["abbed.toml"] = readers["machine.toml"] = faults_of_config;
  readers["calibrator.toml"] = reader(read_calibrator_toml);
  readers["parts.toml"] = reader(read_parts_toml);
  readers["bar.toml"] = reader(read_bar_toml);
  readers["gauge.toml"] = reader(read_gauge_toml);
  readers["plan.toml"] = reader(read_plan_for_bar_of_page);
  readers["folds.txt"] = [](const fs::path& file) {
    return calib::sparse::parse_folds(test::text_of(file)) ? "" : "no folds";
  };
  readers["truth.csv"] = [](const fs::path& file) {
    const auto truth = sim::parse_truth_csv(test::text_of(file), "truth.csv", {}, {});
    return truth ? std::string{} : truth.error().text;
  };
  return readers;
}

/// Headers that the program writes, by the name of the file. The test of `identify evemu` compares
/// the program with the two literals.
std::map<std::string, std::string> written_headers() {
  return {{"truth.csv", header_of_csv(sim::format_truth_csv({}))},
          {"tables.csv", header_of_csv(to_tables_csv(test::synthetic_model(1)))},
          {"coefficients.csv", "name,value,u,unit"},
          {"cross_validation.csv", "gamma,lambda,error_um2"},
          {"grid.csv", header_of_csv(to_grid_csv({}))},
          {"verification.csv", header_of_csv(to_verification_csv({}))}};
}

class FilesPage : public ::testing::Test {
 protected:
  fs::path written(const std::string& name, const std::string& text) {
    test::write_text(folder_.path() / name, text);
    return folder_.path() / name;
  }
  /// The columns of a table, from the message for a file without header; one list for each form.
  std::vector<std::string> columns_of(const FileReader& read) {
    std::string line = "1";
    for (int i = 0; i < 20; ++i) line += ",1";
    const auto faults = read(written("columns.csv", line + "\n"));
    const auto headers = faults.substr(faults.rfind("before this one: ") + 17);
    const std::regex column("[A-Za-z_]+_?[a-z]*");
    std::vector<std::string> columns;
    for (std::sregex_iterator it(headers.begin(), headers.end(), column), end; it != end; ++it)
      if (it->str() != "or") columns.push_back(it->str());
    return columns;
  }

  TemporaryFolder folder_;
  const std::map<std::string, FileSection> sections_ = sections_of_page();
};

TEST_F(FilesPage, ShowsExamplesThatTheReadersAccept) {
  for (const auto& [name, read] : all_readers()) {
    ASSERT_THAT(sections_, Contains(Key(name)));
    EXPECT_THAT(sections_.at(name).examples, SizeIs(1)) << name;
    for (const auto& example : sections_.at(name).examples)
      EXPECT_EQ(read(written(name, example)), "") << name;
  }
}

TEST_F(FilesPage, NamesEveryColumnThatIsRead) {
  for (const auto& [name, read] : kTableReaders) {
    const auto columns = columns_of(read);
    EXPECT_THAT(columns, SizeIs(::testing::Ge(3u))) << name;
    for (const auto& column : columns)
      EXPECT_THAT(sections_.at(name).text, HasSubstr("`" + column + "`")) << name;
  }
}

TEST_F(FilesPage, ShowsTheHeadersThatAreWritten) {
  for (const auto& [name, header] : written_headers()) {
    ASSERT_THAT(sections_, Contains(Key(name)));
    ASSERT_THAT(sections_.at(name).examples, Not(IsEmpty())) << name;
    EXPECT_EQ(header_of_csv(sections_.at(name).examples[0]), header) << name;
  }
}

TEST_F(FilesPage, NamesEveryColumnThatIsShown) {
  for (const auto& [name, section] : sections_) {
    if (!name.ends_with(".csv") || section.examples.empty()) continue;
    std::istringstream header(header_of_csv(section.examples[0]));
    for (std::string column; std::getline(header, column, ',');)
      EXPECT_THAT(section.text, HasSubstr("`" + column + "`")) << name;
  }
}

TEST_F(FilesPage, NamesEveryKeyOfAModel) {
  auto document = test::synthetic_document(1);
  document.artefact = calib::Expansion{};
  document.recording_gap = "damaged";
  document.mode = "standstill";
  document.model = test::synthetic_travel_model(1);
  document.backlash = calib::backlash_of(document.model);
  const auto parsed = nlohmann::json::parse(to_json(document));
  for (const auto& [key, value] : parsed.items())
    EXPECT_THAT(sections_.at("model.json").text, HasSubstr("`" + key + "`"));
}

TEST_F(FilesPage, HasASectionForEveryExampleOfTheProgram) {
  const auto list = test::run_abbe(folder_.path(), "example");
  const std::regex file("(^|\n)([a-z-]+\\.[a-z]+) ");
  std::size_t count = 0;
  for (std::sregex_iterator it(list.out.begin(), list.out.end(), file), end; it != end; ++it) {
    EXPECT_THAT(sections_, Contains(Key((*it)[2].str())));
    ++count;
  }
  EXPECT_GE(count, 12u);
}

TEST_F(FilesPage, IsLinkedFromTheReadme) {
  const auto readme = test::text_of(fs::path(ABBE_SOURCE_FOLDER) / "README.md");
  EXPECT_THAT(readme, HasSubstr("(docs/files.md)"));
}

}  // namespace
}  // namespace abbe::daemon
