/// The Python package, run by the interpreter as a user runs it: its numbers against those of C++,
/// its errors, and its examples with a recording, a model and a running abbed.

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
#include "touching_run.hpp"

namespace abbe::test {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::ContainsRegex;
using testing::HasSubstr;

/// The interpreter with a script, or with `-c` and a program, and the package in its path.
std::vector<std::string> python_command(const std::vector<std::string>& arguments) {
  std::vector<std::string> command{"/usr/bin/env", std::string{"PYTHONPATH="} + ABBE_PYTHON_PACKAGE,
                                   std::string{"PATH="} + ABBE_WATCH_FOLDER + ":/usr/bin:/bin",
                                   ABBE_PYTHON};
  command.insert(command.end(), arguments.begin(), arguments.end());
  return command;
}

std::string example(const std::string& name) {
  return std::string{ABBE_PYTHON_EXAMPLES} + "/" + name;
}

struct Python : Spine {
  [[nodiscard]] Outcome python(const std::vector<std::string>& arguments) const {
    return run(python_command(arguments));
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

/// Prints V, its covariance, c and inside at the points of a file, one line of numbers for each,
/// exact.
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

  using calib::Travel;
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
  for (const calib::AxisTravel& travel :
       {calib::AxisTravel{Travel::Forward, Travel::Backward, Travel::Forward},
        calib::AxisTravel{Travel::Backward, Travel::Unknown, Travel::Forward},
        calib::AxisTravel{}}) {
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
fault(lambda: abbe.identify_otf())
fault(lambda: abbe.identify_otf(recording="a.mcap", path="path.csv"))
fault(lambda: abbe.identify_otf(machine="m.toml", path="p.csv", tracker="t.csv",
                                mode="stand-still"))
fault(lambda: abbe.identify_evemu(machine="m.toml", touches="t.csv", calibrator="c.toml",
                                  artefact_C=21))
fault(lambda: abbe.identify_mfb(machine="m.toml", points="p.csv", bar="b.toml"))
fault(lambda: abbe.verify(sys.argv[1]))
fault(lambda: abbe.verify([], points="points.csv"))
)";
  const auto seen = python({"-c", kFaults, ABBE_MODEL});
  EXPECT_EQ(seen.code, 0) << seen.err;
  EXPECT_THAT(
      seen.out,
      AllOf(HasSubstr("io: read missing.json"), HasSubstr("model.json: is not an MCAP file"),
            HasSubstr("usage: points_m: must be an array of N x 3 numbers"),
            HasSubstr("io: connect /no/such/socket"), HasSubstr("io: start no-such-program"),
            HasSubstr("usage: identify otf needs --machine, --path and --tracker"),
            HasSubstr("usage: --path has no effect beside --recording"),
            HasSubstr("usage: --mode: \"stand-still\": must be on-the-fly, standstill"),
            HasSubstr("usage: --artefact-C and --u-artefact-K: give both"),
            HasSubstr("usage: identify mfb needs --plan"),
            HasSubstr("usage: verify: give points or recording"),
            HasSubstr("usage: verify: give a model")));
  EXPECT_EQ(std::count(seen.out.begin(), seen.out.end(), '\n'), 13);
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

/// The use cases of the command line: recording, abbed.toml, store, file for an export and a model.
constexpr const char* kUseCases = R"(
import abbe, numpy, sys
recording, machine, store, grid, copy = sys.argv[1:]
model = abbe.identify_otf(recording=recording)
print("identified", model.id)
print("verdict", model.verdict["state"])
abbe.save_model(model, copy)
print("saved", abbe.Model.load(copy).hash == model.hash)

hull_m = model.validity_hull_m
places_m = numpy.random.default_rng(1).uniform(hull_m.min(0), hull_m.max(0), (20, 3))
V_m = model.error_at(places_m)[0]
rows_mm = 1e3 * numpy.hstack([places_m, places_m + V_m])
numpy.savetxt(grid + ".points", rows_mm, fmt="%.9f", delimiter=",", comments="",
              header="x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm")
print("effect", abbe.verify(copy, points=grid + ".points")["effect"])
several = abbe.verify([copy, copy], points=grid + ".points")
print("several", several["inside"], [one["effect"] for one in several["models"]])

plan = abbe.plan_otf(machine=machine, trackers_at_mm=["-750,-620,-350"], length_m=6)
print("planned", len(plan["vertices_m"]), "vertices", plan["prediction"]["rms_u_m"] > 0)
done = abbe.export_model("active", to="csv-grid", out=grid, store=store)
print("exported", len(done["files"]), "file of", done["model_hash"])
try:
    abbe.identify_otf(machine=machine, path=copy, tracker=copy)
except abbe.Error as error:
    print("missing", error.code)
)";

TEST_F(Python, CalibratesByAnExampleAndFollowsTheVectorsOverDds) {
  write_path("path.csv", path());
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  hold_simulator();
  write_configuration("child");
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const auto calibration = start(
      python_command({example("calibrate.py"), file("run/control.sock"), "otf", file("path.csv")}),
      "calibration");
  ASSERT_TRUE(eventually([&] {
    return !calibration->running() || status()["session"]["state"] == "warming";
  })) << calibration->err();
  constexpr const char* kBeginAgain = R"(
import abbe, numpy, sys
path_m = 1e-3 * numpy.loadtxt(sys.argv[2], delimiter=",", skiprows=1)
try:
    abbe.Control(sys.argv[1]).calibrate_otf(path_m, mode="on-the-fly")
except abbe.Error as error:
    print(error.code)
)";
  const auto refused = python({"-c", kBeginAgain, file("run/control.sock"), file("path.csv")});
  EXPECT_EQ(refused.out, "refused\n") << refused.err;
  simulator_->signal(SIGCONT);
  EXPECT_EQ(calibration->wait_for_end(kPatienceForARun), 0) << calibration->err();
  EXPECT_THAT(calibration->out(), AllOf(HasSubstr("warming: "), HasSubstr("acquiring: "),
                                        ContainsRegex("model [0-9a-f]+ is active")));
  ASSERT_TRUE(eventually([this] { return status()["model"]["state"] == "ACTIVE"; }));

  const auto followed = python(
      {example("follow.py"), file("run/control.sock"), domain_.text(), ABBE_LOOPBACK_PROFILE, "6"});
  EXPECT_EQ(followed.code, 0) << followed.err;
  EXPECT_THAT(followed.out, AllOf(HasSubstr("model ACTIVE"), HasSubstr("session active"),
                                  ContainsRegex("vectors: [1-9][0-9]* may be applied")));

  const std::string active = status()["model"]["hash"].get<std::string>();
  abbed_->signal(SIGTERM);
  EXPECT_EQ(abbed_->wait_for_end(kPatienceForARun), 0) << abbed_->err();
  ASSERT_FALSE(recordings().empty());
  const std::string recording = recordings().back().string();
  const auto identified = run(
      {ABBE_PROGRAM, "identify", "otf", "--recording", recording, "--out", file("out"), "--json"});
  ASSERT_EQ(identified.code, 0) << identified.err;
  const auto used = python({"-c", kUseCases, recording, file("abbed.toml"), file("data/models"),
                            file("grid.csv"), file("copy.json")});
  EXPECT_EQ(used.code, 0) << used.err;
  EXPECT_THAT(
      used.out,
      AllOf(HasSubstr("identified " + json::parse(identified.out)["id"].get<std::string>()),
            HasSubstr("verdict accepted"), HasSubstr("saved True"), HasSubstr("effect better"),
            ContainsRegex("several [1-9][0-9]* \\['better', 'better'\\]"),
            ContainsRegex("planned [1-9][0-9]* vertices"),
            HasSubstr("exported 1 file of " + active), HasSubstr("missing bad_input")));
}

TEST_F(Python, VerifiesAtAStandstillAndOrdersTheTracker) {
  write_path("path.csv", {{0, 0, -100}, {50, 0, -100}});
  ASSERT_NO_FATAL_FAILURE(start_simulator());
  hold_simulator();
  write_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  constexpr const char* kRequests = R"(
import abbe, sys
control = abbe.Control(sys.argv[1])
points = control.verification_points(1)
print("begun", flush=True)
for point in points:
    print("standstill", [round(1e3 * q) for q in point["reading_m"]], point["tracker_points"] > 0)
print("reflectors", len(control.tracker_reflectors()) > 0)
print("home:", control.tracker_home())
print("orders", [order["order"] for order in control.tracker()["orders"]])
print("release awaited", control.machine()["release_awaited"])
for name, request in (("find", lambda: control.tracker_find(-1)), ("release", control.release_machine),
                      ("stop", control.stop_machine),
                      ("reference", lambda: list(control.reference())),
                      ("here", lambda: control.reference_here(["X"], 1e-5))):
    try:
        print(name, "accepted", request())
    except abbe.Error as error:
        print(name, error.code, error.text)
)";
  const auto requests =
      start(python_command({"-c", kRequests, file("run/control.sock")}), "requests");
  ASSERT_TRUE(eventually([&] { return !requests->out().empty() || !requests->running(); }));
  simulator_->signal(SIGCONT);
  EXPECT_EQ(requests->wait_for_end(kPatienceForARun), 0) << requests->err();
  EXPECT_THAT(requests->out(),
              AllOf(HasSubstr("standstill [0, 0, -100] True"), HasSubstr("reflectors True"),
                    HasSubstr("home: "), HasSubstr("'home'"), HasSubstr("release awaited False"),
                    HasSubstr("stop refused machine: there is no measuring machine"),
                    ContainsRegex("find (refused|bad_input|usage|io) ")));
}

TEST_F(Python, ReadsTheFilesOfACalibrationAsTheCommandLine) {
  write("calibrator.toml", "[calibrator]\nname = 5\n");
  write("bar.toml", "nothing = 1\n");
  write("path.csv", "x_mm,y_mm,z_mm\n0,0,0\n100,0,0\n0,0,zero\n");
  constexpr const char* kFaults = R"(
import abbe
control = abbe.Control("no.sock")
for call in (lambda: control.calibrate_otf("path.csv"), lambda: control.calibrate_evemu("calibrator.toml"),
             lambda: control.calibrate_mfb("bar.toml", "missing.toml"),
             lambda: control.calibrate_evemu("missing.toml")):
    try:
        call()
    except abbe.Error as error:
        print(error.code, error)
)";
  const auto seen =
      run({"/bin/sh", "-c", R"(cd "$1" && shift && exec "$@")", "sh", directory_.string(),
           "/usr/bin/env", std::string{"PYTHONPATH="} + ABBE_PYTHON_PACKAGE, ABBE_PYTHON, "-c",
           kFaults});
  EXPECT_EQ(seen.code, 0) << seen.err;
  EXPECT_THAT(seen.out, AllOf(HasSubstr("bad_input path.csv: 1 fault\npath.csv:4:5: z_mm: "),
                              HasSubstr("calibrator.toml:1:1: calibrator.tip_radius_mm: missing"),
                              HasSubstr("io read missing.toml")));
}

struct PythonWithBallArray : TouchingRun {};

TEST_F(PythonWithBallArray, CalibratesByAnExample) {
  ASSERT_NO_FATAL_FAILURE(start_touching_simulator());
  write_touching_configuration();
  ASSERT_NO_FATAL_FAILURE(start_abbed());
  const auto calibration = start(python_command({example("calibrate.py"), file("run/control.sock"),
                                                 "evemu", file("calibrator.toml")}),
                                 "calibration");
  ASSERT_TRUE(eventually([&] {
    const auto now = session();
    return !calibration->running() || (now.is_object() && now["state"] == "warming");
  })) << calibration->err();
  let_machine_go();
  EXPECT_EQ(calibration->wait_for_end(kPatienceForARun), 0) << calibration->err();
  EXPECT_THAT(calibration->out(), AllOf(HasSubstr("(position 1, ball 1: "), HasSubstr("block 2: "),
                                        ContainsRegex("model [0-9a-f]+ is active")));
}

}  // namespace
}  // namespace abbe::test
