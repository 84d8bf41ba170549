/// `abbe identify bar` with the files of `abbe sim bar`, and `abbe identify mfb` with the bar that
/// it wrote and the files of `abbe sim mfb`.

#include <gmock/gmock.h>

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <regex>
#include <sstream>

#include "abbe/tables/gauge_file.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "abbe_command.hpp"
#include "faults_text.hpp"
#include "temporary_folder.hpp"

namespace abbe::daemon {
namespace {

using nlohmann::json;
using test::Ran;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::SizeIs;

constexpr const char* kIdentifyBar =
    "identify bar --bar cal/nominal.toml --plan cal/plan.toml --points cal/points.csv "
    "--gauge cal/gauge.toml -o bar.toml ";

class BarCli : public ::testing::Test {
 protected:
  Ran abbe(const std::string& arguments) const { return test::run_abbe(folder_.path(), arguments); }
  void simulate(const std::string& arguments) const {
    const Ran ran = abbe("sim " + arguments);
    ASSERT_EQ(ran.exit, 0) << ran.err;
  }
  /// Replaces the first match of `what` in a file of the calibration.
  void change(const std::string& file, const std::string& what, const std::string& instead) const {
    const auto path = folder_.path() / "cal" / file;
    std::string text = test::text_of(path);
    const std::size_t at = text.find(what);
    ASSERT_NE(at, std::string::npos) << what;
    test::write_text(path, text.replace(at, what.size(), instead));
  }
  /// Largest distance of the written points from the true ones, in um.
  double largest_error_um() const {
    const auto bar = read_bar_toml(folder_.path() / "bar.toml");
    EXPECT_TRUE(bar) << test::faults_text(bar);
    std::istringstream rows(test::text_of(folder_.path() / "cal/truebar.csv"));
    std::string row;
    std::getline(rows, row);
    double largest_m = 0.0;
    for (std::size_t i = 0; bar && std::getline(rows, row); ++i) {
      calib::Vector3 true_mm;
      std::istringstream cells(row.substr(row.find(',') + 1));
      for (Eigen::Index k = 0; k < 3; ++k) {
        std::string cell;
        std::getline(cells, cell, ',');
        true_mm(k) = std::stod(cell);
      }
      largest_m = std::max(largest_m, (bar->bar.O_m.at(i) - 1e-3 * true_mm).norm());
    }
    return 1e6 * largest_m;
  }

  TemporaryFolder folder_;
};

TEST_F(BarCli, CalibratesTheSimulatedBar) {
  simulate("bar --exact -o cal");
  const Ran ran = abbe(std::string(kIdentifyBar) + "--json");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_LT(largest_error_um(), 0.05);
  const json summary = json::parse(ran.out);
  EXPECT_EQ(summary.at("degrees_of_freedom"), 4);
  EXPECT_NEAR(summary.at("student_t95").get<double>(), 2.776, 0.001);
  EXPECT_THAT(summary.at("points"), SizeIs(12));
  EXPECT_THAT(test::text_of(folder_.path() / "bar.toml"),
              AllOf(HasSubstr("# from points.csv, SHA-256 "), HasSubstr("covariance_um2")));
}

TEST_F(BarCli, WrittenBarIsThatOfTheMachine) {
  simulate("bar --seed 3 --bar-seed 2 -o cal");
  ASSERT_EQ(abbe(kIdentifyBar).exit, 0);
  EXPECT_LT(largest_error_um(), 2.0);
  simulate("mfb --seed 4 --bar-seed 2 --plan 12 --passes forward -o run");
  const Ran ran = abbe(
      "identify mfb --machine run/machine.toml --bar bar.toml --plan run/plan.toml "
      "--points run/points.csv -o out");
  EXPECT_EQ(ran.exit, 0) << ran.out << ran.err;
}

TEST_F(BarCli, PrintsWhatTheOffsetOfTheGaugeCosts) {
  simulate("bar --gauge-beside-mm 275,0 -o cal");
  const Ran ran = abbe(kIdentifyBar);
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(ran.out,
              AllOf(testing::ContainsRegex("lies 27[45]\\.[0-9]+ mm beside the line of the bar"),
                    HasSubstr("Abbe offset 0.5")));

  change("gauge.toml", "u_rotation_urad = 2\n", "");
  const Ran refused = abbe(kIdentifyBar);
  EXPECT_NE(refused.exit, 0);
  EXPECT_THAT(refused.err, HasSubstr("u_rotation"));
}

TEST_F(BarCli, AnInclinedBarNeedsAGaugeThatIsInclinedAndTouchedAsItLies) {
  simulate("bar --exact --inclined-mrad 10 -o cal");  // plan.toml states X
  const Ran ran = abbe(kIdentifyBar);
  EXPECT_EQ(ran.exit, 0) << ran.err;
  EXPECT_LT(largest_error_um(), 0.06);
  EXPECT_THAT(ran.out, HasSubstr("bar_x of the plan is 10 mrad"));

  simulate("bar --inclined-mrad 10 --gauge-travel x -o cal");
  const Ran refused = abbe(kIdentifyBar);
  EXPECT_EQ(refused.exit, 3) << refused.out;
  EXPECT_THAT(refused.err, HasSubstr("the line of its touches is"));
}

TEST_F(BarCli, ShopFloorMistakesAreNamed) {
  simulate("bar --repeats 2 --turned R2=z -o cal");
  Ran ran = abbe(kIdentifyBar);
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, AllOf(HasSubstr("R2"), HasSubstr("turned about z")));

  simulate("bar --repeats 2 -o cal");
  change("points.csv", "R1,hole,3,,0,", "R1,hole,3,,0,1");
  ran = abbe(kIdentifyBar);
  EXPECT_NE(ran.exit, 0);
  EXPECT_THAT(ran.err, HasSubstr("R1: hole 3"));

  simulate("bar --repeats 1 -o cal");
  ran = abbe(kIdentifyBar);
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, HasSubstr("repeats"));
}

TEST_F(BarCli, EveryFaultOfTheGaugeIsReportedAtOnce) {
  test::write_text(folder_.path() / "gauge.toml", R"([gauge]
name = "SG"
origin_mm = [0, 0]
u_um = -1
u_um_per_m = 0.75
alpha_um_per_m_K = 11.5
colour = "blue"
[[step]]
distance_mm = 1
readings_mm = []
[[step]]
distance_mm = 0.5
readings_mm = [[1, 0, 0], [2, 0, 0]]
[[step]]
distance_mm = 50
readings_mm = [1, 2]
)");
  const auto text = test::faults_text(read_gauge_toml(folder_.path() / "gauge.toml"));
  for (const char* fault :
       {"gauge.toml:3:", "tool_offset_mm", "u_um", "u_alpha_um_per_m_K", "colour",
        "gauge.toml:9:", "gauge.toml:10:", "must ascend", "one per run", "all three axes"})
    EXPECT_THAT(text, HasSubstr(fault)) << text;
}

}  // namespace
}  // namespace abbe::daemon
