/// The files of a calibration with a Multi-Feature Bar: what is read, and every fault with its line
/// and key.

#include "bar_files.hpp"

#include <gmock/gmock.h>

#include "abbe/config/calibration_input.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "faults_text.hpp"
#include "temporary_folder.hpp"
#include "text_files.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using calib::mfb::Feature;
using calib::mfb::PassDirection;
using calib::mfb::Side;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::SizeIs;

std::string with(std::string text, const std::string& what, const std::string& instead) {
  const auto at = text.find(what);
  EXPECT_NE(at, std::string::npos) << what;
  return text.replace(at, what.size(), instead);
}

class BarFiles : public ::testing::Test {
 protected:
  fs::path written(const std::string& name, const std::string& text) const {
    test::write_text(folder_.path() / name, text);
    return folder_.path() / name;
  }
  Result<BarFile> bar(const std::string& text = test::small_bar_toml()) const {
    return read_bar_toml(written("bar.toml", text));
  }
  Result<BarPlanFile> plan(const std::string& text = test::small_plan_toml(),
                           const std::string& bar_text = test::small_bar_toml()) const {
    return read_bar_plan_toml(written("plan.toml", text), bar(bar_text).value().bar);
  }
  Result<BarPointsFile> points(const std::string& text = test::small_points_csv()) const {
    calib::MachineNodes nodes;
    for (auto& axis : nodes) axis.nodes_m = {0.0, 0.05, 0.1, 0.15};
    return read_bar_points_csv(written("points.csv", text), bar().value().bar, plan().value(),
                               nodes);
  }

  /// The small bar with one change is refused with this line.
  void expect_bar_fault(const std::string& what, const std::string& instead,
                        const std::string& fault) const {
    EXPECT_THAT(test::faults_text(bar(with(test::small_bar_toml(), what, instead))),
                HasSubstr("bar.toml:" + fault))
        << instead;
  }
  void expect_plan_fault(const std::string& what, const std::string& instead,
                         const std::string& fault) const {
    EXPECT_THAT(test::faults_text(plan(with(test::small_plan_toml(), what, instead))),
                HasSubstr("plan.toml:" + fault))
        << instead;
  }
  void expect_points_fault(const std::string& what, const std::string& instead,
                           const std::string& fault) const {
    EXPECT_THAT(test::faults_text(points(with(test::small_points_csv(), what, instead))),
                HasSubstr("points.csv:" + fault))
        << instead;
  }

  TemporaryFolder folder_;
};

TEST_F(BarFiles, ReadsABar) {
  const auto text =
      with(test::small_bar_toml(), "name = \"short bar\"\n",
           "name = \"short bar\"\nalpha_um_per_m_K = 1.1\nu_alpha_um_per_m_K = 0.05\n");
  const auto read = bar(text + R"([sag]
beam_x_mm = [-15, 115]
supports_mm = [10, 90]
section_yz_mm = [50, 36]
density_kg_per_m3 = 8100
youngs_modulus_GPa = 145
)");
  ASSERT_TRUE(read) << test::faults_text(read);
  const auto& b = read->bar;
  EXPECT_EQ(b.name, "short bar");
  EXPECT_DOUBLE_EQ(b.expansion->alpha_per_K, 1.1e-6);
  EXPECT_DOUBLE_EQ(b.expansion->u_alpha_per_K, 0.05e-6);
  EXPECT_EQ(b.pattern.count(), 3u * 8u + 2u * 12u + 2u * 2u * 4u);
  EXPECT_DOUBLE_EQ(b.pattern.hole_angles_rad[1], 0.75 * M_PI);
  EXPECT_EQ(b.O_m[1], calib::Vector3(49.9902e-3, 1.0177e-3, -0.0022e-3));
  EXPECT_DOUBLE_EQ(b.covariance_m2(4, 4), 0.35e-6 * 0.35e-6);
  EXPECT_DOUBLE_EQ(b.sag->section_yz_m[1], 36e-3);
  EXPECT_DOUBLE_EQ(b.sag->youngs_modulus_Pa, 145e9);
  EXPECT_TRUE(calib::mfb::check(b));
}

TEST_F(BarFiles, ReadsACovarianceInsteadOfUncertainties) {
  auto text = test::small_bar_toml();
  for (const char* u : {"u_um = [0, 0, 0]\n", "u_um = [0.2, 0.35, 0.35]\n", "u_um = [0.2, 0, 0]\n"})
    text = with(text, u, "");
  std::string rows;
  for (int i = 0; i < 9; ++i) {
    rows += "[";
    for (int j = 0; j < 9; ++j)
      rows += (i == 3 || i == 6) && (j == 3 || j == 6) ? (i == j ? "0.04," : "0.01,") : "0,";
    rows += "],\n";
  }
  const auto read = bar(text + "[calibration]\ncovariance_um2 = [" + rows + "]\n");
  ASSERT_TRUE(read) << test::faults_text(read);
  EXPECT_DOUBLE_EQ(read->bar.covariance_m2(3, 6), 0.01e-12);

  EXPECT_THAT(test::faults_text(bar(text)),
              HasSubstr("point[1].u_um: missing; or state [calibration] covariance_um2"));
  EXPECT_THAT(test::faults_text(bar(text + "[calibration]\ncovariance_um2 = [[1, 2], [3]]\n")),
              HasSubstr("calibration.covariance_um2: must be 9 rows of 9 finite numbers"));
  const auto asymmetric = with(rows, "0.01,", "0.02,");
  EXPECT_THAT(
      test::faults_text(bar(text + "[calibration]\ncovariance_um2 = [" + asymmetric + "]\n")),
      HasSubstr("calibration.covariance_um2: is not symmetric"));
  const auto indefinite = with(with(rows, "0.01,", "0.05,"), "0.01,", "0.05,");
  EXPECT_THAT(
      test::faults_text(bar(text + "[calibration]\ncovariance_um2 = [" + indefinite + "]\n")),
      HasSubstr("has the negative eigenvalue -0.01 um2"));
  const auto origin = "[0.04" + rows.substr(2);
  EXPECT_THAT(test::faults_text(bar(text + "[calibration]\ncovariance_um2 = [" + origin + "]\n")),
              HasSubstr("row and column 1 must be 0: x of the first hole defines the bar axes"));
  EXPECT_THAT(test::faults_text(
                  bar(test::small_bar_toml() + "[calibration]\ncovariance_um2 = [" + rows + "]\n")),
              HasSubstr("3 points also have u_um: state one of the two"));
}

TEST_F(BarFiles, RefuseAPatternThatIsNoBar) {
  expect_bar_fault("hole_x_mm = [0,", "hole_x_mm = [1,", "4:13: pattern.hole_x_mm: begins with 1");
  expect_bar_fault("[0, 50, 100]", "[0, 100, 50]", "4:13: pattern.hole_x_mm: must ascend");
  expect_bar_fault("[0, 50, 100]", "[0, 50]", "4:13: pattern.hole_x_mm: 2 holes, must be 3 to 100");
  expect_bar_fault("[0, 1, 0]", "[0, 1]", "5:13: pattern.hole_y_mm: 2 values for 3 holes");
  expect_bar_fault("[0, 1, 0]", "[0, 1, 1]", "5:13: pattern.hole_y_mm: the first and the last");
  expect_bar_fault("[25, 75]", "[25]", "6:12: pattern.rod_x_mm: 1 rods for 3 holes");
  expect_bar_fault("[25, 75]", "[25, 125]",
                   "6:12: pattern.rod_x_mm: rod 2 at 125 is not between holes 2 and 3");
  expect_bar_fault("[-6, 6]", "[6]", "8:18: pattern.hole_levels_mm: 1 values, needs at least 2");
  expect_bar_fault("[-6, 6]", "[6, 6]", "8:18: pattern.hole_levels_mm: a value is repeated");
  expect_bar_fault("rod_radius_mm = 5", "rod_radius_mm = 0",
                   "10:17: pattern.rod_radius_mm: must be positive, not 0");
  expect_bar_fault("plane_y_mm = 18\n", "", "3:1: pattern.plane_y_mm: missing");
  expect_bar_fault("plane_y_mm = 18", "plane_y_mm = nan",
                   "13:14: pattern.plane_y_mm: must be finite");
}

TEST_F(BarFiles, RefuseAPatternThatDoesNotDetermineTheBar) {
  // Opposite angles only: the axis of a cylinder is free to move along the other direction.
  expect_bar_fault("[45, 135, 225, 315]", "[45, 405, 765]", "3:1: pattern: does not determine");
}

TEST_F(BarFiles, RefusePointsThatDoNotBelongToThePattern) {
  expect_bar_fault("hole = 2", "hole = 4", "23:8: point[1].hole: must be a whole number, 1 to 3");
  expect_bar_fault("hole = 2", "hole = 3", "29:8: point[2].hole: hole 3 has two points");
  expect_bar_fault("hole = 2", "hole = 3", "16:1: point: hole 2 is missing");
  expect_bar_fault("x_mm = 49.9902", "x_mm = 51.9902",
                   "24:8: point[1].x_mm: (51.9902, 1.0177, -0.0022) is 1.99 mm from hole 2");
  expect_bar_fault("x_mm = 0\n", "x_mm = 0.1\n",
                   "18:8: point[0].x_mm: must be 0: hole 1 is the origin");
  expect_bar_fault("x_mm = 99.9854\ny_mm = 0\n", "x_mm = 99.9854\ny_mm = 0.1\n",
                   "31:8: point[2].y_mm: y must be 0: the last hole defines the bar axes");
  expect_bar_fault("[0.2, 0, 0]", "[0.2, 0.1, 0]", "33:8: point[2].u_um: y must be 0");
  expect_bar_fault("[0.2, 0.35, 0.35]", "[0.2, -0.35, 0.35]",
                   "27:8: point[1].u_um: must be at least 0");
  expect_bar_fault("u_um = [0.2, 0.35, 0.35]\n", "", "22:1: point[1].u_um: missing");
}

TEST_F(BarFiles, RefuseKeysThatAreUnknownOrIncomplete) {
  expect_bar_fault("name = \"short bar\"", "names = \"short bar\"",
                   "2:1: bar.names: unknown key (did you mean \"name\"?)");
  expect_bar_fault("name = \"short bar\"", "name = \"b\"\nalpha_um_per_m_K = 1",
                   "3:20: bar.alpha_um_per_m_K: also needs u_alpha_um_per_m_K");
  expect_bar_fault("[bar]", "[sag]\nbeam_x_mm = [0, 50]\nsupports_mm = [60, 10]\n[bar]",
                   "2:13: sag.beam_x_mm: does not reach from the first to the last hole");
  expect_bar_fault("[bar]", "[sag]\nbeam_x_mm = [0, 50]\nsupports_mm = [60, 10]\n[bar]",
                   "3:15: sag.supports_mm: must be two numbers, the second larger");
}

TEST_F(BarFiles, ReportTheFaultsOfABarTogether) {
  auto text = with(test::small_bar_toml(), "hole_x_mm = [0,", "hole_x_mm = [1,");
  text = with(text, "x_mm = 49.9902", "x_nm = 49.9902");
  EXPECT_THAT(test::faults_text(bar(text)),
              AllOf(HasSubstr("bar.toml: 3 faults"), HasSubstr("bar.toml:4:13: pattern.hole_x_mm"),
                    HasSubstr("bar.toml:22:1: point[1].x_mm: missing"),
                    HasSubstr("bar.toml:24:1: point[1].x_nm: unknown key")));
}

TEST_F(BarFiles, ReadsAPlan) {
  const auto read = plan();
  ASSERT_TRUE(read) << test::faults_text(read);
  const auto& p = read->plan;
  EXPECT_DOUBLE_EQ(p.tip_radius_m, 1.5e-3);
  EXPECT_DOUBLE_EQ(p.noise.machine_m, 0.25e-6);
  EXPECT_EQ(p.gravity, calib::Vector3(0, 0, -1));
  ASSERT_THAT(p.measurements, SizeIs(2));
  EXPECT_EQ(p.measurements[0].direction, PassDirection::Forward);
  EXPECT_EQ(p.measurements[1].direction, PassDirection::Backward);
  EXPECT_EQ(p.measurements[0].tool_offset_m, calib::Vector3(0, 0, -0.15));
  EXPECT_FALSE(p.measurements[0].temperature_K);
  EXPECT_THAT(read->lines, ElementsAre(6, 13));
  EXPECT_TRUE(calib::mfb::check(p, bar()->bar));
}

TEST_F(BarFiles, NeedTemperaturesForABarThatExpands) {
  const auto expands = with(test::small_bar_toml(), "name = \"short bar\"\n",
                            "name = \"b\"\nalpha_um_per_m_K = 1.1\nu_alpha_um_per_m_K = 0.05\n");
  EXPECT_THAT(test::faults_text(plan(test::small_plan_toml(), expands)),
              AllOf(HasSubstr("plan.toml:6:1: measurement[0].temperature_C: missing"),
                    HasSubstr("plan.toml:13:1: measurement[1].temperature_C: missing")));
  auto text = with(test::small_plan_toml(), "pass = ", "temperature_C = 20.5\npass = ");
  text = with(text, "tool_offset_mm", "temperature_C = 20.4\ntool_offset_mm");
  const auto read = plan(text, expands);
  ASSERT_TRUE(read) << test::faults_text(read);
  EXPECT_DOUBLE_EQ(*read->plan.measurements[1].temperature_K, 293.65);
}

TEST_F(BarFiles, RefuseMeasurementsThatContradictEachOther) {
  expect_plan_fault("\"X1 back\"", "\"X1\"",
                    "14:8: measurement[1].name: two measurements have the name \"X1\"");
  expect_plan_fault("origin_mm = [0, 100, 0]\nbar_x = [2", "origin_mm = [0, 101, 0]\nbar_x = [2",
                    "16:13: measurement[1].origin_mm: differs from that of \"X1\"");
  expect_plan_fault("bar_x = [2, 0, 0]", "bar_x = [0, 1, 0]",
                    "17:9: measurement[1].bar_x: differs from that of \"X1\"");
}

TEST_F(BarFiles, RefuseMeasurementsThatCannotBe) {
  expect_plan_fault("\"X1\"", "\"X,1\"", "7:8: measurement[0].name: has a comma");
  expect_plan_fault("\"X1\"", "\" X1\"", "7:8: measurement[0].name: begins or ends with a blank");
  expect_plan_fault("bar_z = [0, 0, 1]", "bar_z = [0.002, 0, 1]",
                    "11:9: measurement[0].bar_z: is 2 mrad from perpendicular to bar_x, at most 1");
  expect_plan_fault("bar_z = [0, 0, 1]", "bar_z = [0, 0, 0]",
                    "11:9: measurement[0].bar_z: is no direction: its length is 0");
  expect_plan_fault("bar_z = [0, 0, 1]", "bar_z = [0, 1]",
                    "11:9: measurement[0].bar_z: must be three numbers, x, y, z");
  expect_plan_fault("\"backward\"", "\"back\"",
                    "20:8: measurement[1].pass: must be one of \"forward\", \"backward\"");
  expect_plan_fault("tool_offset_mm = [0, 0, -150]\n", "",
                    "6:1: measurement[0].tool_offset_mm: missing");
  expect_plan_fault("position = \"P1\"\n", "", "6:1: measurement[0].position: missing");
  expect_plan_fault("pass = ", "temperature_K = 20\npass = ",
                    "20:1: measurement[1].temperature_K: unknown key (did you mean "
                    "\"temperature_C\"?)");
  expect_plan_fault("tip_radius_mm = 1.5", "tip_radius_mm = 8",
                    "2:17: plan.tip_radius_mm: 8 does not fit into holes of radius 8 mm");
  expect_plan_fault("probe_um = 0.125\n", "", "3:1: noise.probe_um: missing");
  expect_plan_fault("[plan]\ntip_radius_mm = 1.5\n", "", "1:1: plan: missing");
}

TEST_F(BarFiles, ReadsTouchesInTheOrderOfTheRows) {
  const auto read = points();
  ASSERT_TRUE(read) << test::faults_text(read);
  ASSERT_THAT(read->passes, SizeIs(2));
  ASSERT_THAT(read->passes[0], SizeIs(4));
  const auto& plane = read->passes[0][3].target;
  EXPECT_EQ(plane.feature, Feature::Plane);
  EXPECT_EQ(plane.index, 1u);
  EXPECT_EQ(plane.side, Side::Right);
  EXPECT_EQ(plane.k, 3u);
  EXPECT_EQ(read->passes[1][0].reading_m, calib::Vector3(104.6, 95.4, 156.0) / 1000.0);
}

TEST_F(BarFiles, NameRowsThatRunAgainstTheirPass) {
  const auto first = with(test::small_points_csv(), "X1 back,hole,3", "X1 back,hole,2");
  const auto ascending = with(first, "X1 back,hole,1", "X1 back,hole,3");
  EXPECT_THAT(
      points(ascending)->against_pass,
      ElementsAre(HasSubstr("points.csv:6:1: measurement: the rows of \"X1 back\" run against "
                            "its pass = \"backward\": they must be in the order of probing")));
  EXPECT_THAT(points()->against_pass, SizeIs(0));
}

TEST_F(BarFiles, RefuseTouchesOutsideThePattern) {
  expect_points_fault("X1,hole,1,,0", "X1,hole,4,,0", "2:1: index: 4: a hole has 1 to 3");
  expect_points_fault("X1,hole,1,,0", "X1,hole,0,,0", "2:1: index: 0: a hole has 1 to 3");
  expect_points_fault("X1,rod,1,,0", "X1,rod,3,,0", "3:1: index: 3: a rod has 1 to 2");
  expect_points_fault("X1,rod,1,,0", "X1,rod,1,,12", "3:1: k: 12: a rod has 0 to 11");
  expect_points_fault("X1,rod,1,,0", "X1,rod,1,,0.5", "3:1: k: 0.5: a rod has 0 to 11");
  expect_points_fault("X1,rod,1,,0", "X1,bore,1,,0", "3:4: feature: \"bore\": must be hole or rod");
  expect_points_fault("plane,1,L,0", "plane,1,,0", "4:1: side: empty: a plane needs L or R");
  expect_points_fault("plane,1,L,0", "plane,1,l,0", "4:12: side: \"l\": must be L or R");
  expect_points_fault("X1,rod,1,,0", "X1,rod,1,L,0", "3:1: side: must be empty for a hole or rod");
  expect_points_fault("X1 back,hole,3,,7", "X1 back,hole,1,,0",
                      "7:1: k: hole 1, k = 0 of \"X1 back\" is also in line 6");
}

TEST_F(BarFiles, RefuseTouchesThatAreNotOfThePlan) {
  expect_points_fault("X1,hole,1,,0", "X7,hole,1,,0",
                      "2:1: measurement: \"X7\": must be X1 or X1 back");
  EXPECT_THAT(test::faults_text(points("measurement,feature,index,side,k,x_mm,y_mm,z_mm\n"
                                       "X1,hole,1,,0,4.6,104.6,144\n")),
              HasSubstr("points.csv:1:1: measurement: no row of \"X1 back\" (plan.toml, line 13)"));
}

TEST_F(BarFiles, RefuseReadingsOutsideTheNodes) {
  // Nodes from 0 to 150 mm, 50 mm apart: readings to 25 mm outside are those of outer touches.
  EXPECT_TRUE(points(with(test::small_points_csv(), "104.6,144\nX1,rod", "104.6,174.9\nX1,rod")));
  expect_points_fault("104.6,144\nX1,rod", "104.6,175.1\nX1,rod",
                      "2:1: z_mm: 175.1: more than half a node spacing outside the nodes of Z, 0 "
                      "to 150 mm");
  expect_points_fault("X1,hole,1,,0,4.6", "X1,hole,1,,0,nan", "2:14: x_mm: \"nan\"");
}

TEST_F(BarFiles, RefuseColumnsThatAreMissingOrUnknown) {
  expect_points_fault("index,side,k,x_mm", "index,side,k,X", "1:34: X: unknown column");
  expect_points_fault("index,side,k,x_mm", "index,side,k,X", "1:1: x_mm: missing column");
}

TEST_F(BarFiles, NeedFourNodesForCubicTables) {
  const auto text = with(test::reference_machine_toml(), "max_mm = 550", "max_mm = 100");
  const auto file = written("machine.toml", text);
  EXPECT_THAT(test::faults_text(check_bar_machine(file, load_config(file)->machine)),
              HasSubstr("machine.toml:9:10: axes.X.max_mm: 3 nodes, cubic tables"));
  const auto linear = written("machine.toml", with(text, "cubic", "linear"));
  EXPECT_TRUE(check_bar_machine(linear, load_config(linear)->machine));
}

TEST_F(BarFiles, OfTheReferenceDataAreAccepted) {
  const auto machine = load_config(written("machine.toml", test::reference_machine_toml()));
  ASSERT_TRUE(machine) << test::faults_text(machine);
  const auto b = bar(test::reference_bar_toml());
  ASSERT_TRUE(b) << test::faults_text(b);
  const auto p = read_bar_plan_toml(written("plan.toml", test::reference_plan_toml()), b->bar);
  ASSERT_TRUE(p) << test::faults_text(p);
  const auto touched = read_bar_points_csv(written("points.csv", test::reference_points_csv()),
                                           b->bar, *p, otf_machine(machine->machine)->nodes);
  ASSERT_TRUE(touched) << test::faults_text(touched);
  ASSERT_THAT(touched->passes, SizeIs(17));
  for (const auto& pass : touched->passes) EXPECT_EQ(pass.size(), b->bar.pattern.count());
}

}  // namespace
}  // namespace abbe::daemon
