/// A ball array that is not at reference temperature when it is touched, and whose file has an
/// uncertainty: files, configuration, live runs and their recordings.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <regex>

#include "abbe/methods/calibration_session.hpp"
#include "abbe/methods/evemu/artefact_thermometer.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/pipeline/assembler.hpp"
#include "abbe/pipeline/recording_rules.hpp"
#include "abbe/replay/replay.hpp"
#include "abbe/sim/ball_array.hpp"
#include "abbe/sim/touching.hpp"
#include "abbe/tables/evemu_files.hpp"
#include "abbe_command.hpp"
#include "config_tables.hpp"
#include "evemu_run.hpp"
#include "recording_fixture.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using test::Ran;
using test::text_of;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kAlpha_per_K = 11.5e-6;
constexpr int kRefusedByTheGate = 5;  // shapes only, all of these

/// touches.csv of the array on a machine without errors.
std::string touches_of_a_perfect_machine(const sim::BallArray& array) {
  const sim::TruthMachine perfect;
  sim::TouchingOptions options{.points_per_ball = 6, .points_per_block = 5, .noise_m = 10e-9};
  options.delay_s = options.jitter_s = 0.0;
  const auto program = sim::plan_touching(perfect, array, options);
  const auto path = *sim::PathMotion::plan(program.path);
  const auto edges_s = sim::edge_times_s(program, perfect, path, array.tip_radius_m, options);
  std::string text = "position,kind,index,x_mm,y_mm,z_mm\n";
  std::size_t touch = 0;

  const auto add = [&](int position, const char* kind, std::size_t index, std::size_t points) {
    for (std::size_t i = 0; i < points; ++i, ++touch) {
      const Eigen::Vector3d q_m = path.at(edges_s[touch]).q_m;
      text += fmt::format("{},{},{},{:.17g},{:.17g},{:.17g}\n", position, kind, index,
                          1e3 * q_m.x(), 1e3 * q_m.y(), 1e3 * q_m.z());
    }
  };

  for (const int position : options.positions) {
    add(position, "ball", 1, options.points_per_ball);
    for (const std::size_t block : {1u, 2u})
      add(position, "block", block, options.points_per_block);
    for (std::size_t ball = 2; ball <= array.balls.size(); ++ball)
      add(position, "ball", ball, options.points_per_ball);
  }

  return text;
}

class WarmArray : public ::testing::Test {
 protected:
  void SetUp() override {
    fs::create_directories(folder_);
    write("machine.toml", to_toml(config_tables::weak_portal()));
  }
  void TearDown() override { fs::remove_all(folder_); }
  void write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  void write_array(const sim::ArrayState& state) const {
    const auto stated = sim::reference_ball_array();
    write("touches.csv", touches_of_a_perfect_machine(sim::true_array(stated, state)));
    write("calibrator.toml", sim::format_calibrator_toml(stated, state));
  }
  /// Removes the expansion coefficient of the array from its file.
  void forget_expansion() const {
    write("calibrator.toml", std::regex_replace(text_of(folder_ / "calibrator.toml"),
                                                std::regex{"(u_)?alpha_um_per_m_K[^\n]*\n"}, ""));
  }
  Ran identify(const std::string& more = {}) const {
    return test::run_abbe(
        folder_,
        "identify evemu --machine machine.toml --touches touches.csv --calibrator "
        "calibrator.toml --estimator ols --json -o out " +
            more);
  }
  [[nodiscard]] calib::VolumetricError error_near_the_far_end() const {
    const auto document = read_model(folder_ / "out/model.json");
    EXPECT_TRUE(document);
    return document->model.error_at(kFar_m, calib::Vector3::Zero());
  }
  void expect_fault(const std::string& calibrator, const std::string& fault) const {
    write("calibrator.toml", calibrator);
    const auto read = read_calibrator_toml(folder_ / "calibrator.toml");
    ASSERT_FALSE(read);
    EXPECT_THAT(read.error().details, ::testing::Contains(HasSubstr(fault)));
  }

  static const calib::Vector3 kFar_m, kBall1_m;
  fs::path folder_ = fs::path(::testing::TempDir()) / fmt::format("evemu_artefact_{}", ::getpid());
};
const calib::Vector3 WarmArray::kFar_m{0.5, 0.2, 0.04}, WarmArray::kBall1_m{-0.09, 0.14, 0.03};

TEST_F(WarmArray, IsAssumedToBeAtTheMachinesTemperatureUntilItsOwnIsKnown) {
  write_array({.temperature_C = 24.0, .alpha_per_K = kAlpha_per_K, .u_alpha_per_K = 0.0});
  const auto corrected = identify("--artefact-C 24 --u-artefact-K 0.5");
  ASSERT_EQ(corrected.exit, kRefusedByTheGate) << corrected.err;
  // 10 nm a touch, five on a face of 20 mm and 0.6 m away: 0.3 um.
  EXPECT_LT(error_near_the_far_end().V_m.norm(), 1e-6);
  forget_expansion();
  ASSERT_EQ(identify().exit, kRefusedByTheGate);
  const double wrong_m = error_near_the_far_end().V_m.norm();
  EXPECT_NEAR(wrong_m / ((kFar_m - kBall1_m).norm() * 4.0), kAlpha_per_K, 0.5e-6);
}

/// errors.csv of a machine without errors.
std::string nothing_at_the_balls() {
  std::string text = "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um\n";
  for (const auto& T : sim::reference_positions())
    for (const auto& ball : sim::reference_ball_array().balls) {
      const Eigen::Vector3d mm = 1e3 * (T * ball.centre_m);
      text += fmt::format("1,1,{:.17g},{:.17g},{:.17g},0,0,0\n", mm.x(), mm.y(), mm.z());
    }
  return text;
}

TEST_F(WarmArray, HasTheUncertaintyOfItsTemperatureAndItsFile) {
  write_array({.temperature_C = 24.0, .alpha_per_K = kAlpha_per_K, .u_alpha_per_K = 1e-6});
  write("reference.csv", nothing_at_the_balls());
  const auto ran = identify(
      "--artefact-C 24 --u-artefact-K 0.5 --rotation-reference reference.csv --u-reference-um 0.1");
  ASSERT_TRUE(ran.exit == 0 || ran.exit == kRefusedByTheGate) << ran.err;
  const double along_m = kFar_m.x() - kBall1_m.x();
  const double of_temperature_m = along_m * std::hypot(0.5 * kAlpha_per_K, 4.0 * 1e-6);
  const double u_m = std::sqrt(error_near_the_far_end().cov_V_m2(0, 0));
  EXPECT_GT(u_m, 0.9 * of_temperature_m);
  EXPECT_LT(u_m, 1.2 * of_temperature_m);  // plus the remaining noise
  EXPECT_LT(std::abs(error_near_the_far_end().V_m.x()), 3.0 * u_m);
}

TEST_F(WarmArray, IsNamedInEveryResult) {
  write_array({.temperature_C = 24.0,
               .alpha_per_K = kAlpha_per_K,
               .u_alpha_per_K = 1e-6,
               .u_ball_m = 0.5e-6,
               .u_block_rad = 4e-6});
  const auto ran = identify("--artefact-C 24 --u-artefact-K 0.5");

  ASSERT_EQ(ran.exit, kRefusedByTheGate) << ran.err;
  const auto artefact = nlohmann::json::parse(ran.out)["artefact"];
  EXPECT_NEAR(artefact["temperature_C"].get<double>(), 24.0, 1e-9);
  EXPECT_NEAR(artefact["expansion_factor"].get<double>(), 1.000046, 1e-12);
  EXPECT_NEAR(artefact["u_expansion_factor"].get<double>(), std::hypot(4e-6, 0.5 * kAlpha_per_K),
              1e-12);
  EXPECT_NEAR(artefact["u_ball_um"].get<double>(), 0.5, 1e-9);
  EXPECT_NEAR(artefact["u_block_urad"].get<double>(), 4.0, 1e-9);
  const auto text = text_of(folder_ / "out/model.json");
  const auto document = parse_model(text, "model.json");
  ASSERT_TRUE(document) << document.error().details.front();
  EXPECT_EQ(to_json(*document), text);
  EXPECT_EQ(document->artefact->u_temperature_K, 0.5);
  EXPECT_FALSE(document->run->conditions->temperature_K) << "no sensor was read";
  EXPECT_THAT(text_of(folder_ / "out/report.html"),
              AllOf(HasSubstr("24.000 C, u = 0.500 K"), HasSubstr("1.000046000")));
  EXPECT_THAT(ran.out, Not(HasSubstr("taken as 20 C")));
}

TEST_F(WarmArray, NeedsBothTemperatureAndExpansion) {
  write_array({.alpha_per_K = kAlpha_per_K});
  const auto no_temperature = identify();

  EXPECT_EQ(no_temperature.exit, 3);
  EXPECT_THAT(no_temperature.err, AllOf(HasSubstr("calibrator.toml has alpha_um_per_m_K"),
                                        HasSubstr("give --artefact-C and --u-artefact-K")));
  forget_expansion();
  const auto no_expansion = identify("--artefact-C 24 --u-artefact-K 0.5");
  EXPECT_EQ(no_expansion.exit, 3);
  EXPECT_THAT(no_expansion.err,
              AllOf(HasSubstr("--artefact-C gives the temperature"),
                    HasSubstr("add alpha_um_per_m_K and u_alpha_um_per_m_K to its file")));
  EXPECT_EQ(identify("--artefact-C 24").exit, 2);
  EXPECT_EQ(identify("--artefact-C 24 --u-artefact-K -1").exit, 2);
  EXPECT_FALSE(fs::exists(folder_ / "out"));
}

TEST_F(WarmArray, MayHaveItsTemperatureInTheConfiguration) {
  write_array({.temperature_C = 24.0, .alpha_per_K = kAlpha_per_K});
  write("machine.toml",
        to_toml(config_tables::weak_portal()) + "[evemu]\nartefact_C = 24\nu_artefact_K = 0.5\n");
  const auto ran = identify();
  ASSERT_EQ(ran.exit, kRefusedByTheGate) << ran.err;
  EXPECT_LT(error_near_the_far_end().V_m.norm(), 1e-6);
}

TEST_F(WarmArray, ReportsFaultsOfItsFileWithTheLine) {
  const std::string whole =
      sim::format_calibrator_toml(sim::reference_ball_array(), {.alpha_per_K = kAlpha_per_K});
  expect_fault(std::regex_replace(whole, std::regex{"\nu_alpha_um_per_m_K[^\n]*"}, ""),
               "calibrator.toml:4:20: calibrator.alpha_um_per_m_K: also needs u_alpha_um_per_m_K");
  expect_fault(std::regex_replace(whole, std::regex{"\nalpha_um_per_m_K[^\n]*"}, ""),
               "calibrator.u_alpha_um_per_m_K: also needs alpha_um_per_m_K");
  expect_fault(std::regex_replace(whole, std::regex{"\nu_alpha_um_per_m_K = "},
                                  "\nu_alpha_um_per_m_K = -1 #"),
               "calibrator.u_alpha_um_per_m_K");
  expect_fault(std::regex_replace(whole, std::regex{"u_urad = 0"}, "u_urad = -1"),
               "block[0].u_urad");
}

TEST_F(WarmArray, KeepsItsExpansionInItsFile) {
  write_array({.alpha_per_K = kAlpha_per_K, .u_alpha_per_K = 0.7e-6});
  const auto read = *read_calibrator_toml(folder_ / "calibrator.toml");
  write("again.toml", calibrator_toml(read.calibrator, {}, ""));
  const auto again = read_calibrator_toml(folder_ / "again.toml");
  ASSERT_TRUE(again) << again.error().text;
  EXPECT_DOUBLE_EQ(again->calibrator.expansivity->alpha_per_K, kAlpha_per_K);
  EXPECT_DOUBLE_EQ(again->calibrator.expansivity->u_alpha_per_K, 0.7e-6);
}

/// An array beside a sensor; [evemu] comes last.
constexpr const char* kWithASensor = R"([[environment]]
name = "rtd"
map = "icpdas-zt2005-c8"
host = "127.0.0.1"
inputs = ["", "plate"]
[cmm]
host = "127.0.0.1"
axes_compensated = false
[evemu]
)";

std::string config_text(const std::string& evemu) {
  return to_toml(config_tables::weak_portal()) + to_toml(config_tables::Encoder{}) + kWithASensor +
         evemu;
}

TEST_F(WarmArray, ReportsThatItsSensorIsInNoFile) {
  write_array({.temperature_C = 24.0, .alpha_per_K = kAlpha_per_K});
  write("machine.toml", config_text("artefact_sensor = \"plate\"\nu_artefact_K = 0.3\n"));
  const auto refused = identify();
  EXPECT_EQ(refused.exit, 3);
  EXPECT_THAT(refused.err, AllOf(HasSubstr("calibrator.toml has alpha_um_per_m_K"),
                                 HasSubstr("artefact_sensor \"plate\" is in no file of touches"),
                                 HasSubstr("give --artefact-C and --u-artefact-K")));

  const auto notes_of = [](const Ran& ran) {
    EXPECT_EQ(ran.exit, kRefusedByTheGate) << ran.err;
    return nlohmann::json::parse(ran.out)["gate"]["notes"].dump();
  };

  const std::string unknown = "the temperature of the array is not known";
  EXPECT_THAT(notes_of(identify("--artefact-C 24 --u-artefact-K 0.5")), Not(HasSubstr(unknown)));
  forget_expansion();
  EXPECT_THAT(notes_of(identify()), HasSubstr(unknown));
  EXPECT_THAT(text_of(folder_ / "out/report.html"), HasSubstr(unknown));
}

std::string faults_with(const std::string& evemu) {
  const auto config = parse_config(config_text(evemu), "abbed.toml");
  std::string all;
  if (!config)
    for (const auto& fault : config.error().details) all += fault + "\n";
  return all;
}

TEST(ArtefactConfiguration, NamesInconsistentValues) {
  EXPECT_EQ(faults_with("artefact_sensor = \"plate\"\nu_artefact_K = 0.2\n"), "");
  EXPECT_EQ(faults_with("artefact_C = 21.5\nu_artefact_K = 0.2\n"), "");
  EXPECT_THAT(
      faults_with("artefact_sensor = \"oven\"\nu_artefact_K = 0.2\n"),
      HasSubstr("evemu.artefact_sensor: no [[environment]] measures a temperature \"oven\""));
  EXPECT_THAT(faults_with("artefact_sensor = \"plate\"\n"),
              HasSubstr("evemu.u_artefact_K: missing"));
  EXPECT_THAT(faults_with("artefact_sensor = \"plate\"\nartefact_C = 20\nu_artefact_K = 0.2\n"),
              HasSubstr("evemu.artefact_C: has no meaning with artefact_sensor"));
  EXPECT_THAT(faults_with("u_artefact_K = 0.2\n"),
              HasSubstr("evemu.u_artefact_K: needs artefact_sensor or artefact_C"));
  EXPECT_THAT(faults_with("artefact_C = 400\n"),
              AllOf(HasSubstr("evemu.artefact_C: must be -50 to 100, not 400"),
                    HasSubstr("u_artefact_K: missing")));
  EXPECT_THAT(faults_with("artefact_sensor = 7\nu_artefact_K = 0.2\n"),
              AllOf(HasSubstr("evemu.artefact_sensor: must be"), Not(HasSubstr("u_artefact_K"))));
}

const std::string kSensor = "artefact_sensor = \"plate\"\nu_artefact_K = 0.3\norder = 2\n";

calib::evemu::Calibrator growing() {
  auto calibrator = tests::evemu::reference_calibrator();
  for (auto& ball : calibrator.balls) ball.u_m = 1e-6;
  calibrator.expansivity = {{kAlpha_per_K, 1e-6}};
  return calibrator;
}

TEST(ArtefactConfiguration, IsComparedWithTheCalibratorFileBeforeARunBegins) {
  const auto refusal = [](const std::string& evemu, const calib::evemu::Calibrator& calibrator) {
    const auto fine =
        check_evemu({.calibrator = calibrator}, *parse_config(config_text(evemu), "abbed.toml"));
    if (fine) return std::string{};
    EXPECT_EQ(fine.error().code, ErrorCode::Refused);
    return fine.error().text;
  };

  EXPECT_EQ(refusal(kSensor, growing()), "");
  EXPECT_THAT(refusal("", growing()),
              HasSubstr("add artefact_sensor or artefact_C, and u_artefact_K"));
  EXPECT_THAT(refusal(kSensor, tests::evemu::reference_calibrator()),
              AllOf(HasSubstr("[evemu] artefact_sensor"), HasSubstr("add alpha_um_per_m_K")));
  EXPECT_EQ(refusal("", tests::evemu::reference_calibrator()), "");
}

protocol::Snapshot at_temperature(double t_K) {
  protocol::Snapshot s;
  s.has_environment = true;
  s.environment.temperature_K[1] = t_K;
  return s;
}

TEST(ArtefactThermometer, GivesTheMeanAndHalfTheRange) {
  ArtefactThermometer thermometer(ArtefactTemperatureConfig{.sensor = 1, .u_temperature_K = 0.4});
  for (const double t_K : {296.0, 296.9, 296.1}) EXPECT_TRUE(thermometer.take(at_temperature(t_K)));
  const auto found = thermometer.over_the_run();
  ASSERT_TRUE(found);
  EXPECT_DOUBLE_EQ(found->temperature_K, 889.0 / 3.0);
  EXPECT_NEAR(found->u_temperature_K, std::hypot(0.4, 0.45 / std::sqrt(3.0)), 1e-12);
}

TEST(ArtefactThermometer, ReportsASilentSensor) {
  ArtefactThermometer thermometer(ArtefactTemperatureConfig{.sensor = 1});
  EXPECT_FALSE(thermometer.take(at_temperature(std::nan(""))));
  EXPECT_FALSE(thermometer.take({}));
  EXPECT_FALSE(thermometer.over_the_run());
  ArtefactThermometer nobody{std::nullopt};
  EXPECT_TRUE(nobody.take({}));
  EXPECT_FALSE(nobody.over_the_run());
  ArtefactThermometer fixed{ArtefactTemperatureConfig{.fixed_K = 295.0, .u_temperature_K = 0.2}};
  EXPECT_TRUE(fixed.take({}));
  EXPECT_EQ(fixed.over_the_run()->temperature_K, 295.0);
}

TEST(ArtefactThermometer, NoTouchIsUsedWhileItsSensorIsSilent) {
  const auto config = *parse_config(config_text(kSensor), "abbed.toml");
  auto acquisition =
      *EvemuAcquisition::create({.calibrator = growing()}, evemu_acquisition_options(config));
  acquisition.begin(protocol::HostTime{10s});
  auto touch = at_temperature(std::nan(""));
  touch.head.time = protocol::HostTime{11s};
  touch.has_trigger = true;
  touch.trigger.touch = 7;
  touch.axis_count = 3;
  acquisition.take(touch);

  EXPECT_EQ(acquisition.points(), 0u);
  EXPECT_THAT(acquisition.take_notes(),
              testing::ElementsAre(HasSubstr(
                  "touch 7: not used: the temperature \"plate\" of the array was not known")));
}

/// Touches of the reference data in the order of the plan, one a second, and the sensor twice a
/// second.
Batch warm_run(const CalibrationRequest& request) {
  Batch batch;
  const auto all = tests::evemu::reference_touches("touched_sig3um.csv");
  std::uint32_t number = 0;

  const auto measure = [&](std::chrono::milliseconds after) {
    protocol::EnvironmentSample sample;
    sample.head.time = request.from + number * 1s + after;
    sample.measured = protocol::temperature_bit(0);
    sample.air_temperature_K = sample.air_pressure_Pa = sample.relative_humidity = std::nan("");
    sample.temperature_K[0] = 296.0 + 1e-3 * number;
    batch.measured_environment.push_back({0, sample});
  };

  const auto& positions = std::get<EvemuRequest>(request.task).plan.positions;
  for (const auto& t : tests::evemu::touches_in_order(all, positions)) {
    protocol::ProbeTrigger trigger;
    measure(0ms);
    measure(500ms);
    trigger.head.time = request.from + ++number * 1s;
    trigger.touch = number;
    trigger.axis_count = 3;
    std::copy_n(t.p_m.data(), 3, trigger.position.begin());
    batch.touches.push_back(trigger);
  }

  return batch;
}

/// As in the daemon, while the run continues.
EvemuRun live_run(const CalibrationRequest& request, const Batch& batch, const Config& config) {
  Assembler assembler{assembler_options(config)};
  CalibrationSession session{Methods::options(config)};
  EXPECT_TRUE(session.start(request));
  std::vector<protocol::Snapshot> snapshots;
  assembler.take(batch);
  assembler.finish(snapshots);
  for (const auto& snapshot : snapshots) session.take(snapshot);
  auto acquired = session.take_run();
  EXPECT_TRUE(acquired) << session.status().reason;
  return acquired ? std::get<EvemuRun>(run_of(std::move(*acquired))) : EvemuRun{};
}

void record_run(const fs::path& folder, const std::string& configuration,
                const CalibrationRequest& request, const Batch& batch) {
  RecordingInfo info = example_info();
  info.configuration = configuration;
  std::ranges::move(recording_rules(), std::back_inserter(info.versions));
  auto recorder = Recorder::open(example_options(folder), info, Recorder::WallTime{});
  ASSERT_TRUE(recorder) << recorder.error().text;
  recorder->attach(to_attachment(request), request.from);
  for (std::size_t i = 0; i < batch.touches.size(); ++i) {
    recorder->record(batch.measured_environment[2 * i].sample, "rtd");
    recorder->record(batch.measured_environment[2 * i + 1].sample, "rtd");
    recorder->record(batch.touches[i], "probe");
  }
  ASSERT_TRUE(recorder->close());
}

TEST(WarmRun, GivesTheSameModelLiveFromItsRecordingAndFromACommand) {
  const TemporaryFolder folder;
  const CalibrationRequest request{EvemuRequest{.calibrator = growing()},
                                   protocol::HostTime{1000s}};
  const auto config = *parse_config(config_text(kSensor), "abbed.toml");
  const Batch batch = warm_run(request);
  const EvemuRun run = live_run(request, batch, config);
  ASSERT_TRUE(run.artefact);
  // From 296 K up by 1 mK a touch; a sensor's value is used from 0.6 s after it was measured.
  const double last_K = 1e-3 * static_cast<double>(batch.touches.size() - 1);
  EXPECT_NEAR(run.artefact->temperature_K, 296.0 + 0.5 * last_K, 2e-3);
  EXPECT_NEAR(run.artefact->u_temperature_K, std::hypot(0.3, 0.5 * last_K / std::sqrt(3.0)), 1e-3);
  const auto live = identify(CalibrationRun{run}, config, nullptr);
  ASSERT_TRUE(live) << live.error().text;
  const auto hash = model_hash(document_of(*live, config, {}, {}));

  record_run(folder.path(), config_text(kSensor), request, batch);
  const auto reader = RecordingReader::open(folder.path() / "run.mcap");
  ASSERT_TRUE(reader) << reader.error().text;
  const auto again = replay(*reader, config, {});
  ASSERT_TRUE(again) << again.error().text;
  ASSERT_EQ(again->calibrations.size(), 1u);
  EXPECT_EQ(again->calibrations[0].model_hash, hash) << again->calibrations[0].ended.reason;

  const auto ran =
      test::run_abbe(folder.path(), "identify evemu --recording run.mcap --json -o out");
  ASSERT_EQ(ran.exit, kRefusedByTheGate) << ran.err;
  const auto said = nlohmann::json::parse(ran.out);
  EXPECT_EQ(said["hash"], hash);
  EXPECT_NEAR(said["artefact"]["temperature_C"].get<double>() + 273.15, run.artefact->temperature_K,
              1e-9);
}

TEST(CalibrationRequestOfAWarmArray, KeepsItsExpansion) {
  const CalibrationRequest asked{EvemuRequest{.calibrator = growing()}, protocol::HostTime{1s}};
  const auto read = from_attachment(to_attachment(asked));
  ASSERT_TRUE(read) << read.error().text;
  const auto& again = std::get<EvemuRequest>(read->task).calibrator;
  ASSERT_TRUE(again.expansivity);
  EXPECT_EQ(again.expansivity->alpha_per_K, kAlpha_per_K);
  EXPECT_EQ(again.balls[2].u_m, 1e-6);
}

}  // namespace
}  // namespace abbe::daemon
