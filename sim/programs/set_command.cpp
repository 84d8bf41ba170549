/// abbe-sim set: writes matching files of a simulated measurement, and prints the commands that use
/// them.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>

#include "abbe/result/try.hpp"
#include "abbe/sim/ball_array.hpp"
#include "abbe/sim/random_truth.hpp"
#include "abbe/sim/touching.hpp"
#include "abbe/sim/tracker_model.hpp"
#include "abbe/sim/truth_table.hpp"
#include "abbe/sim/weak_stiffness.hpp"
#include "bar_options.hpp"
#include "commands.hpp"
#include "reference_points.hpp"
#include "set_files.hpp"
#include "setup_file.hpp"
#include "verification_points.hpp"

namespace abbe::sim {
namespace {

using Files = std::vector<NamedText>;

using namespace std::chrono_literals;
constexpr double kPerMilli = 1e3;

std::string set_file(std::string_view name) {
  const auto files = set_files();
  return std::string(std::ranges::find(files, name, &EmbeddedText::name)->text);
}

/// The machine of the demo, without errors.
TruthMachine demo_machine() {
  TruthMachine machine;
  machine.axis(Axis::X).range = {-0.300, 0.300, 0.0};
  machine.axis(Axis::Y).range = {-0.250, 0.250, 0.0};
  machine.axis(Axis::Z).range = {-0.400, 0.0, -0.200};
  machine.target_offset_m = {0.020, -0.015, -0.120};
  return machine;
}

/// The path.csv of the demo, scaled to the travel of `machine`.
std::vector<PathVertex> demo_path(const TruthMachine& machine) {
  auto vertices = parse_path_csv(set_file("path.csv"), "path.csv").value();
  const TruthMachine demo = demo_machine();
  for (PathVertex& vertex : vertices) {
    for (const Axis axis : kAxes) {
      const AxisRange &from = demo.axis(axis).range, &to = machine.axis(axis).range;
      double& q_m = vertex.q_m[static_cast<Eigen::Index>(axis)];
      q_m = to.min_m + (q_m - from.min_m) * (to.max_m - to.min_m) / (from.max_m - from.min_m);
    }
  }
  return vertices;
}

std::string path_csv(const std::vector<PathVertex>& vertices) {
  std::string text = "x_mm,y_mm,z_mm\n";
  for (const PathVertex& vertex : vertices) {
    const Eigen::Vector3d q_mm = kPerMilli * vertex.q_m;
    text += fmt::format("{:.12g},{:.12g},{:.12g}\n", q_mm.x(), q_mm.y(), q_mm.z());
  }
  return text;
}

/// The points of a laser tracker during a run along the path, with a standstill of 2 s before and
/// after.
Result<std::string> tracker_csv(const TruthMachine& machine,
                                const std::vector<PathVertex>& vertices,
                                const TrackerModel& tracker,
                                std::chrono::milliseconds period = 10ms) {
  constexpr auto kStandstill = 2s;
  auto path = PathMotion::plan({.vertices = vertices});
  ABBE_TRY(path);
  VirtualMachine moving(machine, *std::move(path));
  moving.start(HostTime{kStandstill});

  std::string text = "time_s,range_mm,azimuth_rad,elevation_rad,status\n";
  std::uint64_t index = 0;
  for (HostTime at{}; at < *moving.finished() + kStandstill; at += period) {
    const Eigen::Vector3d p = observe(tracker, moving, at, index++).p_tracker_m;
    const double time_s = ns_to_seconds(device_time(tracker, HostTime{}, at).time_since_epoch());
    text += fmt::format("{:.6f},{:.6f},{:.9f},{:.9f},0\n", time_s, kPerMilli * p.norm(),
                        std::atan2(p.y(), p.x()), std::asin(p.z() / p.norm()));
  }
  return text;
}

/// The touches of the ball array at all positions, as scale readings.
Result<std::string> touches_csv(const TruthMachine& machine, const BallArray& array) {
  const TouchingOptions touching;
  TruthMachine tip = machine;
  tip.target_offset_m.setZero();
  const TouchingProgram program = plan_touching(tip, array, touching);
  const auto path = PathMotion::plan(program.path);
  ABBE_TRY(path);
  const auto edges_s = edge_times_s(program, tip, *path, array.tip_radius_m, touching);

  std::string text = "position,kind,index,x_mm,y_mm,z_mm\n";
  std::size_t touch = 0;
  const auto add = [&](int position, const char* kind, std::size_t index, std::size_t touches) {
    for (std::size_t i = 0; i < touches; ++i, ++touch) {
      const Eigen::Vector3d q_mm = kPerMilli * path->at(edges_s[touch] - touching.delay_s).q_m;
      text += fmt::format("{},{},{},{:.6f},{:.6f},{:.6f}\n", position, kind, index, q_mm.x(),
                          q_mm.y(), q_mm.z());
    }
  };
  for (const int position : touching.positions) {
    add(position, "ball", 1, touching.points_per_ball);
    for (std::size_t block = 1; block <= array.faces.size(); ++block)
      add(position, "block", block, touching.points_per_block);
    for (std::size_t ball = 2; ball <= array.balls.size(); ++ball)
      add(position, "ball", ball, touching.points_per_ball);
  }
  return text;
}

Result<Files> on_the_fly_files() {
  const TruthMachine machine = random_truth(demo_machine(), {.mean_error_m = 103e-6});
  const auto tracker = tracker_csv(machine, demo_path(machine), {});
  ABBE_TRY(tracker);
  return Files{{"machine.toml", set_file("machine.toml") +
                                    "position_mm = [-750, -620, -350]  # to 0.5 m: evidence that "
                                    "the path is not rotated\n"},
               {"path.csv", set_file("path.csv")},
               {"tracker.csv", *tracker},
               {"verification.csv", verification_csv(machine)},
               {"truth.csv", format_truth_csv(machine)}};
}

/// The machine with a smaller travel: the smallest box that contains all balls, enlarged by 1 mm.
/// The reason: the touches give the centre of ball 1, where V is zero.
TruthMachine within_balls(TruthMachine machine, const BallArray& array) {
  for (const Axis axis : kAxes) {
    AxisRange& range = machine.axis(axis).range;
    const auto i = static_cast<Eigen::Index>(axis);
    const auto readings_m = ball_readings_m(machine, array);
    const auto along = [i](const Eigen::Vector3d& q_m) { return q_m[i]; };
    const auto [low, high] = std::ranges::minmax(readings_m, {}, along);
    range = {low[i] - 1e-3, high[i] + 1e-3, low[i]};
  }
  return machine;
}

Result<Files> ball_array_files() {
  const TruthMachine machine = weak_stiffness_machine();
  const BallArray array = reference_ball_array();
  const auto touches = touches_csv(machine, array);
  ABBE_TRY(touches);
  return Files{{"machine.toml", set_file("weak_stiffness.toml") +
                                    "\n[gate]\nmax_error_mm = 10  # this machine is off by 3.3 mm\n"
                                    "max_gradient = 0.5\n"},
               {"calibrator.toml", format_calibrator_toml(array)},
               {"touches.csv", *touches},
               {"reference.csv", reference_csv(machine, array, 5e-6, 1)},
               {"verification.csv", verification_csv(within_balls(machine, array))}};
}

/// The files of a machine whose travel contains the ball array, and of a laser tracker at two
/// places.
Result<Files> joint_files() {
  TruthMachine machine = weak_stiffness_machine();
  machine.order = {Axis::X, Axis::Y, Axis::Z};
  machine = random_truth(machine, {.mean_error_m = 60e-6, .shape = Shape::Cubic, .harmonics = 1});
  TruthMachine with_reflector = machine;
  with_reflector.target_offset_m = demo_machine().target_offset_m;
  const auto path = demo_path(machine);
  const BallArray array = reference_ball_array();
  const auto front = tracker_csv(with_reflector, path, {}, 20ms);
  ABBE_TRY(front);
  const auto behind =
      tracker_csv(with_reflector, path,
                  {.position_m = {1.2, 0.9, 0.3}, .rotation_rad = {0.002, 0.001, -2.1}, .seed = 2});
  ABBE_TRY(behind);
  const auto touches = touches_csv(machine, array);
  ABBE_TRY(touches);

  std::string parts;
  for (const char* place : {"front", "behind"})
    parts += fmt::format(
        "[[run]]\nname = \"tracker {0}\"\npath = \"path.csv\"\ntracker = "
        "\"{0}.csv\"\ntarget_offset_mm = [20, -15, -120]\n\n",
        place);
  parts +=
      "[[array]]\nname = \"ball array\"\ntouches = \"touches.csv\"\ncalibrator = "
      "\"calibrator.toml\"\ns_centre_um = 1.5\n";
  std::string machine_toml = "[machine]\nname = \"three-axis\"\nchain = \"[w X' b Y Z t]\"\n";
  for (const Axis axis : kAxes) {
    const AxisRange& range = machine.axis(axis).range;
    machine_toml += fmt::format("\n[axes.{}]\nmin_mm = {:g}\nmax_mm = {:g}\n",
                                kAxisLetters[static_cast<std::size_t>(axis)],
                                kPerMilli * range.min_m, kPerMilli * range.max_m);
  }
  machine_toml +=
      "\n[target]\noffset_mm = [0, 0, 0]\n\n[model]\nbasis = \"cubic\"\nnode_spacing_mm = 50\n";
  return Files{{"machine.toml", machine_toml},
               {"parts.toml", parts},
               {"path.csv", path_csv(path)},
               {"front.csv", *front},
               {"behind.csv", *behind},
               {"touches.csv", *touches},
               {"calibrator.toml", format_calibrator_toml(array)},
               {"verification.csv", verification_csv(with_reflector)}};
}

struct Set {
  std::function<int(const std::string& folder)> write;
  std::string identify;  ///< the arguments of `abbe identify`
};

int write_files(const std::string& folder, const std::function<Result<Files>()>& files) {
  const auto made = files();
  if (!made) return report(made.error());
  const auto written = write_folder(folder, *made);
  return written ? kDone : report(written.error());
}

const std::map<std::string, Set> kSets{
    {"otf",
     {[](const std::string& folder) { return write_files(folder, on_the_fly_files); },
      "otf --machine machine.toml --path path.csv --tracker tracker.csv"}},
    {"evemu",
     {[](const std::string& folder) { return write_files(folder, ball_array_files); },
      "evemu --machine machine.toml --touches touches.csv --calibrator calibrator.toml "
      "--rotation-reference reference.csv --u-reference-um 5"}},
    {"mfb",
     {write_bar_set,
      "mfb --machine machine.toml --bar bar.toml --plan plan.toml --points points.csv"}},
    {"joint",
     {[](const std::string& folder) { return write_files(folder, joint_files); },
      "joint --machine machine.toml --parts parts.toml"}},
};

struct SetOptions {
  std::string name, folder;
};

int run(const SetOptions& options) {
  std::error_code unknown;
  if (std::filesystem::exists(options.folder, unknown) &&
      !std::filesystem::is_empty(options.folder, unknown))
    return report({ErrorCode::Usage, options.folder + ": is not empty; state a new folder, so that "
                                                      "no file of yours is replaced"});
  const Set& set = kSets.at(options.name);
  if (const int code = set.write(options.folder); code != kDone) return code;
  fmt::print(
      "The files of a simulated measurement are in {0}. Next:\n"
      "  cd {0}\n"
      "  abbe identify {1} -o out\n"
      "  abbe verify out/model.json --points verification.csv -o verified\n"
      "Both commands write a report: out/report.html, verified/report.html.\n",
      options.folder, set.identify);
  return kDone;
}

}  // namespace

Subcommand add_set(CLI::App& app) {
  auto options = std::make_shared<SetOptions>();  // lives as long as the command line's callbacks
  CLI::App* sub = app.add_subcommand("set",
                                     "the files of a simulated measurement, which fit each other, "
                                     "and the commands that use them:\n"
                                     "otf (laser tracker), evemu (ball array), mfb (Multi-Feature "
                                     "Bar), joint (two runs, an array)");
  std::vector<std::string> names;
  for (const auto& [name, set] : kSets) names.push_back(name);
  sub->add_option("NAME", options->name, "otf, evemu, mfb or joint")
      ->required()
      ->check(CLI::IsMember(names));
  sub->add_option("-o,--out", options->folder, "folder for the files; is created")
      ->required()
      ->type_name("FOLDER");
  return {sub, [options] { return run(*options); }};
}

}  // namespace abbe::sim
