/// `abbe identify mfb` and the commands that take its model: the built program, its files and exit
/// codes.

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "bar_files.hpp"
#include "model_eval_output.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using calib::Vector3;
using nlohmann::json;
using test::Ran;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr const char* kIdentify =
    "identify mfb --machine machine.toml --bar bar.toml --plan plan.toml --points points.csv "
    "--json -o out ";

struct TableRow {
  double value = 0.0, u = 0.0;
};

/// tables.csv by names such as "EXX@3" (node from 0) and "EC0Y", as the reference data name them.
std::map<std::string, TableRow> tables_in(const fs::path& file) {
  std::map<std::string, TableRow> rows;
  std::istringstream lines(test::text_of(file));
  std::string line;
  std::getline(lines, line);
  EXPECT_EQ(line, "name,position_mm,value,u,unit");
  while (std::getline(lines, line)) {
    std::istringstream cells(line);
    std::string name, position, value, u;
    std::getline(cells, name, ',');
    std::getline(cells, position, ',');
    std::getline(cells, value, ',');
    std::getline(cells, u, ',');
    if (!position.empty()) name += fmt::format("@{}", std::lround(std::stod(position) / 50.0));
    rows[name] = {std::stod(value), std::stod(u)};
  }
  return rows;
}

bool is_angle(const std::string& name) {
  return std::string("ABC").find(name.at(1)) != std::string::npos;
}

std::vector<std::string> cells_of(const std::string& row) {
  std::vector<std::string> cells;
  std::istringstream in(row);
  for (std::string cell; std::getline(in, cell, ',');) cells.push_back(cell);
  return cells;
}

/// The rows of each measurement, in their order.
std::map<std::string, std::vector<std::vector<std::string>>> rows_by_measurement(
    const std::string& csv) {
  std::map<std::string, std::vector<std::vector<std::string>>> rows;
  std::istringstream lines(csv);
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line)) {
    auto cells = cells_of(line);
    rows[cells[0]].push_back(std::move(cells));
  }
  return rows;
}

/// Every pass in its order along the bar, then the same touches in the opposite order as "NAME
/// back", while the readings drift.
std::string with_backward_passes(const std::string& csv, const Vector3& drift_mm) {
  std::string all = "measurement,feature,index,side,k,x_mm,y_mm,z_mm\n";
  const auto add = [&](std::vector<std::string> cells, const std::string& name, double time) {
    cells[0] = name;
    for (std::size_t c = 0; c < 3; ++c)
      cells[5 + c] = fmt::format(
          "{:.9f}", std::stod(cells[5 + c]) + time * drift_mm(static_cast<Eigen::Index>(c)));
    all += fmt::format("{}\n", fmt::join(cells, ","));
  };

  for (auto [name, rows] : rows_by_measurement(csv)) {
    std::stable_sort(rows.begin(), rows.end(), [](const auto& a, const auto& b) {
      return std::stoi(a[2]) < std::stoi(b[2]);
    });
    const auto last = static_cast<double>(rows.size() - 1);
    for (std::size_t i = 0; i < rows.size(); ++i) add(rows[i], name, static_cast<double>(i) / last);
    for (std::size_t i = 0; i < rows.size(); ++i)
      add(rows[rows.size() - 1 - i], name + " back", 1.0 + static_cast<double>(i) / last);
  }
  return all;
}

std::string with_backward_passes_in_plan(const std::string& plan) {
  const std::string head = "[[measurement]]\n";
  std::string all = plan.substr(0, plan.find(head));
  for (std::size_t at = plan.find(head); at != std::string::npos;) {
    const auto next = plan.find(head, at + 1);
    const auto one = plan.substr(at, next == std::string::npos ? next : next - at);
    const auto quote = one.find('"', one.find("name = ") + 8);  // behind the name
    all += one + one.substr(0, quote) + " back" + one.substr(quote) + "pass = \"backward\"\n";
    at = next;
  }
  return all;
}

/// A row of X2 as the machine would measure it if the bar lay turned by 180 degrees about its z axis:
/// (x, y, z) of the bar is at (550 mm - x, -y, z). The row names what is touched as if the bar lay as
/// planned.
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

/// V at the nodes X = 100, Y = 200, Z = 300 mm: translations, rotations with their levers, and
/// squareness, which tilts the travel only [rigid_body_model.hpp]. Values of tables.csv, um and urad.
Vector3 V_um_at_100_200_300(const std::map<std::string, TableRow>& tables, const Vector3& t_mm) {
  const auto vector_of = [&](const std::string& kinds, char axis, int node) {
    Vector3 v;
    for (Eigen::Index c = 0; c < 3; ++c)
      v(c) =
          tables.at(fmt::format("E{}{}@{}", kinds[static_cast<std::size_t>(c)], axis, node)).value;
    return v;
  };
  constexpr double kUradMm = 1e-3;  // um per urad mm
  const std::array<Vector3, 3> lever_mm{t_mm + Vector3(0, 200, 300), t_mm + Vector3(0, 0, 300),
                                        t_mm};
  Vector3 V_um = Vector3::Zero();
  for (int a = 0; a < 3; ++a) {
    const char axis = "XYZ"[a];
    V_um +=
        vector_of("XYZ", axis, 2 * (a + 1)) +
        kUradMm * vector_of("ABC", axis, 2 * (a + 1)).cross(lever_mm[static_cast<std::size_t>(a)]);
  }
  const auto squareness = [&](const char* name) { return tables.at(name).value; };
  return V_um + kUradMm * Vector3(-squareness("EC0Y") * 200 + squareness("EB0Z") * 300,
                                  -squareness("EA0Z") * 300, 0);
}

class MfbCli : public ::testing::Test {
 protected:
  void SetUp() override {
    write("machine.toml", test::reference_machine_toml());
    write("bar.toml", test::reference_bar_toml());
    write("plan.toml", test::reference_plan_toml());
    write("points.csv", test::reference_points_csv());
  }
  void write(const std::string& name, const std::string& text) const {
    test::write_text(folder_.path() / name, text);
  }
  Ran abbe(const std::string& arguments) const { return test::run_abbe(folder_.path(), arguments); }
  fs::path out(const std::string& name) const { return folder_.path() / "out" / name; }

  /// Replaces `what` in a file.
  void change(const std::string& name, const std::string& what, const std::string& with) const {
    auto text = test::text_of(folder_.path() / name);
    const auto at = text.find(what);
    ASSERT_NE(at, std::string::npos) << what;
    write(name, text.replace(at, what.size(), with));
  }
  void expect_refused(int exit, const std::string& why) const {
    const auto ran = abbe(kIdentify);
    EXPECT_EQ(ran.exit, exit) << ran.err;
    EXPECT_THAT(ran.err, HasSubstr(why));
    EXPECT_FALSE(fs::exists(folder_.path() / "out"));
  }

  TemporaryFolder folder_;
};

/// The reference was linearised at the planned poses, abbe at the poses found, up to 0.14 mm beside
/// them. At 0.1 mm and 0.3 mrad this moves the errors by 0.02 um and 0.05 urad; a
/// tenth of their uncertainty.
constexpr double kPose_um = 0.03, kPose_urad = 0.1;

TEST_F(MfbCli, FindsTheErrorsOfTheReferenceFromItsTouches) {
  const auto ran = abbe(kIdentify);
  ASSERT_EQ(ran.exit, 0) << ran.err << ran.out;
  const auto tables = tables_in(out("tables.csv"));
  const auto& reference = test::reference_case("full");
  const auto& names = reference.at("params");
  ASSERT_THAT(names, SizeIs(195));

  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string name = names[i];
    ASSERT_TRUE(tables.contains(name)) << name;
    const TableRow& row = tables.at(name);
    EXPECT_NEAR(row.value, reference.at("joint_feature")[i].get<double>(),
                is_angle(name) ? kPose_urad : kPose_um)
        << name;
    const double u = reference.at("joint_feature_u_k1")[i];
    EXPECT_NEAR(row.u, u, 0.01 * u) << name;
  }
  EXPECT_EQ(tables.at("EXX@0").u, 0.0);
  EXPECT_EQ(tables.at("EYX@11").u, 0.0);
}

TEST_F(MfbCli, FollowsThePublishedSequenceOnRequest) {
  const auto ran = abbe(std::string(kIdentify) + "--estimator sequential");
  ASSERT_TRUE(ran.exit == 0 || ran.exit == 5) << ran.err;
  EXPECT_EQ(json::parse(ran.out)["estimator"], "sequential");
  const auto tables = tables_in(out("tables.csv"));
  for (const auto& [name, values] : test::reference_case("full").at("sequential").items()) {
    const double tolerance = is_angle(name) ? kPose_urad : kPose_um;
    if (values.is_number()) {
      EXPECT_NEAR(tables.at(name).value, values.get<double>(), tolerance) << name;
    } else {
      for (std::size_t i = 0; i < values.size(); ++i) {
        EXPECT_NEAR(tables.at(fmt::format("{}@{}", name, i)).value, values[i].get<double>(),
                    tolerance)
            << name << "@" << i;
      }
    }
  }
}

TEST_F(MfbCli, SummarisesWhatItFound) {
  const auto ran = abbe(kIdentify);
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto summary = json::parse(ran.out);
  EXPECT_EQ(summary["positions"], 14);
  EXPECT_EQ(summary["touches"], 17 * 316);
  EXPECT_THAT(summary["measurements"], SizeIs(17));
  EXPECT_THAT(summary["budget"], SizeIs(21));
  EXPECT_EQ(summary["likely_cause"], "none");
  EXPECT_THAT(summary["set_aside"], SizeIs(0));
  EXPECT_TRUE(summary["gate"]["accepted"].get<bool>()) << summary["gate"];
  EXPECT_NEAR(summary["chi2"].get<double>(), test::reference_case("full").at("chi2").get<double>(),
              3.0);
}

TEST_F(MfbCli, WritesAModelThatEveryToolMayUse) {
  ASSERT_EQ(abbe(kIdentify).exit, 0);
  const auto document = read_model(out("model.json"));
  ASSERT_TRUE(document) << document.error().text;
  EXPECT_EQ(document->method, "mfb");
  EXPECT_EQ(document->model.tables()->layout().tables().size(), 18u);
  EXPECT_EQ(to_json(*document), test::text_of(out("model.json")));
  EXPECT_THAT(document->bar->passes, SizeIs(17));

  write("at.csv", "x_mm,y_mm,z_mm\n100,200,300\n");
  const auto tables = tables_in(out("tables.csv"));
  for (const Vector3& t_mm : {Vector3(0, 0, -150), Vector3(30, -20, -90)}) {
    const auto eval = abbe(fmt::format("model eval out/model.json --points at.csv --tool={},{},{}",
                                       t_mm.x(), t_mm.y(), t_mm.z()));
    ASSERT_EQ(eval.exit, 0) << eval.err;
    const auto row = test::rows_of(eval.out).at(0);
    const Vector3 V_um = V_um_at_100_200_300(tables, t_mm);
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(row.at(3 + c), V_um(static_cast<Eigen::Index>(c)), 1e-6) << eval.out;
    EXPECT_EQ(row.back(), 1.0) << "inside";
  }
  EXPECT_EQ(abbe("model show out/model.json").exit, 0);
  const auto compared = abbe("model compare out/model.json out/model.json");
  EXPECT_EQ(compared.exit, 0) << compared.err;
  EXPECT_THAT(test::text_of(out("report.html")), HasSubstr("Multi-Feature Bar"));
}

TEST_F(MfbCli, NamesATouchThatIsFarFromItsFeature) {
  // Hole 5 of X2, touch 3: 50 um along x.
  auto text = test::reference_points_csv();
  const auto line = text.find("X2,hole,5,,3,");
  ASSERT_NE(line, std::string::npos);
  const auto x = line + std::string("X2,hole,5,,3,").size();
  const double value = std::stod(text.substr(x));
  write("points.csv", text.replace(x, text.find(',', x) - x, fmt::format("{:.6f}", value + 0.05)));

  const auto ran = abbe(kIdentify);
  EXPECT_EQ(ran.exit, 0) << ran.err;
  const auto summary = json::parse(ran.out);
  ASSERT_THAT(summary["set_aside"], SizeIs(1));
  EXPECT_EQ(summary["set_aside"][0]["measurement"], "X2");
  EXPECT_EQ(summary["set_aside"][0]["feature"], "hole");
  EXPECT_EQ(summary["set_aside"][0]["index"], 5);
  EXPECT_EQ(summary["set_aside"][0]["k"], 3);
  EXPECT_THAT(test::text_of(out("report.html")), HasSubstr("hole 5"));
}

TEST_F(MfbCli, ChecksTheUncertaintyWithTrialsOnRequest) {
  const auto ran = abbe(std::string(kIdentify) + "--monte-carlo 20 --seed 7");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto trials = json::parse(ran.out).at("monte_carlo");
  EXPECT_EQ(trials["trials"], 20);
  EXPECT_NEAR(trials["mean_ratio"].get<double>(), 1.0, 0.1);
  EXPECT_EQ(
      json::parse(abbe(std::string(kIdentify) + "--monte-carlo 20 --seed 7").out).at("monte_carlo"),
      trials);
}

TEST_F(MfbCli, EstimatesTheDriftOfForwardAndBackwardPasses) {
  const Vector3 drift_mm(0.002, -0.001, 0.0005);  // of the readings, during each pass
  write("points.csv", with_backward_passes(test::reference_points_csv(), drift_mm));
  write("plan.toml", with_backward_passes_in_plan(test::reference_plan_toml()));
  const auto ran = abbe(kIdentify);
  ASSERT_TRUE(ran.exit == 0 || ran.exit == 5) << ran.err;
  const auto summary = json::parse(ran.out);
  ASSERT_THAT(summary["drift_um_per_pass"], SizeIs(17));

  for (const auto& pair : summary["drift_um_per_pass"]) {
    EXPECT_EQ(pair["backward"], pair["forward"].get<std::string>() + " back");
    for (int c = 0; c < 3; ++c)
      EXPECT_NEAR(pair["value"][c].get<double>(), 1e3 * drift_mm(c), 4 * pair["u"][c].get<double>())
          << pair["forward"];
  }
  EXPECT_EQ(read_model(out("model.json"))->bar->drift.size(), 17u);
  EXPECT_THAT(test::text_of(out("report.html")), HasSubstr("Drift of the machine"));
}

TEST_F(MfbCli, NamesAMeasurementDuringWhichTheBarMoved) {
  std::istringstream rows(test::reference_points_csv());
  std::string all, row;
  while (std::getline(rows, row)) {
    auto cells = cells_of(row);
    if (cells[0] == "Y3-" && std::stoi(cells[2]) > 6)
      cells[7] = fmt::format("{:.6f}", std::stod(cells[7]) + 0.02);
    all += fmt::format("{}\n", fmt::join(cells, ","));
  }
  write("points.csv", all);
  const auto ran = abbe(kIdentify);
  EXPECT_EQ(ran.exit, 5) << ran.err;
  const auto summary = json::parse(ran.out);
  EXPECT_EQ(summary["likely_cause"], "measurement");
  EXPECT_THAT(summary["gate"]["reasons"][0].get<std::string>(), HasSubstr("measurement Y3-"));
  EXPECT_TRUE(fs::exists(out("model.json")));
}

TEST_F(MfbCli, NamesMistakesThatExplainTheReadings) {
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

TEST_F(MfbCli, RefusesABarThatLiesTurned) {
  std::istringstream rows(test::reference_points_csv());
  std::string all, row;
  while (std::getline(rows, row))
    all += (row.starts_with("X2,") ? turned_about_z(row) : row) + "\n";
  write("points.csv", all);
  expect_refused(1, "points.csv: X2: the bar lies turned about z: ");
}

TEST_F(MfbCli, RefusesAPassFarFromThePlan) {
  change("plan.toml", "origin_mm = [0.0,100.0,350.0]", "origin_mm = [0.0,100.0,340.0]");
  expect_refused(1, "points.csv: X2: ");
}

TEST_F(MfbCli, NamesTheErrorsThatAPlanCannotShow) {
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

TEST_F(MfbCli, RefusesTooFewTouchesOfAFeature) {
  std::istringstream rows(test::reference_points_csv());
  std::string all, row;
  while (std::getline(rows, row)) {
    if (!row.starts_with("Y1,hole,4,") || row.starts_with("Y1,hole,4,,0")) all += row + "\n";
  }
  write("points.csv", all);
  expect_refused(1, "points.csv: Y1: hole 4");
}

TEST_F(MfbCli, ReportsFaultsOfItsFiles) {
  change("bar.toml", "hole_radius_mm = 8", "hole_radius_mm = -8");
  expect_refused(3, "bar.toml:7:18: pattern.hole_radius_mm: must be positive, not -8");
  write("bar.toml", test::reference_bar_toml());
  change("machine.toml", "max_mm = 550", "max_mm = 100");
  expect_refused(3, "machine.toml:9:10: axes.X.max_mm: 3 nodes");
  EXPECT_EQ(abbe(std::string(kIdentify) + "--estimator bayes").exit, 2);
  EXPECT_EQ(abbe(std::string(kIdentify) + "--seed 3").exit, 2);
}

}  // namespace
}  // namespace abbe::daemon
