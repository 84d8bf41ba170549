/// `abbe verify MODEL`: compares a model with independent measurements.

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/input_files.hpp"
#include "abbe/tasks/effect_name.hpp"
#include "abbe/tasks/verification_report.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "figures.hpp"
#include "same_machine.hpp"
#include "store_option.hpp"
#include "terminal.hpp"
#include "verification_points.hpp"
#include "verify_several.hpp"

namespace abbe::daemon {
namespace {

namespace verify = calib::verify;

struct VerifyCommand : VerifyArguments {
  std::string socket = DaemonSocket{}.socket;
  bool live_points = false;
  std::size_t count = 0;
  bool json = false;
};

/// --live: points of the running daemon.
void measure_live(VerifyCommand& arguments) {
  if (!arguments.live_points) return;
  arguments.live = [&arguments](const KeepPoints& keep,
                                const AcceptMachine& accept) -> Result<LivePoints> {
    const auto socket = socket_path({arguments.socket, arguments.store.config});
    ABBE_TRY(socket);
    return points_of_daemon(*socket, arguments.count, keep, accept);
  };
}

nlohmann::json figures(const verify::RatioStatistics& s) {
  return {{"count", s.count},
          {"mean", s.mean},
          {"std", s.standard_deviation},
          {"min", s.min},
          {"p25", s.p25},
          {"median", s.median},
          {"p75", s.p75},
          {"max", s.max},
          {"above_1", s.above_1},
          {"share_above_1", static_cast<double>(s.above_1) / static_cast<double>(s.count)}};
}

void print_json(const VerifyOutcome& outcome) {
  const auto& c = outcome.verification.comparison;
  const auto& o = outcome.verification.observations;
  const auto& turned = c.turned;
  nlohmann::json object{
      {"effect", effect_name(verify::effect_at_points(c))},
      {"model", model_id(outcome.document)},
      {"cautions", outcome.verification.cautions},
      {"machine", outcome.machine},
      {"points", o.shot_count()},
      {"places", o.shots.size()},
      {"inside", c.inside.size()},
      {"repeatability_um", repeatability_figure(o)},
      {"before", vector_figures(c.before)},
      {"after", vector_figures(c.after)},
      {"turned_urad", {kUradPerRad * turned(3), kUradPerRad * turned(4), kUradPerRad * turned(5)}},
      {"interpolation_rms_um", kUmPerM * c.interpolation_rms_m},
      {"cut_short", outcome.verification.cut_short},
      {"points_off", outcome.points_off}};

  if (const auto why = why_no_ratio(c)) {
    object["R_not_given"] = *why;
  } else {
    object["R_turned"] = figures(c.R_turned);
    object["R_stated"] = figures(c.R_stated);
  }

  fmt::print("{}\n", indented_json_text(object));
}

void print_ratio(const char* what, const verify::RatioStatistics& s) {
  fmt::print("{:<11} {:>7} {:>7.3f} {:>7.3f} {:>7.3f} {:>7.3f} {:>7.3f} {:>7.3f} {:>7.3f} {:>8}\n",
             what, s.count, s.mean, s.standard_deviation, s.min, s.p25, s.median, s.p75, s.max,
             s.above_1);
}

void print_ratios(const verify::Comparison& c) {
  if (const auto why = why_no_ratio(c)) return fmt::print("R_resmag    not given: {}\n", *why);
  fmt::print("{:<11} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>7} {:>8}\n", "R_resmag", "points",
             "mean", "std", "min", "25 %", "median", "75 %", "max", "above 1");
  print_ratio("  turned", c.R_turned);
  print_ratio("  as stated", c.R_stated);
  fmt::print("grid        error of the interpolation alone {:.3f} um rms\n",
             kUmPerM * c.interpolation_rms_m);
}

void print_summary(const VerifyOutcome& outcome, const VerifyCommand& arguments) {
  const auto& v = outcome.verification;
  const auto& c = v.comparison;
  fmt::print("verdict     {}\n", verdict_text(c));
  for (const auto& line : outcome.points_off) fmt::print("one point   {}\n", line);
  fmt::print("model       {}  (machine \"{}\", {})\n", model_id(outcome.document),
             printable_line(outcome.document.machine), outcome.document.method);
  for (const std::string& caution : v.cautions)
    fmt::print("caution     {}\n", printable_line(caution));
  fmt::print("points      {}; {} of these places where the model is valid\n",
             shots_text(v.observations), c.inside.size());
  fmt::print(
      "left        {:.3f} um rms (largest {:.3f}) without compensation, {:.3f} um ({:.3f}) with "
      "the model\n",
      kUmPerM * c.before.rms_m, kUmPerM * c.before.max_m, kUmPerM * c.after.rms_m,
      kUmPerM * c.after.max_m);
  fmt::print("frame       {}; model turned by {:.1f}, {:.1f}, {:.1f} urad\n",
             arguments.frame == "fit"
                 ? "fitted to the readings: the best-fit rigid motion of V is not observable"
                 : "the machine's axes",
             kUradPerRad * c.turned(3), kUradPerRad * c.turned(4), kUradPerRad * c.turned(5));
  print_ratios(c);

  if (!arguments.out.empty())
    fmt::print("written     {}, grid.csv\n",
               (std::filesystem::path(arguments.out) / "report.html").string());
}

Result<void> write_outputs(const std::filesystem::path& folder, const VerifyOutcome& outcome) {
  if (folder.empty()) return {};
  ABBE_TRY(create_folder(folder));
  ABBE_TRY(replace_file(folder / "grid.csv", to_grid_csv(outcome.verification.comparison)));
  return replace_file(folder / "report.html",
                      verification_report(outcome.document, outcome.verification));
}

bool is_worse(const VerifyOutcome& outcome) {
  return verify::effect_at_points(outcome.verification.comparison) == verify::Effect::Worse;
}

bool is_worse(const SeveralOutcome& outcome) {
  return std::ranges::any_of(outcome.models, [](const ModelAtPoints& one) {
    return verify::effect_at_points(one.comparison) == verify::Effect::Worse;
  });
}

Result<void> show(const VerifyOutcome& outcome, const VerifyCommand& arguments) {
  ABBE_TRY(write_outputs(arguments.out, outcome));
  arguments.json ? print_json(outcome) : print_summary(outcome, arguments);
  return {};
}

Result<void> show(const SeveralOutcome& outcome, const VerifyCommand& arguments) {
  arguments.json ? print_json(outcome) : print_summary(outcome);
  return {};
}

/// `task`: verify_model() or verify_several().
template <class Task>
int run(const VerifyCommand& arguments, const Task& task) {
  std::optional<Error> cut_short;
  ProgressBar bar;
  const auto outcome = task(arguments, cut_short, bar.progress());
  bar.clear();
  if (!outcome) {
    const int code = report(outcome.error());
    return cut_short ? report(*cut_short) : code;
  }
  if (const auto shown = show(*outcome, arguments); !shown) return report(shown.error());
  if (cut_short) return report(*cut_short);
  return number(is_worse(*outcome) ? ExitCode::Worse : ExitCode::Done);
}

void add_options(CLI::App& command, VerifyCommand& arguments) {
  command
      .add_option("MODEL", arguments.models,
                  "model.json; or a model of the store: its id, the beginning of its id, or "
                  "\"active\";\nseveral: only the table of their residuals at the same "
                  "points")
      ->required();
  add_store_options(command, arguments.store);
  auto* points = command.add_option(
      "--points", arguments.points,
      "verification.csv: x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm: scale reading and\n"
      "independent measurement of each point, each in its own frame; rows with the same reading\n"
      "(to 1 mm) are shots of one place; with [[thermal]] the readings must be corrected for the\n"
      "temperature of the scales");
  auto* recording =
      command.add_option("--recording", arguments.recording,
                         "recording of the daemon (.mcap): one point per machine standstill");
  auto* live = command.add_flag(
      "--live", arguments.live_points,
      "one point per machine standstill that the running daemon detects, until Ctrl-C");
  command.add_option("--count", arguments.count, "with --live: end after this number of points")
      ->needs(live);
  command
      .add_option("--socket", arguments.socket,
                  "with --live: control socket of abbed; --config gives it, too")
      ->needs(live)
      ->capture_default_str();
  points->excludes(recording)->excludes(live);
  recording->excludes(live);
  command
      .add_option(
          "--frame", arguments.frame,
          "fit: fit the tracker's frame to the readings; machine: its axes are the machine's axes")
      ->check(CLI::IsMember({"fit", "machine"}))
      ->capture_default_str();
  command.add_option("--tool", arguments.tool,
                     "x,y,z: tool offset in mm; default: that of the calibration");
  command.add_option(
      "--origin-mm", arguments.origin,
      "x,y,z: point where V is set to zero; default: Ball1, or for other methods none");
  command.add_option("--grid-mm", arguments.grid,
                     "x,y,z: steps of the grid; default: 20 steps per axis");
  command
      .add_option(
          "--least-distance-mm", arguments.least_distance_mm,
          "leave out points nearer to the origin; default: a tenth of the volume's diagonal")
      ->check(CLI::NonNegativeNumber);
  command.add_option("--planes-mm", arguments.planes,
                     "x,y,z: planes of the vectors in the report; default: the middle of the grid");
  add_other_machine_option(command, arguments.other_machine);
  command.add_flag("--json", arguments.json, "print the summary as one JSON object");
  command.add_option(
      "-o,--out", arguments.out,
      "folder for report.html and grid.csv, and for verification.csv with the points of\n"
      "--recording or --live; created if needed. Several models: only verification.csv, of --live");
}

}  // namespace

void add_verify(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<VerifyCommand>();
  auto* command = parent.add_subcommand(
      "verify",
      "Compare a model with independent measurements, for example of a laser tracker. Prints the\n"
      "verdict (better or worse with the model), the residuals with and without the model, and,\n"
      "if the points are dense enough to interpolate, R_resmag = |residual| / |measured error| on\n"
      "a grid inside the model's volume. Several shots of one place count as one place, with "
      "their\n"
      "mean. Exit code 8 if the errors are larger with the model (with one of several models). If\n"
      "the recording is damaged before its end, the result is printed and the exit code is 1.");
  add_options(*command, *arguments);

  command->callback([arguments, &exit] {
    measure_live(*arguments);
    exit = arguments->models.size() > 1 ? run(*arguments, verify_several)
                                        : run(*arguments, verify_model);
  });
}

}  // namespace abbe::daemon
