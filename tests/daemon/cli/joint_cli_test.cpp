/// `abbe identify joint`: two runs with the tracker at two places and a ball array, as files.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <Eigen/Geometry>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "abbe/calib/model/model_comparison.hpp"
#include "abbe/config/calibration_input.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "abbe/tables/parts_file.hpp"
#include "abbe_command.hpp"
#include "joint_parts.hpp"
#include "made_run_files.hpp"
#include "report_again.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
namespace joint = calib::joint;
using calib::Vector3;
using test::Ran;
using test::text_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

const Vector3 kJointTip_m(0.0, 0.0, -0.15);
constexpr double kJointBallRadius_m = 0.01, kJointTipRadius_m = 0.001;

/// Nine balls in an L, and two faces.
calib::evemu::Calibrator joint_array() {
  calib::evemu::Calibrator c{.name = "L", .tip_radius_m = kJointTipRadius_m};
  for (int i = 0; i < 9; ++i) {
    const Vector3 place_m = i < 5 ? Vector3(0.05 * i, 0.0, 0.0) : Vector3(0.0, 0.04 * (i - 4), 0.0);
    c.balls.push_back({i + 1, place_m, kJointBallRadius_m, 0.5e-6});
  }
  c.blocks = {{1, Vector3::UnitZ(), 5e-6}, {2, Vector3::UnitY(), 5e-6}};
  return c;
}

/// Centres of the tip that touches a ball at nine points of its upper half, array frame.
std::vector<Vector3> tips_on_ball(const calib::evemu::Calibrator::Ball& ball) {
  std::vector<Vector3> tips{ball.centre_m +
                            (kJointBallRadius_m + kJointTipRadius_m) * Vector3::UnitZ()};
  for (int k = 0; k < 8; ++k) {
    const double azimuth = 0.25 * std::numbers::pi * k, elevation = k % 2 == 0 ? 0.2 : 0.8;
    const Vector3 out(std::cos(elevation) * std::cos(azimuth),
                      std::cos(elevation) * std::sin(azimuth), std::sin(elevation));
    tips.emplace_back(ball.centre_m + (kJointBallRadius_m + kJointTipRadius_m) * out);
  }
  return tips;
}

std::vector<Vector3> tips_on_block(int number) {
  const Vector3 n = number == 1 ? Vector3::UnitZ() : Vector3::UnitY();
  const Vector3 other = number == 1 ? Vector3::UnitY() : Vector3::UnitZ();
  std::vector<Vector3> tips;
  for (const double a : {-0.008, 0.0, 0.008})
    for (const double b : {-0.008, 0.0, 0.008})
      tips.emplace_back(Vector3(0.1, 0.08, 0.02) + kJointTipRadius_m * n + a * Vector3::UnitX() +
                        b * other);
  return tips;
}

/// Touches at eight positions with 1 um of noise, by a machine with the errors V.
std::vector<calib::evemu::Touch> joint_touches(const tests::joint::Field& V) {
  std::mt19937_64 random(5);
  std::normal_distribution<double> normal;
  const auto c = joint_array();
  std::vector<calib::evemu::Touch> touches;
  for (std::size_t p = 0; p < 8; ++p) {
    const calib::Matrix3 R = tests::joint::orientation(p, 8);
    const auto touch = [&](calib::evemu::Feature feature, int number, const Vector3& tip_m) {
      const Vector3 place_m = Vector3(0.01, -0.02, -0.2) + R * tip_m;
      Vector3 reading_m = place_m;
      for (int i = 0; i < 5; ++i) reading_m = place_m - V(reading_m, kJointTip_m);
      const double x = normal(random), y = normal(random), z = normal(random);
      touches.push_back(
          {static_cast<int>(p) + 1, feature, number, reading_m + 1e-6 * Vector3(x, y, z)});
    };
    for (const auto& ball : c.balls)
      for (const Vector3& tip_m : tips_on_ball(ball))
        touch(calib::evemu::Feature::Ball, ball.number, tip_m);
    for (const int block : {1, 2})
      for (const Vector3& tip_m : tips_on_block(block))
        touch(calib::evemu::Feature::Block, block, tip_m);
  }
  return touches;
}

std::string joint_touches_csv(const std::vector<calib::evemu::Touch>& touches) {
  std::string text = "position,kind,index,x_mm,y_mm,z_mm\n";
  for (const auto& t : touches)
    text += fmt::format("{},{},{},{:.17g},{:.17g},{:.17g}\n", t.position,
                        t.feature == calib::evemu::Feature::Ball ? "ball" : "block", t.number,
                        1e3 * t.p_m.x(), 1e3 * t.p_m.y(), 1e3 * t.p_m.z());
  return text;
}

/// V at the balls, multiplied by `factor`.
std::string joint_errors_csv(const calib::evemu::Observations& o, double factor) {
  std::string text = "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  for (const auto& r : o.rows) {
    const Vector3 V_um = 1e6 * factor * r.V_m;
    text += fmt::format("{},{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", r.position,
                        r.ball, 1e3 * r.reading_m.x(), 1e3 * r.reading_m.y(), 1e3 * r.reading_m.z(),
                        V_um.x(), V_um.y(), V_um.z());
  }
  return text;
}

const std::string kFrontRun =
    "[[run]]\nname = \"front\"\npath = \"path.csv\"\ntracker = \"front.csv\"\n"
    "tracker_position_mm = [-750, -620, -350]\n";
const std::string kBehindRun =
    "[[run]]\nname = \"behind\"\npath = \"path.csv\"\ntracker = \"behind.csv\"\n"
    "tracker_position_mm = [800, 650, -250]\n";
const std::string kTouchedArray =
    "[[array]]\nname = \"array\"\ntouches = \"touches.csv\"\ncalibrator = \"calibrator.toml\"\n"
    "tip_offset_mm = [0, 0, -150]\n";

std::string errors_of(const std::string& file) {
  return fmt::format("[[array]]\nname = \"array\"\nerrors = \"{}\"\ntip_offset_mm = [0, 0, -150]\n",
                     file);
}

/// The files are made once: the runs are the slow part.
class JointCli : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = fs::path(::testing::TempDir()) / fmt::format("joint_cli_{}", ::getpid());
    fs::create_directories(folder_);
    made_ = tests::otf::make_run({.seed = 1});
    write("machine.toml", test::made_machine_toml(made_.machine.target_offset_m) +
                              "[tracker]\nvertical = \"+Z\"\n");
    write("path.csv", test::made_path_csv(made_.path));
    write("front.csv", test::made_tracker_csv(made_.samples));
    behind_.R = Eigen::AngleAxisd(2.9, Vector3(0.01, 0.02, 1.0).normalized()).matrix();
    behind_.t_m = Vector3(0.8, 0.65, -0.25);
    write("behind.csv", test::made_tracker_csv(test::samples_from(made_, behind_, 2)));
    const auto touches = joint_touches(tests::joint::field_of(made_));
    write("touches.csv", joint_touches_csv(touches));
    write("calibrator.toml", calibrator_toml(joint_array(), {}, ""));
    array_ = *calib::evemu::observe(touches, joint_array(), {made_.machine.chain, kJointTip_m});
    write("parts.toml", kFrontRun + kBehindRun + kTouchedArray);
    agreed_ = test::run_abbe(folder_, fmt::format("identify joint --machine machine.toml --parts "
                                                  "parts.toml {}",
                                                  test::kKept));
  }
  static void TearDownTestSuite() { fs::remove_all(folder_); }

  static void write(const std::string& name, const std::string& text) {
    test::write_text(folder_ / name, text);
  }
  static Ran identify(const std::string& parts, const std::string& out,
                      const std::string& more = "") {
    write("parts.toml", parts);
    return test::run_abbe(
        folder_, fmt::format("identify joint --machine machine.toml --parts parts.toml -o {} {}",
                             out, more));
  }
  static void expect_refused(const Ran& ran, int exit, const std::string& why) {
    EXPECT_EQ(ran.exit, exit) << ran.out;
    EXPECT_THAT(ran.err, HasSubstr(why));
    EXPECT_FALSE(fs::exists(folder_ / "none"));
  }

  static inline fs::path folder_;
  static inline tests::otf::MadeRun made_;
  static inline calib::RigidTransform behind_;
  static inline std::optional<calib::evemu::Observations> array_;
  static inline Ran agreed_;
};

TEST_F(JointCli, PointsInAnotherFrameNeedThePlaceOfTheTracker) {
  std::string points = test::made_tracker_csv(made_.samples);
  for (const std::string name : {"tracker_x_mm", "tracker_y_mm", "tracker_z_mm"})
    points.replace(points.find(name), name.size(), name.substr(8));
  write("unstated.csv", points);
  std::string parts = kFrontRun + kBehindRun;
  parts.replace(parts.find("front.csv"), 9, "unstated.csv");
  expect_refused(identify(parts, "none"), 3, "tracker_centre_mm of the [[run]]");

  const std::string recording = "[[run]]\nrecording = \"r.mcap\"\ntracker_centre_mm = [0, 0, 1]\n";
  expect_refused(identify(recording + kBehindRun, "none"), 3,
                 "its points are in the frame of the tracker");
}

TEST_F(JointCli, PartsThatAgreeGiveAModelThatIsNowhereLessCertain) {
  ASSERT_EQ(agreed_.exit, 0) << agreed_.out << agreed_.err;
  const auto summary = nlohmann::json::parse(agreed_.out);
  EXPECT_EQ(summary["pairs"].size(), 3u);
  for (const auto& pair : summary["pairs"]) {
    EXPECT_FALSE(pair["contradiction"]);
    EXPECT_GT(pair["dof"], 10);
  }
  EXPECT_EQ(summary["directed"].size(), 3u * 7u);
  for (const auto& test : summary["directed"]) EXPECT_FALSE(test["contradiction"]);
  for (const auto& part : summary["parts"]) {
    EXPECT_GE(part["u_without_um"].get<double>(), summary["u_um"].get<double>());
    if (part["method"] == "otf") {
      EXPECT_GT(part["u_alone_um"].get<double>(), summary["u_um"].get<double>());
    }
  }
  for (const auto& table : summary["tables"])
    for (const auto& u_of_run : table["u_of_runs"])
      EXPECT_LE(table["u"].get<double>(), u_of_run.get<double>() * (1.0 + 1e-9));
  EXPECT_THAT(
      text_of(folder_ / "kept_out/report.html"),
      AllOf(HasSubstr("Do the parts agree?"), HasSubstr("scale of X, um/m"), HasSubstr("behind"),
            Not(HasSubstr("src=")), HasSubstr("no residuals of its own"),
            Not(HasSubstr("before the fit")), HasSubstr("error at legs excluded from the fit")));
}

TEST_F(JointCli, TheReportOfAKeptModelIsMadeAgainFromTheStore) {
  const std::string page = test::expect_same_report_from_store(folder_, agreed_);
  EXPECT_THAT(
      page, AllOf(HasSubstr("Do the parts agree?"), HasSubstr("Standard uncertainty of each table"),
                  Not(HasSubstr("<script"))));
}

TEST_F(JointCli, TheModelHasTheErrorsOfTheMachine) {
  const auto document = read_model(folder_ / "kept_out/model.json");
  ASSERT_TRUE(document) << document.error().text;
  EXPECT_EQ(document->method, "joint");
  EXPECT_EQ(document->inputs.size(), 7u);
  const auto left = calib::rigid_free(calib::tensor_grid(made_.machine.nodes),
                                      tests::otf::errors_left(made_, document->model));
  ASSERT_TRUE(left);
  EXPECT_LT(left->rigid_free.rms_m, 1e-6);  // u is 0.3 um
}

TEST_F(JointCli, GivesTheResultOfTheLibrary) {
  const auto config = load_config(folder_ / "machine.toml");
  ASSERT_TRUE(config);
  const auto noise = otf_noise(config->machine);
  const auto machine = *otf_machine(config->machine);
  std::vector<joint::Part> parts;
  std::optional<joint::CommonTables> common;
  Eigen::VectorXd U;
  for (const auto& samples : {made_.samples, test::samples_from(made_, behind_, 2)}) {
    const auto found =
        calib::otf::identify(samples, machine, made_.path, noise, otf_options(samples, *config));
    ASSERT_TRUE(found) << found.error().text;
    const auto& model = found->solution.model;
    if (!common) common = *joint::tables_of(model), U = model.U();
    parts.push_back(*joint::part_of_run(parts.empty() ? "front" : "behind", model, *common));
  }
  parts.push_back(*joint::part_of_array("array", *array_, *common,
                                        {.array = "calibrator.toml", .linearised_at = U}));
  const auto result = joint::identify(parts, *common);
  ASSERT_TRUE(result && result->joint);

  const auto document = read_model(folder_ / "kept_out/model.json");
  ASSERT_TRUE(document);
  const auto& model = result->joint->model;
  // The files contain decimal numbers in mm: rounding of 1e-16 of 1 m.
  EXPECT_LT((document->model.U() - model.U()).cwiseAbs().maxCoeff(), 1e-12);
  EXPECT_LT((document->model.covariance() - model.covariance()).norm(),
            1e-6 * model.covariance().norm());
}

/// The tables of a machine whose control corrects with the wrong sign.
TEST_F(JointCli, AReversedSignIsNamedAndGivesNoModel) {
  const auto V = tests::joint::field_of(made_);
  write("reversed.csv", joint_touches_csv(joint_touches([&](const Vector3& q, const Vector3& t) {
          return Vector3(-V(q, t));
        })));
  auto reversed = kTouchedArray;
  reversed.replace(reversed.find("touches.csv"), 11, "reversed.csv");
  const auto ran = identify(kFrontRun + reversed, "none", "--json");
  expect_refused(ran, 1, "front and array contradict each other");
  EXPECT_THAT(ran.err, HasSubstr("the sign of V is reversed in front or in array"));
  EXPECT_TRUE(nlohmann::json::parse(ran.out)["pairs"][0]["contradiction"]);

  // Errors of which only V is reversed do not fit their own readings.
  write("errors.csv", joint_errors_csv(*array_, -1.0));
  expect_refused(identify(kFrontRun + errors_of("errors.csv"), "none"), 3,
                 "with all signs reversed");
}

TEST_F(JointCli, AWrongUnitIsNamed) {
  write("inch.csv", joint_errors_csv(*array_, 1.0 / 25.4));
  expect_refused(identify(kFrontRun + errors_of("inch.csv"), "none"), 1,
                 "the errors of array are too small by a factor of 25.4 (unit)");
}

/// A length that is wrong by 100 um/m, as of an array that is 9 K warmer than stated.
TEST_F(JointCli, AWrongLengthOfTheArrayIsNamedWithItsValue) {
  auto longer = *array_;
  Vector3 ball1_m = Vector3::Zero();  // of the position, whose first ball it is
  for (auto& row : longer.rows) {
    if (row.ball == 1) ball1_m = row.reading_m;
    row.V_m += 100e-6 * (row.reading_m - ball1_m);
  }
  write("longer.csv", joint_errors_csv(longer, 1.0));
  const auto ran = identify(kFrontRun + errors_of("longer.csv"), "none", "--json");
  expect_refused(ran, 1, "array: its lengths are larger by ");
  EXPECT_THAT(ran.err, HasSubstr("than those of front: wrong length or temperature of the array"));
  const auto length = nlohmann::json::parse(ran.out)["directed"][0];
  EXPECT_EQ(length["direction"], "length");
  EXPECT_NEAR(length["difference"].get<double>(), 100.0, 4.0 * length["u"].get<double>());
}

TEST_F(JointCli, ARunOfAnotherMachineIsRefused) {
  write("behind_other.csv",
        test::made_tracker_csv(test::samples_from(tests::otf::make_run({.seed = 2}), behind_, 3)));
  auto other = kBehindRun;
  other.replace(other.find("behind.csv"), 10, "behind_other.csv");
  expect_refused(identify(kFrontRun + other, "none"), 1, "front and behind contradict each other");
}

TEST_F(JointCli, WrongFilesAreNamedWithThePart) {
  expect_refused(identify(kFrontRun + errors_of("missing.csv"), "none"), 4, "missing.csv");
  expect_refused(identify(kFrontRun + errors_of("front.csv"), "none"), 3, "array: ");
  expect_refused(identify(kFrontRun, "none"), 3, "needs two parts or more");
  expect_refused(identify(kTouchedArray, "none"), 3, "parts.toml:1:1: run: needs at least one");
  expect_refused(identify(kFrontRun + "pth = \"p.csv\"\n" + kBehindRun, "none"), 3, "run[0].pth");
  expect_refused(identify(kFrontRun + kFrontRun, "none"), 3, "two parts have the name \"front\"");
}

TEST_F(JointCli, OneRangeOffsetIsThatOfOneInstrument) {
  const std::string shared = "range_offset = \"home 1\"\n";
  const auto ran =
      identify(kFrontRun + shared + kBehindRun + shared + "instrument = \"other\"\n", "none");
  expect_refused(ran, 3, "\"front\" and \"behind\" have range_offset = \"home 1\"");
  EXPECT_THAT(ran.err, HasSubstr("\"tracker\" and \"other\""));
}

TEST_F(JointCli, ARangeOffsetOfOneRunIsNoted) {
  const auto ran = identify(kFrontRun + "range_offset = \"home 1\"\n" + kBehindRun, "alone");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  EXPECT_THAT(test::text_of(folder_ / "alone/report.html"), HasSubstr("is that of this run only"));
}

}  // namespace
}  // namespace abbe::daemon
