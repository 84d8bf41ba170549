/// `abbe identify mfb` and the commands that take its model: the built program, its files and exit
/// codes.

#include <gmock/gmock.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <sstream>

#include "abbe/model/model_document.hpp"
#include "mfb_folder.hpp"
#include "model_eval_output.hpp"
#include "report_again.hpp"
#include "report_page.hpp"

namespace abbe::daemon {
namespace {

using calib::Vector3;
using test::cells_of;
using test::kIdentifyMfb;
using ::testing::HasSubstr;
using ::testing::SizeIs;

struct TableRow {
  double value = 0.0, u = 0.0;
};

/// tables.csv by names such as "EXX@3" (node from 0) and "EC0Y", as the reference data name them.
std::map<std::string, TableRow> tables_in(const std::filesystem::path& file) {
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

/// V at the nodes X = 100, Y = 200, Z = 300 mm: translations, rotations with their levers, and
/// squareness, which tilts the travel only [rigid_body_model.hpp]. Values of tables.csv, um and
/// urad.
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

class MfbCli : public test::MfbFolder {
 protected:
  static void SetUpTestSuite() {
    shared_ = std::make_unique<TemporaryFolder>();
    write_reference_files(shared_->path());
    identified_ = test::run_abbe(shared_->path(), std::string("identify mfb --machine machine.toml "
                                                              "--bar bar.toml --plan plan.toml "
                                                              "--points points.csv ") +
                                                      test::kKept);
  }
  static void TearDownTestSuite() { shared_.reset(); }

  /// A file of the shared identification.
  static std::filesystem::path shared(const std::string& name) {
    return shared_->path() / "kept_out" / name;
  }
  /// `abbe` in the folder of the shared identification.
  static test::Ran abbe_shared(const std::string& arguments) {
    return test::run_abbe(shared_->path(), arguments);
  }

  static inline std::unique_ptr<TemporaryFolder> shared_;
  static inline test::Ran identified_;  ///< from the unchanged files, once
};

/// The reference was linearised at the planned poses, abbe at the poses found, up to 0.14 mm beside
/// them. At 0.1 mm and 0.3 mrad this moves the errors by 0.02 um and 0.05 urad; a
/// tenth of their uncertainty.
constexpr double kPose_um = 0.03, kPose_urad = 0.1;

TEST_F(MfbCli, FindsTheErrorsOfTheReferenceFromItsTouches) {
  ASSERT_EQ(identified_.exit, 0) << identified_.err << identified_.out;
  const auto tables = tables_in(shared("tables.csv"));
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
  const auto ran = abbe(std::string(kIdentifyMfb) + "--estimator sequential");
  ASSERT_TRUE(ran.exit == 0 || ran.exit == 5) << ran.err;
  EXPECT_EQ(nlohmann::json::parse(ran.out)["estimator"], "sequential");
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
  ASSERT_EQ(identified_.exit, 0) << identified_.err;
  const auto summary = nlohmann::json::parse(identified_.out);
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
  ASSERT_EQ(identified_.exit, 0);
  const auto document = read_model(shared("model.json"));
  ASSERT_TRUE(document) << document.error().text;
  EXPECT_EQ(document->method, "mfb");
  EXPECT_EQ(document->model.tables()->layout().tables().size(), 18u);
  EXPECT_EQ(to_json(*document), test::text_of(shared("model.json")));
  EXPECT_THAT(document->bar->passes, SizeIs(17));

  test::write_text(shared_->path() / "at.csv", "x_mm,y_mm,z_mm\n100,200,300\n");
  const auto tables = tables_in(shared("tables.csv"));
  for (const Vector3& t_mm : {Vector3(0, 0, -150), Vector3(30, -20, -90)}) {
    const auto eval =
        abbe_shared(fmt::format("model eval kept_out/model.json --points at.csv --tool-mm={},{},{}",
                                t_mm.x(), t_mm.y(), t_mm.z()));
    ASSERT_EQ(eval.exit, 0) << eval.err;
    const auto row = test::rows_of(eval.out).at(0);
    const Vector3 V_um = V_um_at_100_200_300(tables, t_mm);
    for (std::size_t c = 0; c < 3; ++c)
      EXPECT_NEAR(row.at(3 + c), V_um(static_cast<Eigen::Index>(c)), 1e-6) << eval.out;
    EXPECT_EQ(row.back(), 1.0) << "inside";
  }
  EXPECT_EQ(abbe_shared("model show kept_out/model.json").exit, 0);
  const auto compared = abbe_shared("model compare kept_out/model.json kept_out/model.json");
  EXPECT_EQ(compared.exit, 0) << compared.err;
  EXPECT_THAT(test::text_of(shared("report.html")),
              ::testing::AllOf(HasSubstr("Multi-Feature Bar"),
                               HasSubstr("<th>temperature of the bar</th>")));
}

TEST_F(MfbCli, ChecksTheUncertaintyWithTrialsOnRequest) {
  const auto ran = abbe(std::string(kIdentifyMfb) + "--monte-carlo 20 --seed 7");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto trials = nlohmann::json::parse(ran.out).at("monte_carlo");
  EXPECT_EQ(trials["trials"], 20);
  EXPECT_NEAR(trials["mean_ratio"].get<double>(), 1.0, 0.1);
  EXPECT_EQ(nlohmann::json::parse(abbe(std::string(kIdentifyMfb) + "--monte-carlo 20 --seed 7").out)
                .at("monte_carlo"),
            trials);
}

TEST_F(MfbCli, EstimatesTheDriftOfForwardAndBackwardPasses) {
  const Vector3 drift_mm(0.002, -0.001, 0.0005);  // of the readings, during each pass
  write("points.csv", with_backward_passes(test::reference_points_csv(), drift_mm));
  write("plan.toml", with_backward_passes_in_plan(test::reference_plan_toml()));
  const auto ran = abbe(kIdentifyMfb);
  ASSERT_TRUE(ran.exit == 0 || ran.exit == 5) << ran.err;
  const auto summary = nlohmann::json::parse(ran.out);
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

TEST_F(MfbCli, TheReportOfAKeptModelIsMadeAgainFromTheStore) {
  const std::string page = test::expect_same_report_from_store(shared_->path(), identified_);
  const auto document = read_model(shared("model.json"));
  ASSERT_TRUE(document && document->run && document->bar);
  const auto& parts = document->run->parts;
  ASSERT_EQ(parts.size(), document->bar->passes.size());
  double squares = 0.0, count = 0.0;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    EXPECT_EQ(parts[i].name, document->bar->passes[i].measurement);
    count += static_cast<double>(parts[i].count);
    squares += static_cast<double>(parts[i].count) * std::pow(parts[i].after_rms_m, 2);
  }
  EXPECT_NEAR(std::sqrt(squares / count), document->statistics.after.rms_m, 1e-12);
  EXPECT_FALSE(document->run->places_m.empty());
  EXPECT_TRUE(test::every_figure_has_data(page));
}

}  // namespace
}  // namespace abbe::daemon
