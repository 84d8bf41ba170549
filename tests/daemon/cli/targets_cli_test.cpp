/// `abbe identify otf --target-mm`: three runs of a simulated machine with the reflector at three
/// offsets, as files. The machine is that of the simulator (exact transforms).

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe_command.hpp"
#include "report_page.hpp"
#include "synthetic_otf_run.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using calib::Vector3;
using test::Ran;
using ::testing::HasSubstr;

const std::vector<Vector3> kTargets_m{
    {0.02, -0.015, -0.12}, {0.17, -0.015, -0.12}, {0.02, 0.135, -0.17}};

/// Points of a noise-free tracker along the drive with a target; it stands elsewhere in each run.
std::string tracker_csv_of(std::size_t run) {
  auto truth = test::synthetic_truth();
  truth.target_offset_m = kTargets_m[run];
  const double turn = 1.1 + 0.5 * static_cast<double>(run);
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(turn, Eigen::Vector3d(0.02, -0.03, 1).normalized()).matrix();
  const Eigen::Vector3d tracker_m(-0.9, -0.7 + 0.2 * static_cast<double>(run), -0.3);
  std::string text = "time_s,tracker_x_mm,tracker_y_mm,tracker_z_mm\n";
  for (const auto& point : test::synthetic_points()) {
    const Eigen::Vector3d p_mm =
        1e3 * (R.transpose() * (sim::position_m(truth, point.q_m) - tracker_m));
    text += fmt::format("{},{:.17g},{:.17g},{:.17g}\n", point.time_s, p_mm.x(), p_mm.y(), p_mm.z());
  }
  return text;
}

class TargetsCli : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("targets_cli_{}", ::getpid());
    test::write_synthetic_run(folder_);
    for (std::size_t run = 0; run < kTargets_m.size(); ++run)
      test::write_text(folder_ / fmt::format("t{}.csv", run), tracker_csv_of(run));
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  /// `targets`: the offsets as options give them, one per run.
  static Ran identify(const std::vector<std::string>& targets, const std::string& out,
                      const std::string& more = "") {
    std::string text =
        fmt::format("identify otf --machine machine.toml --path path.csv -o {} {}", out, more);
    for (const auto& target : targets) text += fmt::format(" --target-mm={}", target);
    return test::run_abbe(folder_, text);
  }

  static inline fs::path folder_;
};

const std::vector<std::string> kThreeTargets{"20,-15,-120=t0.csv", "170,-15,-120=t1.csv",
                                             "20,135,-170=t2.csv"};

TEST_F(TargetsCli, DetermineAll18TablesForAnyTool) {
  const auto ran = identify(kThreeTargets, "all", "--estimator simultaneous --json");
  ASSERT_EQ(ran.exit, 0) << ran.out << ran.err;
  const auto summary = nlohmann::json::parse(ran.out);
  EXPECT_EQ(summary["unknowns"].get<int>() - summary["rank"].get<int>(), 24);
  const auto document = read_model(folder_ / "all/model.json");
  ASSERT_TRUE(document) << document.error().text;
  EXPECT_EQ(document->model.tables()->layout().tables().size(), 18u);
  EXPECT_EQ(document->inputs.size(), 5u);
  const std::string page = test::text_of(folder_ / "all/report.html");
  EXPECT_TRUE(test::every_figure_has_data(page));
  for (const auto& p : document->model.parameters())
    EXPECT_EQ(test::dataset_of(test::charts_of(page), p.name + ",").is_null(), !p.position_m)
        << p.name;

  // A tool that no run had. The simulator has exact transforms, the model is linear: 10 nm.
  const Vector3 tool_m(-0.1, 0.2, 0.05);
  auto truth = test::synthetic_truth();
  truth.target_offset_m = tool_m;
  std::vector<Vector3> at_m, left_m;
  for (const Vector3& q : calib::tensor_grid(document->model.nodes())) {
    at_m.push_back(q + tool_m);
    left_m.push_back(document->model.V_at(q, tool_m) - sim::error_m(truth, q));
  }
  const auto left = calib::rigid_free(at_m, left_m);
  ASSERT_TRUE(left);
  EXPECT_LT(left->rigid_free.max_m, 0.05e-6);
}

TEST_F(TargetsCli, OnALineAreRefused) {
  const auto ran =
      identify({"20,-15,-120=t0.csv", "170,-15,-120=t1.csv", "95,-15,-120=t2.csv"}, "line");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, HasSubstr("line"));
  EXPECT_FALSE(fs::exists(folder_ / "line"));
}

TEST_F(TargetsCli, ThatAreMalformedAreUsageErrors) {
  for (const std::string bad : {"20,-15=t0.csv", "20,-15,-120", "20,-15,-120=", "a,b,c=t0.csv"}) {
    const auto ran = identify({bad, kThreeTargets[1], kThreeTargets[2]}, "none");
    EXPECT_EQ(ran.exit, 2) << bad;
    EXPECT_THAT(ran.err, HasSubstr("must be X,Y,Z=FILE")) << bad;
  }
  EXPECT_EQ(identify({"20,-15,-120=missing.csv", kThreeTargets[1], kThreeTargets[2]}, "none").exit,
            4);
}

}  // namespace
}  // namespace abbe::daemon
