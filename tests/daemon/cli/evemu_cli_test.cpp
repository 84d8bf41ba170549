/// `abbe identify evemu` and `abbe model eval` on its model: the built program, its files and exit
/// codes.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <initializer_list>
#include <nlohmann/json.hpp>
#include <regex>
#include <string_view>

#include "abbe/methods/calibration_request.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/model/model_store.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "abbe_command.hpp"
#include "config_tables.hpp"
#include "evemu_run.hpp"
#include "recording_fixture.hpp"
#include "report_again.hpp"
#include "report_page.hpp"
#include "warm_scales.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using test::Ran;
using test::text_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;
using ::testing::StartsWith;

std::string l_array_toml() {
  const auto c = tests::evemu::reference_calibrator();
  std::string text = "[calibrator]\nname = \"L array\"\ntip_radius_mm = 0\n";
  for (const auto& b : c.balls)
    text += fmt::format(
        "[[ball]]\nnumber = {}\nx_mm = {}\ny_mm = {}\nz_mm = {}\nradius_mm = 12.7\nu_um = 0.5\n",
        b.number, 1e3 * b.centre_m.x(), 1e3 * b.centre_m.y(), 1e3 * b.centre_m.z());
  for (const auto& b : c.blocks)
    text += fmt::format("[[block]]\nnumber = {}\nnormal = [{}, {}, {}]\nu_urad = 5\n", b.number,
                        b.normal.x(), b.normal.y(), b.normal.z());
  return text;
}

using Touches = std::vector<calib::evemu::Touch>;
using calib::evemu::Feature;

const Touches& touches() {
  static const Touches all = tests::evemu::reference_touches("touched_sig3um.csv");
  return all;
}

std::string touches_csv(const Touches& all = touches()) {
  std::string text = "position,kind,index,x_mm,y_mm,z_mm\n";
  for (const auto& t : all)
    text += fmt::format("{},{},{},{:.17g},{:.17g},{:.17g}\n", t.position,
                        t.feature == Feature::Ball ? "ball" : "block", t.number, 1e3 * t.p_m.x(),
                        1e3 * t.p_m.y(), 1e3 * t.p_m.z());
  return text;
}

std::string errors_csv() {
  std::string text = "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  for (const auto& e : tests::evemu::reference_errors())
    text += fmt::format("{},{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", e.position,
                        e.ball, 1e3 * e.reading_m.x(), 1e3 * e.reading_m.y(), 1e3 * e.reading_m.z(),
                        1e6 * e.V_m.x(), 1e6 * e.V_m.y(), 1e6 * e.V_m.z());
  return text;
}

// The machine is worse than the gate's limits, and its shape has no rotation: everything is written
// all the same.
constexpr int kRefused = 5;

class EvemuCli : public ::testing::Test {
 protected:
  static void SetUpTestSuite() { write_files(shared_); }
  static void TearDownTestSuite() { fs::remove_all(shared_); }
  void SetUp() override { write_files(folder_); }
  void TearDown() override { fs::remove_all(folder_); }

  static void write_files(const fs::path& folder) {
    static const std::string calibrator = l_array_toml(), touched = touches_csv(),
                             errors = errors_csv();
    fs::create_directories(folder);
    test::write_text(folder / "machine.toml", to_toml(config_tables::weak_portal()));
    test::write_text(folder / "calibrator.toml", calibrator);
    test::write_text(folder / "touches.csv", touched);
    test::write_text(folder / "errors.csv", errors);
  }
  /// From the unchanged touches, identified once, in shared_ / "kept_out".
  static const Ran& from_touches() {
    static const Ran ran =
        test::run_abbe(shared_, std::string("identify evemu --machine machine.toml --touches "
                                            "touches.csv --calibrator calibrator.toml ") +
                                    test::kKept);
    return ran;
  }

  fs::path write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
    return folder_ / name;
  }
  Ran abbe(const std::string& arguments) const { return test::run_abbe(folder_, arguments); }

  Ran identify(const Touches& all) const {
    write("touches.csv", touches_csv(all));
    return abbe(
        "identify evemu --machine machine.toml --touches touches.csv --calibrator calibrator.toml "
        "-o out");
  }
  /// Nothing is written when the input is refused.
  void expect_refused(const Ran& ran, int exit, const std::string& why) const {
    EXPECT_EQ(ran.exit, exit);
    EXPECT_THAT(ran.err, HasSubstr(why));
    EXPECT_FALSE(fs::exists(folder_ / "out"));
  }

  static inline const fs::path shared_ =
      fs::path(::testing::TempDir()) / fmt::format("evemu_cli_shared_{}", ::getpid());
  fs::path folder_ = fs::path(::testing::TempDir()) / fmt::format("evemu_cli_{}", ::getpid());
};

TEST_F(EvemuCli, IdentifiesFromTouchesAndReportsShapeOnly) {
  ASSERT_EQ(from_touches().exit, kRefused) << from_touches().err;
  const auto summary = nlohmann::json::parse(from_touches().out);

  EXPECT_EQ(summary["balls"], 72);
  EXPECT_EQ(summary["shape_only"], true);
  EXPECT_EQ(summary["gate"]["accepted"], false);
  EXPECT_LT(summary["held_out_rms_after_um"].get<double>(),
            0.1 * summary["held_out_rms_before_um"].get<double>());
  EXPECT_THAT(text_of(shared_ / "kept_out/coefficients.csv"),
              AllOf(StartsWith("name,value,u,unit\nk_dxx1,"), HasSubstr("\nk_ezz3,"),
                    HasSubstr(",rad/mm^3\n")));
}

TEST_F(EvemuCli, EvaluatesWhatItIdentified) {
  const auto identified =
      abbe("identify evemu --machine machine.toml --errors errors.csv --rotation-known -o out");
  ASSERT_EQ(identified.exit, kRefused) << identified.err;
  EXPECT_THAT(identified.out, HasSubstr("referenced"));
  write("points.csv", "x_mm,y_mm,z_mm\n500,200,50\n500,200,500\n");
  const auto ran = abbe("model eval out/model.json --points points.csv");

  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto document = read_model(folder_ / "out/model.json");
  ASSERT_TRUE(document);
  EXPECT_EQ(document->method, "evemu");
  const auto e = document->model.error_at({0.5, 0.2, 0.05}, calib::Vector3::Zero());
  std::istringstream lines(ran.out);
  std::string line;
  std::getline(lines, line);
  EXPECT_THAT(line, ::testing::StartsWith("# verdict: refused by the gate"));
  while (line.starts_with("#")) std::getline(lines, line);
  std::getline(lines, line);  // behind the names of the columns
  EXPECT_EQ(line, fmt::format("500,200,50,{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},1",
                              1e6 * e.V_m.x(), 1e6 * e.V_m.y(), 1e6 * e.V_m.z(),
                              1e6 * std::sqrt(e.cov_V_m2(0, 0)), 1e6 * std::sqrt(e.cov_V_m2(1, 1)),
                              1e6 * std::sqrt(e.cov_V_m2(2, 2))));
  std::getline(lines, line);
  EXPECT_THAT(line, ::testing::EndsWith(",0"));
}

void expect_same_bits_again(const fs::path& file) {
  const auto text = text_of(file);
  const auto document = parse_model(text, "model.json");
  ASSERT_TRUE(document) << document.error().details.front();
  EXPECT_EQ(to_json(*document), text);
}

TEST_F(EvemuCli, KeepsNoModelWhoseReportCannotBeWritten) {
  fs::create_directories(folder_ / "out/report.html");  // a folder in place of the file
  const std::string identify =
      "identify evemu --machine machine.toml --errors errors.csv --keep kept -o ";
  const auto ran = abbe(identify + "out");
  EXPECT_EQ(ran.exit, 4) << ran.out;
  EXPECT_THAT(ran.err, HasSubstr("report.html"));
  EXPECT_TRUE(ModelStore::open(folder_ / "kept")->list()->empty());
  EXPECT_EQ(abbe(identify + "other").exit, kRefused);
  EXPECT_EQ(ModelStore::open(folder_ / "kept")->list()->size(), 1u);
  expect_same_bits_again(folder_ / "other/model.json");
}

TEST_F(EvemuCli, WritesModelsThatReadBackToTheSameBits) {
  ASSERT_EQ(from_touches().exit, kRefused);
  expect_same_bits_again(shared_ / "kept_out/model.json");
}

TEST_F(EvemuCli, ReportsThatFilesHoldNoTemperaturesOfScales) {
  write("warm.toml", to_toml(config_tables::weak_portal()) + test::kWarmScales);
  const auto from_errors = [this](const std::string& more) {
    return abbe("identify evemu --machine warm.toml --errors errors.csv -o out " + more);
  };
  expect_refused(from_errors(""), 3, "give errors corrected for the temperature of the scales");
  expect_refused(
      abbe("identify evemu --machine warm.toml --touches touches.csv --calibrator calibrator.toml "
           "-o out"),
      3, "give touches corrected for the temperature of the scales and add --scales-corrected");
  EXPECT_EQ(from_errors("--scales-corrected").exit, kRefused);  // by the gate: the model is written
  EXPECT_TRUE(read_model(folder_ / "out/model.json"));
}

/// [evemu] asks for less than the options' defaults do.
const std::string kWatched = to_toml(config_tables::weak_portal()) +
                             to_toml(config_tables::Encoder{}) + "[evemu]\norder = 2\n";

/// What the daemon records of a calibration: what was asked for, and one touch a second in the
/// plan's order.
void record_touches(const fs::path& folder, const Touches& all) {
  using namespace std::chrono_literals;
  RecordingInfo info = example_info();
  info.configuration = kWatched;
  auto recorder = Recorder::open(example_options(folder), info, Recorder::WallTime{});
  ASSERT_TRUE(recorder) << recorder.error().text;
  constexpr protocol::HostTime kBegin{1000s};
  EvemuRequest request{.calibrator = tests::evemu::reference_calibrator()};
  request.sources = {{"calibrator.toml", "abc"}};
  recorder->record(example_axes(0), "encoder");
  recorder->flush();  // a chunk that holds nothing of the run
  recorder->attach(to_attachment({request, kBegin}), kBegin);
  std::uint32_t number = 0;

  for (const auto& t : tests::evemu::touches_in_order(all, request.plan.positions)) {
    protocol::ProbeTrigger touch;
    touch.head.time = kBegin + ++number * 1s;
    touch.touch = number;
    touch.axis_count = 3;
    std::copy_n(t.p_m.data(), 3, touch.position.begin());
    recorder->record(touch, "probe");
  }

  ASSERT_TRUE(recorder->close());
}

TEST_F(EvemuCli, IdentifiesFromARecordingAsFromTheTouchesInIt) {
  record_touches(folder_, touches());
  // The order of the touches is their time: slow noise is correlated along it.
  const auto positions = calib::evemu::TouchPlan{}.positions;
  write("touches.csv", touches_csv(tests::evemu::touches_in_order(touches(), positions)));
  const auto ran = abbe("identify evemu --recording run.mcap --json -o out");
  ASSERT_EQ(ran.exit, kRefused) << ran.err;
  const auto again = abbe(
      "identify evemu --machine machine.toml --touches touches.csv --calibrator calibrator.toml "
      "--order 2 "
      "--json -o again");
  ASSERT_EQ(again.exit, kRefused) << again.err;
  const auto recorded = nlohmann::json::parse(ran.out), read = nlohmann::json::parse(again.out);
  EXPECT_EQ(recorded["unknowns"], 31);
  EXPECT_EQ(recorded["observations"], read["observations"]);

  // The calibrator file states uncertainties, the reference calibrator none: that is in the
  // covariance alone.
  EXPECT_NEAR(recorded["residual_rms_after_um"].get<double>(),
              read["residual_rms_after_um"].get<double>(), 1e-3);
  // Touches of a recording have times, those of a file do not.
  const auto measured = read_model(folder_ / "out/model.json")->run->conditions->measured.value();
  const auto utc = example_info().utc_offset;
  EXPECT_EQ(measured[0], utc.to_utc(protocol::HostTime{std::chrono::seconds{1001}}));
  const auto count = std::ssize(tests::evemu::touches_in_order(touches(), positions));
  EXPECT_EQ(measured[1] - measured[0], std::chrono::seconds{count - 1});
  EXPECT_FALSE(read_model(folder_ / "again/model.json")->run->conditions->measured);
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("<th>measured (UTC)</th>"));
  EXPECT_THAT(text_of(folder_ / "again/report.html"),
              AllOf(HasSubstr("<th>identified (UTC)</th>"), Not(HasSubstr("measured (UTC)"))));
  const auto inputs = nlohmann::json::parse(text_of(folder_ / "out/model.json"))["inputs"].dump();
  EXPECT_THAT(inputs,
              AllOf(HasSubstr("run.mcap"), HasSubstr("calibrator.toml"), HasSubstr("touches")));
  // The name that it had while it was written.
  const auto other =
      abbe("identify evemu --recording run.mcap.part --order 3 --estimator ols --json -o other");
  ASSERT_EQ(other.exit, kRefused) << other.err;
  EXPECT_EQ(nlohmann::json::parse(other.out)["unknowns"], 45);
}

TEST_F(EvemuCli, ADamagedRecordingIsInTheVerdictAndInTheModel) {
  record_touches(folder_, touches());
  const std::string identify = "identify evemu --recording run.mcap -o out";
  EXPECT_THAT(abbe(identify).out, Not(HasSubstr("damaged")));
  damage_chunk(folder_ / "run.mcap", 0);
  const auto ran = abbe(identify);
  EXPECT_EQ(ran.exit, kRefused) << ran.err;
  EXPECT_THAT(ran.out, HasSubstr("the recording is damaged: chunk 1"));
  EXPECT_THAT(text_of(folder_ / "out/model.json"),
              HasSubstr("\"recording_gap\": \"the recording is damaged"));
}

TEST_F(EvemuCli, ReportsWhatARecordingWithoutACompleteRunLacks) {
  Touches few = touches();
  few.resize(10);
  record_touches(folder_, few);
  expect_refused(abbe("identify evemu --recording run.mcap -o out"), 1,
                 "no complete calibration with a ball array");
  EXPECT_EQ(abbe("identify evemu --recording run.mcap --touches touches.csv -o out").exit, 2);
}

/// The first position's touches stand for those of a good machine.
TEST_F(EvemuCli, MakesTheCalibratorFileOfAnArtefact) {
  Touches one = touches();
  std::erase_if(one, [](const auto& t) { return t.position != 1; });
  write("pre.csv", touches_csv(one));
  const auto ran = abbe(
      "identify artefact --touches pre.csv --name 'L \"array\"' --tip-radius-mm 2 "
      "--machine-tip-radius-mm 1.5 -o pre.toml");
  ASSERT_EQ(ran.exit, 0) << ran.err;
  const auto read = read_calibrator_toml(folder_ / "pre.toml");
  ASSERT_TRUE(read) << read.error().text;
  const auto expected = *calib::evemu::precalibrated(
      "L \"array\"", one, 2e-3, {calib::Vector3::UnitZ(), calib::Vector3::UnitY()});
  EXPECT_EQ(read->calibrator.name, "L \"array\"");
  EXPECT_DOUBLE_EQ(read->calibrator.tip_radius_m, 1.5e-3);
  ASSERT_EQ(read->calibrator.balls.size(), expected.balls.size());

  for (std::size_t i = 0; i < expected.balls.size(); ++i) {
    EXPECT_LT((read->calibrator.balls[i].centre_m - expected.balls[i].centre_m).norm(), 1e-14);
    EXPECT_NEAR(read->calibrator.balls[i].radius_m, expected.balls[i].radius_m, 1e-15);
  }

  EXPECT_EQ(
      abbe("identify artefact --touches touches.csv --name L --tip-radius-mm 2 -o pre.toml").exit,
      3);
}

TEST_F(EvemuCli, NamesWhatIsWrongWithTouches) {
  auto touches = touches_csv();
  write("touches.csv", touches.replace(touches.find("1,ball"), 6, "1,bell"));
  const auto ran = abbe(
      "identify evemu --machine machine.toml --touches touches.csv --calibrator calibrator.toml -o "
      "out");
  EXPECT_EQ(ran.exit, 3);
  EXPECT_THAT(ran.err, HasSubstr("touches.csv:2:3: kind: \"bell\": must be ball or block"));
  EXPECT_FALSE(fs::exists(folder_ / "out/model.json"));
}

TEST_F(EvemuCli, NamesABallWithTooFewPoints) {
  auto all = touches();
  int kept = 0;
  std::erase_if(all, [&](const auto& t) {
    return t.position == 3 && t.feature == Feature::Ball && t.number == 4 && ++kept > 3;
  });
  expect_refused(identify(all), 1, "position 3: ball 4 has too few points: 3");
}

TEST_F(EvemuCli, NamesABallTouchedUnderTwoNumbers) {
  auto all = touches();
  std::erase_if(all, [](const auto& t) {
    return t.position == 2 && t.feature == Feature::Ball && t.number == 5;
  });
  for (const auto& t : touches())
    if (t.position == 2 && t.feature == Feature::Ball && t.number == 4) {
      all.push_back(t);
      all.back().number = 5;
    }
  expect_refused(identify(all), 3,
                 "position 2: one ball was touched twice, as ball 4 and as ball 5");
}

TEST_F(EvemuCli, NamesSwappedBlocks) {
  auto all = touches();
  for (auto& t : all)
    if (t.position == 6 && t.feature == Feature::Block) t.number = 3 - t.number;
  expect_refused(identify(all), 3, "position 6: blocks 1 and 2 are swapped");
}

TEST_F(EvemuCli, NamesAPositionWithoutTouches) {
  auto all = touches();
  std::erase_if(all, [](const auto& t) { return t.position == 5; });
  expect_refused(identify(all), 1, "position 5: left out");
}

/// The calibrator file with 15 mm for 12.7 mm as the radius of these balls.
std::string calibrator_with_another_radius(std::initializer_list<int> balls) {
  const std::string_view radius = "radius_mm = 12.7";
  std::string text = l_array_toml();
  for (const int ball : balls) {
    const auto at = text.find(radius, text.find(fmt::format("number = {}", ball)));
    text.replace(at, radius.size(), "radius_mm = 15.0");
  }
  return text;
}

TEST_F(EvemuCli, NamesTheBallOfAnotherRadius) {
  write("calibrator.toml", calibrator_with_another_radius({3}));
  expect_refused(identify(touches()), 3,
                 "the other balls fit: check the radius of this ball in the calibrator file");
}

TEST_F(EvemuCli, NamesTheCalibratorOfAnotherArtefact) {
  write("calibrator.toml", calibrator_with_another_radius({3, 5}));
  expect_refused(identify(touches()), 3, "calibrator file of another artefact");
}

TEST_F(EvemuCli, NamesCoplanarPositions) {
  std::string text = "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  for (const auto& e : tests::evemu::reference_errors())
    text += fmt::format("{},{},{},{},30,{},{},{}\n", e.position, e.ball, 1e3 * e.reading_m.x(),
                        1e3 * e.reading_m.y(), 1e6 * e.V_m.x(), 1e6 * e.V_m.y(), 1e6 * e.V_m.z());
  write("errors.csv", text);
  expect_refused(abbe("identify evemu --machine machine.toml --errors errors.csv -o out"), 1,
                 "the positions are coplanar");
}

TEST_F(EvemuCli, ChoosesSparseModelsByFolds) {
  const auto ran = abbe(
      "identify evemu --machine machine.toml --errors errors.csv --estimator lasso --folds ball "
      "--json -o "
      "out");
  ASSERT_EQ(ran.exit, kRefused) << ran.err;
  const auto summary = nlohmann::json::parse(ran.out);

  EXPECT_EQ(summary["covariance"], "bootstrap by position");
  EXPECT_GT(summary["chosen"]["lambda"].get<double>(), 0.0);
  EXPECT_THAT(text_of(folder_ / "out/cross_validation.csv"),
              StartsWith("gamma,lambda,error_um2\n"));
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr("Choice of lambda and gamma"));
  write("folds.txt", "1\n2\n");
  const auto refused = abbe(
      "identify evemu --machine machine.toml --errors errors.csv --estimator lasso --folds "
      "folds.txt -o no");
  EXPECT_EQ(refused.exit, 3);
}

TEST_F(EvemuCli, AcceptsShapeOnlyWhenTheConfigurationNamesIt) {
  const std::string limits = "[gate]\nmax_error_mm = 10\nmax_gradient = 0.1\n";
  const auto accepted = [&](const std::string& gate) {
    write("machine.toml", to_toml(config_tables::weak_portal()) + gate);
    const auto ran = abbe(
        "identify evemu --machine machine.toml --touches touches.csv --calibrator calibrator.toml "
        "--json -o "
        "out");
    const auto verdict = nlohmann::json::parse(ran.out)["gate"];
    EXPECT_EQ(ran.exit, verdict["accepted"] == true ? 0 : kRefused) << ran.err;
    return verdict;
  };

  const auto refused = accepted(limits);
  EXPECT_EQ(refused["accepted"], false);
  EXPECT_THAT(refused["reasons"][0].get<std::string>(), StartsWith("shape only"));
  EXPECT_EQ(accepted(limits + "accept = [\"evemu-shape-only\"]\n")["accepted"], true);
  write("machine.toml",
        to_toml(config_tables::weak_portal()) + "[gate]\naccept = [\"everything\"]\n");

  EXPECT_EQ(abbe("identify evemu --machine machine.toml --errors errors.csv -o out").exit, 3);
}

TEST_F(EvemuCli, ExplainsInItsReportWhatIsNotEstimable) {
  ASSERT_EQ(from_touches().exit, kRefused);
  const auto page = text_of(shared_ / "kept_out/report.html");
  EXPECT_THAT(page,
              AllOf(HasSubstr("rotation that touches do not determine"), HasSubstr("shape only"),
                    HasSubstr("Rotations of the positions"), HasSubstr("k_ezz3")));
  EXPECT_THAT(page, ::testing::Not(HasSubstr("http://")));
}

TEST_F(EvemuCli, TheReportOfAKeptModelIsMadeAgainFromTheStore) {
  const std::string page = test::expect_same_report_from_store(shared_, from_touches());
  const auto document = read_model(shared_ / "kept_out/model.json");
  ASSERT_TRUE(document && document->run);
  const auto& parts = document->run->parts;
  ASSERT_EQ(parts.size(), 8u);
  double squares = 0.0, count = 0.0, largest_m = 0.0;
  for (const RunFigures::Part& part : parts) {
    const auto n = static_cast<double>(part.count);
    count += n;
    squares += n * part.after_rms_m * part.after_rms_m;
    largest_m = std::max(largest_m, part.after_max_m);
  }
  EXPECT_EQ(count, static_cast<double>(document->statistics.observations));
  EXPECT_NEAR(std::sqrt(squares / count), document->statistics.after.rms_m, 1e-12);
  EXPECT_NEAR(largest_m, document->statistics.after.max_abs_m, 1e-15);
  EXPECT_THAT(page, HasSubstr("their times are not recorded"));
  EXPECT_TRUE(test::every_figure_has_data(page));
}

TEST_F(EvemuCli, NamesAPositionThatIsMissing) {
  std::string text = "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  std::istringstream lines(errors_csv());
  std::string line;
  std::getline(lines, line);
  while (std::getline(lines, line))
    if (!line.starts_with("4,")) text += line + "\n";
  write("errors.csv", text);
  const auto ran = abbe("identify evemu --machine machine.toml --errors errors.csv -o out");
  EXPECT_EQ(ran.exit, 1);
  EXPECT_THAT(ran.err, HasSubstr("position 4: left out"));
}

TEST_F(EvemuCli, NamesLineAndColumnOfWhatLiesOutsideTheTravel) {
  auto all = touches();
  for (auto& t : all) t.p_m.x() = -t.p_m.x();
  const auto ran = identify(all);
  expect_refused(ran, 3, "axis X travels -150 to 650 mm; all are inside with X reversed");
  EXPECT_TRUE(std::regex_search(ran.err, std::regex("touches\\.csv:[0-9]+:1: x_mm: -"))) << ran.err;
}

TEST_F(EvemuCli, NamesTheLineWhereTheTouchesOfAPositionDoNotFit) {
  auto all = touches();
  for (auto& t : all)
    if (t.position == 2 && t.feature == calib::evemu::Feature::Ball &&
        (t.number == 2 || t.number == 6))
      t.number = 8 - t.number;
  const auto ran = identify(all);
  const auto first = std::ranges::find(all, 2, &calib::evemu::Touch::position) - all.begin();
  expect_refused(ran, 3, fmt::format("touches.csv:{}: position 2: the balls", first + 2));
  EXPECT_THAT(ran.err, HasSubstr("they fit with balls 2 and 6 swapped"));
}

TEST_F(EvemuCli, NamesErrorsOfTheOppositeSign) {
  auto all = tests::evemu::reference_errors();
  std::string text = "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  for (const auto& e : all)
    text += fmt::format("{},{},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g},{:.17g}\n", e.position,
                        e.ball, 1e3 * e.reading_m.x(), 1e3 * e.reading_m.y(), 1e3 * e.reading_m.z(),
                        -1e6 * e.V_m.x(), -1e6 * e.V_m.y(), -1e6 * e.V_m.z());
  write("errors.csv", text);
  const auto ran = abbe("identify evemu --machine machine.toml --errors errors.csv -o out");
  expect_refused(ran, 3, "errors.csv: errors: distances between the balls");
  EXPECT_THAT(ran.err, HasSubstr("with all signs reversed"));
}

TEST_F(EvemuCli, DoesNotReadAMissingTargetAsZero) {
  auto machine = config_tables::weak_portal();
  machine.target_offset_mm.reset();
  write("machine.toml", to_toml(machine));
  expect_refused(identify(touches()), 3, "[target] offset_mm is missing");
}

TEST_F(EvemuCli, NeedsTouchesOrErrors) {
  EXPECT_EQ(abbe("identify evemu --machine machine.toml -o out").exit, 2);
  EXPECT_EQ(abbe("identify evemu --machine machine.toml --touches touches.csv -o out").exit, 2);
}

TEST_F(EvemuCli, ARotationReferenceNeedsItsUncertainty) {
  for (const char* command : {"identify evemu --machine machine.toml --errors errors.csv -o out ",
                              "calibrate evemu --calibrator calibrator.toml "}) {
    const auto ran = abbe(std::string(command) + "--rotation-reference errors.csv");
    EXPECT_EQ(ran.exit, 2);
    EXPECT_THAT(ran.err, HasSubstr("--u-reference-um")) << command;
  }
}

TEST_F(EvemuCli, RefusesACalibratorWithEveryFaultNamed) {
  write("calibrator.toml",
        "[calibrator]\nname = \"x\"\n[[ball]]\nnumber = 1\nx_mm = 0\ny_mm = 0\nz_mm = 0\nr = 3\n");
  const auto calibrator = read_calibrator_toml(folder_ / "calibrator.toml");
  ASSERT_FALSE(calibrator);
  std::string all;
  for (const auto& fault : calibrator.error().details) all += fault + "\n";
  EXPECT_THAT(all,
              AllOf(HasSubstr("tip_radius_mm"), HasSubstr("radius_mm"), HasSubstr(": ball[0].r")));
}

}  // namespace
}  // namespace abbe::daemon
