/// The Python package, run by the interpreter as a user runs it: its numbers against those of C++, its
/// errors, and its examples with a recording, a model and a running abbed.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <signal.h>

#include <array>
#include <cstdlib>
#include <random>
#include <sstream>

#include "abbe/model/model_document.hpp"
#include "abbe/recording/recording_reader.hpp"
#include "spine.hpp"
#include "synthetic_model.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;

struct Python : Spine {
  /// A script, or `-c` and a program, with the package in its path.
  [[nodiscard]] Outcome python(std::vector<std::string> arguments) const {
    std::vector<std::string> command{
        "/usr/bin/env", std::string{"PYTHONPATH="} + ABBE_PYTHON_PACKAGE,
        std::string{"PATH="} + ABBE_WATCH_FOLDER + ":/usr/bin:/bin", ABBE_PYTHON};
    command.insert(command.end(), arguments.begin(), arguments.end());
    return run(std::move(command));
  }
  [[nodiscard]] static std::string example(const std::string& name) {
    return std::string{ABBE_PYTHON_EXAMPLES} + "/" + name;
  }
  /// The file of a recording in tests/golden, unpacked.
  [[nodiscard]] std::string golden(const std::string& name) const {
    const auto unpacked = run({"/bin/sh", "-c",
                               fmt::format("gzip -dc {}/{}.mcap.gz >{}", ABBE_GOLDEN_RECORDINGS,
                                           name, file("golden.mcap"))});
    EXPECT_EQ(unpacked.code, 0) << unpacked.err;
    return file("golden.mcap");
  }
};

/// Prints V, its covariance, c and inside at the points of a file, one line of numbers for each, exact.
constexpr const char* kEvaluate = R"(
import abbe, numpy, sys
model = abbe.Model.load(sys.argv[1])
points_m = numpy.loadtxt(sys.argv[2])
V_m, cov_m2, inside = model.error_at(points_m)
c_m, _ = model.correction_at(points_m)
for V, cov, c, i in zip(V_m, cov_m2, c_m, inside):
    print(*(x.hex() for x in [*V, *cov.ravel(), *c]), int(i))
)";

TEST_F(Python, EvaluatesAModelBitForBitAsCpp) {
  const auto document = daemon::read_model(ABBE_MODEL);
  ASSERT_TRUE(document) << document.error().text;
  const auto tool = document->model.tool_offsets_m().front();
  std::mt19937 random(5);
  std::uniform_real_distribution<double> x(-0.35, 0.35), z(-0.45, -0.05);
  std::vector<calib::Vector3> points;
  std::string text;
  for (int i = 0; i < 200; ++i) {
    points.emplace_back(x(random), x(random), z(random));
    text += fmt::format("{:.17g} {:.17g} {:.17g}\n", points.back().x(), points.back().y(),
                        points.back().z());
  }
  write("points.txt", text);
  const auto evaluated = python({"-c", kEvaluate, ABBE_MODEL, file("points.txt")});
  ASSERT_EQ(evaluated.code, 0) << evaluated.err;

  std::istringstream lines{evaluated.out};
  std::size_t outside = 0;
  for (const calib::Vector3& p : points) {
    const auto error = document->model.error_at(p, tool);
    const auto c = document->model.command_correction(p, tool);
    ASSERT_TRUE(c);
    std::array<double, 15> seen{};
    for (double& number : seen) {
      std::string word;
      lines >> word;
      number = std::strtod(word.c_str(), nullptr);
    }
    bool inside = false;
    lines >> inside;
    EXPECT_EQ(inside, error.inside);
    outside += inside ? 0 : 1;
    for (int i = 0; i < 3; ++i) {
      EXPECT_EQ(seen[static_cast<std::size_t>(i)], error.V_m[i]);
      EXPECT_EQ(seen[static_cast<std::size_t>(12 + i)], c->c_m[i]);
      for (int k = 0; k < 3; ++k)
        EXPECT_EQ(seen[static_cast<std::size_t>(3 + 3 * i + k)], error.cov_V_m2(i, k));
    }
  }
  EXPECT_GT(outside, 10u);
  EXPECT_LT(outside, 190u);
}

TEST_F(Python, EvaluatesInADirectionOfTravel) {
  auto document = daemon::test::synthetic_document(3);
  write("plain.json", daemon::to_json(document));
  document.model = daemon::test::synthetic_travel_model(3);
  write("travel.json", daemon::to_json(document));
  constexpr const char* kDirections = R"(
import abbe, sys
model = abbe.Model.load(sys.argv[1])
for direction in ([1, -1, 1], (-1, 0, 1), None):
    V_m, _, _ = model.error_at([[0.01, 0.02, -0.2]], direction=direction)
    c_m, _ = model.correction_at([[0.01, 0.02, -0.2]], direction=direction)
    print(*(x.hex() for x in [*V_m[0], *c_m[0]]))
for wrong in ([2, 0, 0], [1, 1]):
    try:
        model.error_at([[0.0, 0.0, -0.2]], direction=wrong)
    except (abbe.Error, TypeError) as error:
        print(type(error).__name__, error)
try:
    abbe.Model.load(sys.argv[2]).error_at([[0.0, 0.0, -0.2]], direction=[1, 0, 0])
except abbe.Error as error:
    print(error)
)";
  const auto seen = python({"-c", kDirections, file("travel.json"), file("plain.json")});
  ASSERT_EQ(seen.code, 0) << seen.err;

  using calib::estimation::Travel;
  const calib::Vector3 p(0.01, 0.02, -0.2), tool = document.model.tool_offsets_m().front();
  std::istringstream lines{seen.out};
  const auto next_vector = [&lines] {
    calib::Vector3 v;
    for (double& number : v) {
      std::string word;
      lines >> word;
      number = std::strtod(word.c_str(), nullptr);
    }
    return v;
  };
  std::vector<calib::Vector3> different;
  for (const calib::estimation::AxisTravel& travel :
       {calib::estimation::AxisTravel{Travel::Forward, Travel::Backward, Travel::Forward},
        calib::estimation::AxisTravel{Travel::Backward, Travel::Unknown, Travel::Forward},
        calib::estimation::AxisTravel{}}) {
    different.push_back(next_vector());
    EXPECT_EQ(different.back(), document.model.error_at(p, tool, travel).V_m);
    EXPECT_EQ(next_vector(), document.model.command_correction(p, tool, travel).value().c_m);
  }
  EXPECT_NE(different[0], different[1]);
  EXPECT_NE(different[1], different[2]);
  EXPECT_THAT(seen.out, AllOf(HasSubstr("direction: 2 for X"), HasSubstr("TypeError"),
                              HasSubstr("direction: the model has no backlash")));
}

TEST_F(Python, RaisesErrorsWithTheMessageOfAbbe) {
  constexpr const char* kFaults = R"(
import abbe, sys
def fault(call):
    try:
        call()
    except abbe.Error as error:
        print(error.code, error, sep=": ")
model = abbe.Model.load(sys.argv[1])
fault(lambda: abbe.Model.load("missing.json"))
fault(lambda: abbe.Recording.open(sys.argv[1]))
fault(lambda: model.error_at([1.0, 2.0]))
fault(lambda: model.error_at([[1.0, 2.0]]))
fault(lambda: abbe.Control("/no/such/socket").status())
fault(lambda: abbe.Subscription(program="no-such-program"))
)";
  const auto seen = python({"-c", kFaults, ABBE_MODEL});
  EXPECT_EQ(seen.code, 0) << seen.err;
  EXPECT_THAT(
      seen.out,
      AllOf(HasSubstr("io: read missing.json"), HasSubstr("model.json: is not an MCAP file"),
            HasSubstr("usage: points_m: must be an array of N x 3 numbers"),
            HasSubstr("io: connect /no/such/socket"), HasSubstr("io: start no-such-program")));
  EXPECT_EQ(std::count(seen.out.begin(), seen.out.end(), '\n'), 6);
}

/// Counts and times of all samples, exact.
TEST_F(Python, ReadsEverySampleOfARecording) {
  const std::string recording = golden("tracker-busy");
  constexpr const char* kCount = R"(
import abbe, sys
for kind, devices in abbe.Recording.open(sys.argv[1]).streams().items():
    for device, columns in devices.items():
        print(kind, device, len(columns["time_ns"]), columns["time_ns"][0], columns["time_ns"][-1])
        assert all(len(column) == len(columns["time_ns"]) for column in columns.values())
)";
  const auto seen = python({"-c", kCount, recording});
  ASSERT_EQ(seen.code, 0) << seen.err;
  std::size_t points = 0;
  std::int64_t first_ns = 0, last_ns = 0;
  const auto reader = daemon::RecordingReader::open(recording);
  ASSERT_TRUE(reader);
  daemon::RecordingSink sink;
  sink.tracker_point = [&](const auto& point, auto) {
    last_ns = point.head.time.time_since_epoch().count();
    if (points++ == 0) first_ns = last_ns;
  };
  (void)reader->read(sink);
  ASSERT_GT(points, 0u);
  EXPECT_THAT(seen.out,
              HasSubstr(fmt::format("tracker tracker {} {} {}\n", points, first_ns, last_ns)));
}

TEST_F(Python, TheExamplesOfARecordingAndAModelRun) {
  const auto recording = python({example("recording.py"), golden("tracker-busy")});
  EXPECT_EQ(recording.code, 0) << recording.err;
  EXPECT_THAT(recording.out, ContainsRegex("tracker tracker: [0-9]+ samples"));
  const auto model = python({example("model.py"), ABBE_MODEL});
  EXPECT_EQ(model.code, 0) << model.err;
  EXPECT_THAT(model.out, AllOf(HasSubstr("EXX: 3 nodes"), HasSubstr("2000 of 2000 places inside")));
}

TEST_F(Python, FollowsACalibrationOverTheSocketAndItsVectorsOverDds) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  hold_simulator();
  write_configuration("child");
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  constexpr const char* kBegin = R"(
import abbe, numpy, sys
path_m = 1e-3 * numpy.loadtxt(sys.argv[2], delimiter=",", skiprows=1)
print(abbe.Control(sys.argv[1]).calibrate_otf(path_m)["ok"])
try:
    abbe.Control(sys.argv[1]).calibrate_otf(path_m)
except abbe.Error as error:
    print(error.code)
)";
  const auto begun = python({"-c", kBegin, file("run/control.sock"), file("path.csv")});
  ASSERT_EQ(begun.code, 0) << begun.err;
  EXPECT_EQ(begun.out, "True\nrefused\n");
  simulator_->signal(SIGCONT);
  ASSERT_TRUE(
      eventually([this] { return status()["model"]["state"] == "ACTIVE"; }, kPatienceForARun));

  const auto followed = python(
      {example("follow.py"), file("run/control.sock"), domain_.text(), ABBE_LOOPBACK_PROFILE, "6"});
  EXPECT_EQ(followed.code, 0) << followed.err;
  EXPECT_THAT(followed.out, AllOf(HasSubstr("model ACTIVE"), HasSubstr("session active"),
                                  ContainsRegex("vectors: [1-9][0-9]* may be applied")));
}

}  // namespace
}  // namespace abbe::test
