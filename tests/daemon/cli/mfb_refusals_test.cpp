/// `abbe identify mfb` with touches, plans and files that people get wrong: exit codes, messages,
/// and what is named.

#include "mfb_folder.hpp"

#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <utility>

namespace abbe::daemon {
namespace {

using test::cells_of;
using test::kIdentifyMfb;
using ::testing::HasSubstr;
using ::testing::SizeIs;

using MfbRefusals = test::MfbFolder;

/// A row of X2 as the machine would measure it if the bar lay turned by 180 degrees about its z
/// axis:
/// (x, y, z) of the bar is at (550 mm - x, -y, z). The row names what is touched as if the bar lay
/// as planned.
std::string turned_about_z(const std::string& row) {
  const auto cells = cells_of(row);
  const int index = std::stoi(cells.at(2)), k = std::stoi(cells.at(4));
  const bool hole = cells[1] == "hole", plane = cells[1] == "plane";
  // Angles of a hole turn by 180 degrees, sections of a rod and dx of a plane change sign.
  const int turned_k = hole    ? k / 4 * 4 + (k + 2) % 4
                       : plane ? (1 - k / 2) * 2 + k % 2
                               : (3 - k / 3) * 3 + 2 - k % 3;
  const std::string side = plane ? (cells[3] == "L" ? "R" : "L") : "";
  return fmt::format("X2,{},{},{},{},{:.6f},{:.6f},{}", cells[1], (hole ? 13 : 12) - index, side,
                     turned_k, 550.0 - std::stod(cells[5]), 200.0 - std::stod(cells[6]), cells[7]);
}

TEST_F(MfbRefusals, NamesATouchThatIsFarFromItsFeature) {
  // Hole 5 of X2, touch 3: 50 um along x.
  auto text = test::reference_points_csv();
  const auto line = text.find("X2,hole,5,,3,");
  ASSERT_NE(line, std::string::npos);
  const auto x = line + std::string("X2,hole,5,,3,").size();
  const double value = std::stod(text.substr(x));
  write("points.csv", text.replace(x, text.find(',', x) - x, fmt::format("{:.6f}", value + 0.05)));

  const auto ran = abbe(kIdentifyMfb);
  EXPECT_EQ(ran.exit, 0) << ran.err;
  const auto summary = nlohmann::json::parse(ran.out);
  ASSERT_THAT(summary["set_aside"], SizeIs(1));
  EXPECT_EQ(summary["set_aside"][0]["measurement"], "X2");
  EXPECT_EQ(summary["set_aside"][0]["feature"], "hole");
  EXPECT_EQ(summary["set_aside"][0]["index"], 5);
  EXPECT_EQ(summary["set_aside"][0]["k"], 3);
  EXPECT_THAT(test::text_of(out("report.html")), HasSubstr("hole 5"));
}

/// points.csv with the readings of line `from` in line `to`, too.
std::string with_copied_readings(std::size_t from, std::size_t to) {
  std::istringstream text(test::reference_points_csv());
  std::vector<std::string> rows;
  for (std::string row; std::getline(text, row);) rows.push_back(row);
  auto cells = cells_of(rows.at(to - 1));
  const auto other = cells_of(rows.at(from - 1));
  for (const std::size_t column : {5u, 6u, 7u}) cells.at(column) = other.at(column);
  rows.at(to - 1) = fmt::format("{}", fmt::join(cells, ","));
  return fmt::format("{}\n", fmt::join(rows, "\n"));
}

TEST_F(MfbRefusals, NamesTheLineOfATouchThatAloneDoesNotFit) {
  write("points.csv", with_copied_readings(150, 40));
  const auto ran = abbe(kIdentifyMfb);
  EXPECT_NE(ran.exit, 0);
  EXPECT_THAT(ran.err, HasSubstr("points.csv:40: "));
  EXPECT_THAT(ran.err, HasSubstr("alone does not fit"));
  EXPECT_THAT(ran.err, ::testing::Not(HasSubstr("points.csv:41")));
}

TEST_F(MfbRefusals, NamesAMeasurementDuringWhichTheBarMoved) {
  std::istringstream rows(test::reference_points_csv());
  std::string all, row;
  while (std::getline(rows, row)) {
    auto cells = cells_of(row);
    if (cells[0] == "Y3-" && std::stoi(cells[2]) > 6)
      cells[7] = fmt::format("{:.6f}", std::stod(cells[7]) + 0.02);
    all += fmt::format("{}\n", fmt::join(cells, ","));
  }
  write("points.csv", all);
  const auto ran = abbe(kIdentifyMfb);
  EXPECT_EQ(ran.exit, 5) << ran.err;
  const auto summary = nlohmann::json::parse(ran.out);
  EXPECT_EQ(summary["likely_cause"], "measurement");
  EXPECT_THAT(summary["gate"]["reasons"][0].get<std::string>(), HasSubstr("measurement Y3-"));
  EXPECT_TRUE(std::filesystem::exists(out("model.json")));
}

TEST_F(MfbRefusals, NamesMistakesThatExplainTheReadings) {
  std::istringstream rows(test::reference_points_csv());
  std::string swapped, row;
  std::getline(rows, row);
  swapped = row + "\n";
  while (std::getline(rows, row)) {
    auto cells = cells_of(row);
    std::swap(cells[5], cells[6]);
    swapped += fmt::format("{}\n", fmt::join(cells, ","));
  }
  write("points.csv", swapped);
  expect_refused(1, "the readings fit the plan with X and Y swapped");
}

TEST_F(MfbRefusals, RefusesABarThatLiesTurned) {
  std::istringstream rows(test::reference_points_csv());
  std::string all, row;
  while (std::getline(rows, row))
    all += (row.starts_with("X2,") ? turned_about_z(row) : row) + "\n";
  write("points.csv", all);
  expect_refused(1, "points.csv: X2: the bar lies turned about z: ");
}

TEST_F(MfbRefusals, RefusesRowsThatRunAgainstTheirPass) {
  change("plan.toml", "name = \"Y2\"", "name = \"Y2\"\npass = \"backward\"");
  expect_refused(3, "the rows of \"Y2\" run against its pass = \"backward\"");
}

TEST_F(MfbRefusals, RefusesAPassFarFromThePlan) {
  change("plan.toml", "origin_mm = [0.0,100.0,350.0]", "origin_mm = [0.0,100.0,340.0]");
  expect_refused(1, "points.csv: X2: ");
}

TEST_F(MfbRefusals, NamesTheErrorsThatAPlanCannotShow) {
  // Without X3 nothing shows the yaw of X.
  const auto without = [&](const std::string& name, const std::string& begin) {
    std::istringstream rows(test::text_of(folder_.path() / name));
    std::string all, row;
    while (std::getline(rows, row)) {
      if (!row.starts_with(begin)) all += row + "\n";
    }
    write(name, all);
  };
  without("points.csv", "X3,");
  auto plan = test::text_of(folder_.path() / "plan.toml");
  const auto begin = plan.find("[[measurement]]\nname = \"X3\""),
             end = plan.find("[[measurement]]", begin + 1);
  write("plan.toml", plan.erase(begin, end - begin));
  expect_refused(1, "ECX");
}

TEST_F(MfbRefusals, RefusesTooFewTouchesOfAFeature) {
  std::istringstream rows(test::reference_points_csv());
  std::string all, row;
  while (std::getline(rows, row)) {
    if (!row.starts_with("Y1,hole,4,") || row.starts_with("Y1,hole,4,,0")) all += row + "\n";
  }
  write("points.csv", all);
  expect_refused(1, "points.csv: Y1: hole 4");
}

TEST_F(MfbRefusals, ReportsFaultsOfItsFiles) {
  change("bar.toml", "hole_radius_mm = 8", "hole_radius_mm = -8");
  expect_refused(3, "bar.toml:7:18: pattern.hole_radius_mm: must be positive, not -8");
  write("bar.toml", test::reference_bar_toml());
  change("machine.toml", "max_mm = 550", "max_mm = 100");
  expect_refused(3, "machine.toml:9:10: axes.X.max_mm: 3 nodes");
  EXPECT_EQ(abbe(std::string(kIdentifyMfb) + "--estimator bayes").exit, 2);
  EXPECT_EQ(abbe(std::string(kIdentifyMfb) + "--seed 3").exit, 2);
}

}  // namespace
}  // namespace abbe::daemon
