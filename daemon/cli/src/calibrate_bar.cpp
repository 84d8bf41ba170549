/// `abbe calibrate bar`: calibrates a Multi-Feature Bar by reversal on the measuring machine of the
/// running daemon. It touches the bar in every clamping of the plan, and a step gauge, and writes
/// bar.toml as `abbe identify bar` does from the same files.

#include <fmt/format.h>
#include <poll.h>
#include <unistd.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/mfb/plan/pass_on_machine.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/gauge_file.hpp"
#include "abbe/tables/mfb_files.hpp"
#include "abbe/tasks/bar_passes_file.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "identify_bar.hpp"
#include "interruption.hpp"
#include "machine_touching.hpp"
#include "terminal.hpp"

namespace abbe::daemon {
namespace {

namespace fs = std::filesystem;
namespace mfb = calib::mfb;

struct CalibrateBarArguments {
  DaemonSocket where;
  IdentifyBarCommand files;  ///< the gauge file as given; the readings are written to another file
  std::size_t gauge_runs = 3, at_most = 0;
  double clearance_mm = 4.0, travel_height_mm = 40.0;
  bool continues = false, yes = false;
};

struct BarToCalibrate {
  BarFile bar;
  BarPlanFile plan;
  GaugeFile gauge;
};

Result<BarToCalibrate> read_files(const IdentifyBarArguments& files) {
  auto bar = read_bar_toml(files.bar);
  ABBE_TRY(bar);
  auto plan = read_bar_plan_toml(files.plan, bar->bar);
  ABBE_TRY(plan);
  auto gauge = read_gauge_to_measure(files.gauge);
  ABBE_TRY(gauge);
  return BarToCalibrate{*std::move(bar), *std::move(plan), *std::move(gauge)};
}

fs::path beside_output(const CalibrateBarArguments& arguments, std::string_view extension) {
  return fs::path(arguments.files.out).replace_extension(extension);
}

bool has_readings(const mfb::StepGauge& gauge) {
  return !gauge.faces.front().readings_m.empty();
}

/// The values in a gauge.toml, except name and readings.
std::vector<double> stated_values(const mfb::StepGauge& gauge) {
  const calib::Expansivity expansion = gauge.expansion.value_or(calib::Expansivity{});
  std::vector<double> values{gauge.u_m,
                             gauge.u_per_m,
                             expansion.alpha_per_K,
                             expansion.u_alpha_per_K,
                             gauge.temperature_K,
                             gauge.u_temperature_K,
                             gauge.u_rotation_rad.value_or(-1.0),
                             gauge.u_alignment_rad.value_or(-1.0)};
  values.insert(values.end(), gauge.origin_m.begin(), gauge.origin_m.end());
  values.insert(values.end(), gauge.tool_offset_m.begin(), gauge.tool_offset_m.end());
  for (const mfb::GaugeFace& face : gauge.faces) values.push_back(face.distance_m);
  return values;
}

bool same_gauge(const mfb::StepGauge& a, const mfb::StepGauge& b) {
  constexpr double kRounding = 1e-11;  // rounding of the text in a file
  const auto values_a = stated_values(a), values_b = stated_values(b);
  return a.name == b.name &&
         std::equal(values_a.begin(), values_a.end(), values_b.begin(), values_b.end(),
                    [](double x, double y) { return std::abs(x - y) <= kRounding; });
}

/// Checks the gauge.toml that an earlier run wrote. --continue uses it if it states the same gauge
/// as --gauge.
Result<void> check_measured_gauge(const CalibrateBarArguments& arguments, const GaugeFile& given) {
  const fs::path file = beside_output(arguments, ".gauge.toml");
  if (has_readings(given.gauge) || !fs::exists(file)) return {};
  if (!arguments.continues)
    return fail(ErrorCode::Usage,
                fmt::format("{}: exists: --continue uses its readings; else remove it, or choose "
                            "another -o",
                            file.string()));
  const auto measured = read_gauge_toml(file);
  ABBE_TRY(measured);
  if (same_gauge(measured->gauge, given.gauge)) return {};
  return fail(
      ErrorCode::BadInput,
      fmt::format("{}: its readings are of gauge \"{}\" with other values than those of "
                  "\"{}\" in {}: remove it, then --continue touches the gauge again",
                  file.string(), measured->gauge.name, given.gauge.name, arguments.files.gauge));
}

std::string text_of(const calib::Vector3& v) {
  return fmt::format("{:g}, {:g}, {:g}", v.x(), v.y(), v.z());
}

/// Waits for Enter. Refused after Ctrl-C or at the end of the standard input.
Result<void> wait_for_operator(const std::string& instruction, bool yes) {
  fmt::print(stderr, "{}\n", instruction);
  if (yes) return {};
  fmt::print(stderr, "The machine moves when you press Enter; Ctrl-C ends the command.\n");
  constexpr int kPoll_ms = 200;
  while (!interrupted()) {
    pollfd input{STDIN_FILENO, POLLIN, 0};
    if (::poll(&input, 1, kPoll_ms) <= 0) continue;
    char c = 0;
    if (::read(STDIN_FILENO, &c, 1) <= 0)
      return fail(ErrorCode::Refused,
                  "the standard input ended before Enter was pressed: run the command in a "
                  "terminal, or use --yes");
    if (c == '\n') return {};
  }
  return fail(ErrorCode::Refused, "ended by a signal; --continue goes on at this pass");
}

/// The alignment of the gauge that its stated uncertainty requires, as text.
std::string alignment_of(const mfb::StepGauge& gauge) {
  return gauge.u_alignment_rad
             ? fmt::format("(u {:g} mrad)", 1e3 * *gauge.u_alignment_rad)
             : fmt::format("within {:g} mm over its length", kMmPerM * mfb::kGaugeAlignment_m);
}

class BarCalibration {
 public:
  BarCalibration(const CalibrateBarArguments& arguments, BarToCalibrate what, BarPassesFile points,
                 fs::path socket)
      : arguments_(arguments),
        what_(std::move(what)),
        points_(std::move(points)),
        socket_(std::move(socket)) {}

  /// Makes the touches that are still missing. False: the option --at-most ended the run before all
  /// were made.
  [[nodiscard]] Result<bool> touch_all() {
    const auto& measurements = what_.plan.plan.measurements;
    std::size_t done = 0;
    for (std::size_t m = 0; m < measurements.size(); ++m) {
      if (points_.has(measurements[m].name)) continue;
      if (arguments_.at_most != 0 && done++ == arguments_.at_most) return false;
      ABBE_TRY(touch_pass(m));
    }
    if (has_readings(what_.gauge.gauge) || fs::exists(gauge_file())) return true;
    if (arguments_.at_most != 0 && done == arguments_.at_most) return false;
    ABBE_TRY(touch_gauge());
    return true;
  }

  /// The gauge.toml with the readings.
  [[nodiscard]] fs::path gauge_file() const {
    return has_readings(what_.gauge.gauge) ? fs::path(arguments_.files.gauge)
                                           : beside_output(arguments_, ".gauge.toml");
  }
  [[nodiscard]] const fs::path& points_file() const { return points_.file(); }

 private:
  [[nodiscard]] mfb::MachineTouchOptions touch_options() const {
    return {1e-3 * arguments_.clearance_mm, 1e-3 * arguments_.travel_height_mm};
  }

  [[nodiscard]] Result<void> touch_pass(std::size_t index) {
    const mfb::Plan& plan = what_.plan.plan;
    const mfb::Measurement& m = plan.measurements[index];
    const auto ready = wait_for_operator(
        fmt::format("{} ({} of {}): clamp the bar with x along ({}) and z along ({}), O_1 at ({}) "
                    "mm, within 1 mm.",
                    m.name, index + 1, plan.measurements.size(), text_of(m.bar_x), text_of(m.bar_z),
                    text_of(kMmPerM * m.origin_m)),
        arguments_.yes);
    if (!ready) return ready;

    const auto tip_m = machine_position(socket_);
    ABBE_TRY(tip_m);
    const auto pass = mfb::pass_on_machine(what_.bar.bar, plan, index, *tip_m, touch_options());
    if (!pass) return tl::unexpected(error_of(pass.error()));
    const auto made = make_touches(socket_, pass->made);
    ABBE_TRY(made);

    mfb::PassTouches touches;
    for (std::size_t i = 0; i < made->places_m.size(); ++i)
      touches.push_back({pass->targets[i], made->places_m[i] - m.tool_offset_m});
    if (!made->reason.empty())
      return tl::unexpected(
          with_kept({made->code,
                     fmt::format("{}: {}", m.name, made->reason),
                     {"the tip may be low: raise it above the bar before --continue"}},
                    rows_of(m, touches)));
    if (const auto shown = mfb::check_pass(what_.bar.bar, plan, index, touches); !shown)
      return tl::unexpected(with_kept(error_of(shown.error()), rows_of(m, touches)));
    return points_.add(rows_of(m, touches));
  }

  /// The first measurement, with the direction of the bar as the touches of all passes show it.
  [[nodiscard]] Result<mfb::Measurement> bar_as_it_lay() const {
    const auto touches = read_bar_points_csv(points_.file(), what_.bar.bar, what_.plan,
                                             nodes_of_measuring_machine());
    ABBE_TRY(touches);
    const auto direction = mfb::direction_of_bar(what_.bar.bar, what_.plan.plan, touches->passes);
    if (!direction) return tl::unexpected(error_of(direction.error()));
    mfb::Measurement m = what_.plan.plan.measurements.front();
    m.bar_x = *direction;
    m.bar_z = m.axes().col(2);
    return m;
  }

  [[nodiscard]] Result<void> touch_gauge() {
    mfb::StepGauge gauge = what_.gauge.gauge;
    const auto normal = bar_as_it_lay();
    ABBE_TRY(normal);
    const auto ready = wait_for_operator(
        fmt::format("step gauge {}: put it where the bar was, along ({}) {}, the centre of the tip "
                    "on its first face at ({}) mm, within 1 mm.",
                    gauge.name, text_of(normal->bar_x), alignment_of(gauge),
                    text_of(kMmPerM * gauge.origin_m)),
        arguments_.yes);
    if (!ready) return ready;

    const auto tip_m = machine_position(socket_);
    ABBE_TRY(tip_m);
    const auto touches =
        mfb::gauge_on_machine(gauge, *normal, arguments_.gauge_runs, *tip_m, touch_options());
    if (!touches) return tl::unexpected(error_of(touches.error()));
    const auto made = make_touches(socket_, *touches);
    ABBE_TRY(made);
    if (!made->reason.empty())
      return fail(made->code,
                  fmt::format("step gauge: {}; --continue touches it again", made->reason));

    for (std::size_t i = 0; i < made->places_m.size(); ++i) {
      const std::size_t run = i / gauge.faces.size(), n = i % gauge.faces.size();
      auto& face = gauge.faces[run % 2 == 0 ? n : gauge.faces.size() - 1 - n];
      face.readings_m.push_back(made->places_m[i] - gauge.tool_offset_m);
    }
    return replace_file(gauge_file(), gauge_toml(gauge, fmt::format("# measured with {} touches\n",
                                                                    made->places_m.size())));
  }

  /// Writes the touches of a pass that is not used to a separate file.
  [[nodiscard]] Error with_kept(Error error, const std::string& rows) const {
    const fs::path file = beside_output(arguments_, ".partial.csv");
    const auto kept = replace_file(file, points_csv(rows));
    error.details.push_back(kept ? fmt::format("the touches of this pass are kept in {}; "
                                               "--continue makes the pass again",
                                               file.string())
                                 : kept.error().text);
    return error;
  }

  const CalibrateBarArguments& arguments_;
  BarToCalibrate what_;
  BarPassesFile points_;
  fs::path socket_;
};

int run(const CalibrateBarArguments& arguments) {
  auto what = read_files(arguments.files);
  if (!what) return report(what.error());
  if (auto usable = check_measured_gauge(arguments, what->gauge); !usable)
    return report(usable.error());
  auto points = BarPassesFile::open(beside_output(arguments, ".points.csv"), what->bar.bar,
                                    arguments.continues);
  if (!points) return report(points.error());
  auto socket = socket_path(arguments.where);
  if (!socket) return report(socket.error());

  mark_interruptions({SIGINT, SIGTERM, SIGHUP, SIGQUIT});
  BarCalibration calibration(arguments, *std::move(what), *std::move(points), *std::move(socket));
  const auto complete = calibration.touch_all();
  if (!complete) return report(complete.error());
  if (!*complete) {
    fmt::print(stderr, "{} passes made; --continue makes the next ones\n", arguments.at_most);
    return 0;
  }

  IdentifyBarCommand files = arguments.files;
  files.points = calibration.points_file().string();
  files.gauge = calibration.gauge_file().string();
  return run_identify_bar(files);
}

void add_files(CLI::App& command, CalibrateBarArguments& arguments) {
  command
      .add_option("--bar", arguments.files.bar,
                  "bar.toml with the nominal points, or those of an earlier calibration")
      ->required();
  command
      .add_option("--plan", arguments.files.plan,
                  "plan.toml: one [[measurement]] and position per pass, half of them with the\n"
                  "opposite bar_z; tool_offset_mm = [0, 0, 0] if the machine reports the tip")
      ->required();
  command
      .add_option("--gauge", arguments.files.gauge,
                  "gauge.toml: the step gauge; without readings_mm it is touched after the passes, "
                  "in the direction of bar_x")
      ->required();
  command
      .add_option("-o,--out", arguments.files.out,
                  "file to write: bar.toml; touches and readings go to .points.csv and\n"
                  ".gauge.toml beside it")
      ->required();
}

}  // namespace

void add_calibrate_bar(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<CalibrateBarArguments>();
  auto* command = parent.add_subcommand(
      "bar",
      "Calibrate a Multi-Feature Bar by reversal on the measuring machine of the running\n"
      "daemon (" +
          tables_with(Capability::Motion) +
          "): before every pass it says how to clamp the bar, and waits for\n"
          "Enter. THE MACHINE MOVES: straight up to the travel height, across, and down to each\n"
          "feature; it avoids no other obstacle. Every pass is checked and kept; a bar that lies\n"
          "turned, another bar or a missed touch ends the command, and --continue makes the pass\n"
          "again. Ctrl-C, a closed terminal, or 2 s without contact between this command and the\n"
          "daemon stop the machine at once (AbortE); the tip may then be low. Exit code 6 or 7 if\n"
          "the machine is not confirmed to be stopped (see abbe machine stop --help). A pass with "
          "a\n"
          "place outside the travel of the machine is refused before it moves (exit code 5).");
  add_files(*command, *arguments);
  command->add_option("--gauge-runs", arguments->gauge_runs, "times that each face is touched")
      ->check(CLI::Range(1, 50))
      ->capture_default_str();
  command
      ->add_option("--clearance-mm", arguments->clearance_mm,
                   "distance between tip and surface before a touch, mm")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command
      ->add_option("--travel-height-mm", arguments->travel_height_mm,
                   "height of the paths above the axis of the bar and the faces of the gauge, mm")
      ->check(CLI::PositiveNumber)
      ->capture_default_str();
  command->add_flag("--continue", arguments->continues,
                    "use the passes that are in .points.csv, and make the others");
  command->add_option("--at-most", arguments->at_most, "end after this number of passes");
  command->add_flag("-y,--yes", arguments->yes, "do not wait for Enter: the bar is clamped");
  add_socket_options(*command, arguments->where);
  command->add_flag("--json", arguments->files.json, "print the summary as one JSON object");
  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon
