/// `abbe verify MODEL`: compares a model with independent measurements.

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>
#include <system_error>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/fit/points_off.hpp"
#include "abbe/cli/verification_report.hpp"
#include "abbe/config/calib_error.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tables/input_files.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "effect_name.hpp"
#include "figures.hpp"
#include "same_machine.hpp"
#include "store_option.hpp"
#include "terminal.hpp"
#include "vector_option.hpp"
#include "verification_points.hpp"
#include "verify_several.hpp"

namespace abbe::daemon {
namespace {

namespace verify = calib::verify;

struct VerifyArguments {
  std::vector<std::string> models;
  std::string points, recording, out;
  std::string socket = DaemonSocket{}.socket;
  bool live = false;
  std::size_t count = 0;
  std::string tool, frame = "fit", origin, grid, planes;
  std::optional<double> least_distance_mm;
  StoreOption store;
  bool other_machine = false, json = false;
};

struct VerifyOutcome {
  ModelDocument document;
  Verification verification;
  std::vector<std::string> points_off{};  ///< points that alone do not fit, one line each
  std::string machine;                    ///< of_machine() of the model
};

Result<verify::Options> options_of(const VerifyArguments& arguments) {
  verify::Options options;
  if (!arguments.origin.empty()) {
    const auto origin = parse_mm("--origin-mm", arguments.origin);
    ABBE_TRY(origin);
    options.origin_m = *origin;
  }

  if (!arguments.grid.empty()) {
    const auto step = parse_mm("--grid-mm", arguments.grid);
    ABBE_TRY(step);
    if (!(step->minCoeff() > 0.0))
      return fail(ErrorCode::Usage,
                  fmt::format("--grid-mm \"{}\": must be positive", arguments.grid));
    options.step_m = *step;
  }

  if (arguments.least_distance_mm)
    options.least_distance_m = *arguments.least_distance_mm / kMmPerM;
  return options;
}

/// Saves the points to the folder OUT, if given, before they are evaluated, so that an error in the
/// evaluation does not lose the measurement.
Result<void> keep(const VerifyArguments& arguments, const VerificationFile& points) {
  if (arguments.out.empty()) return {};
  ABBE_TRY(create_folder(arguments.out));
  const auto file = std::filesystem::path(arguments.out) / "verification.csv";
  return replace_file(file, to_verification_csv(points.points));
}

Result<LivePoints> from_file(Result<VerificationFile> points) {
  ABBE_TRY(points);
  return LivePoints{std::move(*points), {}, {}};
}

/// What the points have in common with the models: where they come from, and their machine.
OfMachine of_points(const VerifyArguments& arguments, const std::string& machine) {
  return {arguments.live ? "the daemon" : printable_line(arguments.recording), machine};
}

/// The points for models of `machines`. They must be of the same machine, as far as it is known: a
/// file of points does not state it. `different`: different_machines().
Result<LivePoints> points_of(const VerifyArguments& arguments, std::vector<OfMachine> machines,
                             std::string& different) {
  const auto accept = [&](const std::string& machine) -> Result<void> {
    if (!machine.empty()) machines.push_back(of_points(arguments, machine));
    auto found = require_same_machine("verify", machines, arguments.other_machine);
    ABBE_TRY(found);
    different = *std::move(found);
    return {};
  };
  if (!arguments.points.empty()) {
    ABBE_TRY(accept({}));
    return from_file(read_verification_csv(arguments.points));
  }

  const auto keep_them = [&arguments](const VerificationFile& points) {
    return keep(arguments, points);
  };

  if (!arguments.recording.empty()) {
    auto points = points_of_recording(arguments.recording);
    if (!points) return points;
    ABBE_TRY(accept(points->machine));
    ABBE_TRY(keep_them(points->file));
    return points;
  }

  const auto socket = socket_path({arguments.socket, arguments.store.config});
  ABBE_TRY(socket);
  return points_of_daemon(*socket, arguments.count, keep_them, accept);
}

/// The place of a point in messages: "points.csv:9", or "point 8" if it is not from a file.
std::string place_of(const VerificationFile& file, std::size_t point) {
  return point < file.lines.size() ? fmt::format("{}:{}", file.source.name, file.lines[point])
                                   : fmt::format("point {}", point + 1);
}

/// One line for each point that alone does not fit the others.
std::vector<std::string> lines_of_points_off(const VerificationFile& file,
                                             const calib::fit::PointsOff& off,
                                             std::string_view advice) {
  std::vector<std::string> lines;
  for (const auto& [point, distance_m] : off.points)
    lines.push_back(fmt::format(
        "{}: alone does not fit: {:.4g} mm off, the others fit within {:.4g} mm rms: {}",
        place_of(file, point), kMmPerM * distance_m, kMmPerM * off.rms_others_m, advice));
  return lines;
}

/// `error` of the fit of all points: if some alone do not fit, they are the cause.
Error with_points_off(Error error, const VerificationFile& file) {
  std::vector<calib::Vector3> measured_m, readings_m;
  for (const auto& point : file.points) {
    measured_m.push_back(point.measured_m);
    readings_m.push_back(point.reading_m);
  }
  const auto off = calib::fit::points_off(measured_m, readings_m);
  if (off.points.empty()) return error;
  return {error.code,
          fmt::format("verification: {} of {} points alone do not fit the others",
                      off.points.size(), file.points.size()),
          lines_of_points_off(file, off, "correct or delete it")};
}

Result<verify::Observations> observed_in(const VerifyArguments& arguments,
                                         const VerificationFile& file) {
  auto observed = verify::observe(
      file.points, arguments.frame == "fit" ? verify::Frame::BestFit : verify::Frame::Machine);
  if (!observed) return tl::make_unexpected(with_points_off(error_of(observed.error()), file));
  return std::move(*observed);
}

/// The shots at places inside the validity volume that alone do not fit the model.
std::vector<std::string> off_with_model(const VerificationFile& file,
                                        const verify::Observations& observed,
                                        const verify::Comparison& compared,
                                        const calib::VolumetricModel& model,
                                        const calib::Vector3& tool_m) {
  std::vector<calib::Vector3> measured_m, corrected_m;
  std::vector<std::size_t> shots;
  for (const std::size_t place : compared.inside)
    shots.insert(shots.end(), observed.shots[place].begin(), observed.shots[place].end());
  std::ranges::sort(shots);
  for (const std::size_t shot : shots) {
    const auto& [reading_m, at_m] = file.points[shot];
    measured_m.push_back(at_m);
    corrected_m.emplace_back(reading_m + model.V_at(reading_m, tool_m));
  }
  // An error of the size of those of the machine is one that the model does not know.
  auto off = calib::fit::points_off(measured_m, corrected_m, compared.before.rms_m);
  for (auto& found : off.points) found.point = shots[found.point];
  return lines_of_points_off(
      file, off, "check or repeat this point; if it is right, the model is wrong there");
}

/// Sets `cut_short` if points are missing, even if the comparison fails: the missing points may be
/// the cause of its failure.
Result<VerifyOutcome> compare(const VerifyArguments& arguments, std::optional<Error>& cut_short) {
  const auto options = options_of(arguments);
  ABBE_TRY(options);
  auto found = found_model(arguments.models.front(), arguments.store);
  ABBE_TRY(found);
  ModelDocument* const document = &found->document;
  const auto tool_m = tool_of(arguments.tool, document->model);
  ABBE_TRY(tool_m);

  Verification v;

  if (!arguments.planes.empty()) {
    const auto planes = parse_mm("--planes-mm", arguments.planes);
    ABBE_TRY(planes);
    v.planes_m = *planes;
  }

  const auto machine = of_machine(arguments.models.front(), *found);
  std::string different;
  auto points = points_of(arguments, {machine}, different);
  ABBE_TRY(points);
  cut_short = std::move(points->cut_short);

  VerificationFile& file = points->file;
  auto observed = observed_in(arguments, file);
  ABBE_TRY(observed);
  auto compared = verify::compare(*observed, document->model, *tool_m, *options);
  if (!compared) return tl::make_unexpected(error_of(compared.error()));

  auto off = off_with_model(file, *observed, *compared, document->model, *tool_m);
  v.observations = std::move(*observed);
  v.comparison = std::move(*compared);
  if (!file.source.name.empty()) v.inputs = {file.source};
  v.lines = std::move(file.lines);
  if (cut_short) v.cut_short = cut_short->text;

  v.cautions = cautions_of(*found);
  if (!different.empty()) v.cautions.push_back(std::move(different));
  return VerifyOutcome{std::move(*document), std::move(v), std::move(off), machine.machine};
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

void print_summary(const VerifyOutcome& outcome, const VerifyArguments& arguments) {
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

int run(const VerifyArguments& arguments) {
  std::optional<Error> cut_short;
  const auto outcome = compare(arguments, cut_short);
  if (!outcome) {
    const int code = report(outcome.error());
    return cut_short ? report(*cut_short) : code;
  }
  if (const auto written = write_outputs(arguments.out, *outcome); !written)
    return report(written.error());
  arguments.json ? print_json(*outcome) : print_summary(*outcome, arguments);
  if (cut_short) return report(*cut_short);
  const auto effect = verify::effect_at_points(outcome->verification.comparison);
  return number(effect == verify::Effect::Worse ? ExitCode::Worse : ExitCode::Done);
}

/// Several models at the same points.
int run_several(const VerifyArguments& arguments) {
  const auto models = models_named(arguments.models, arguments.store, arguments.tool);
  if (!models) return report(models.error());
  std::vector<OfMachine> machines;
  for (const NamedModel& model : *models) machines.push_back({model.name, model.machine});
  SeveralOptions options{.json = arguments.json};
  auto points = points_of(arguments, std::move(machines), options.different_machines);
  if (!points) return report(points.error());
  const auto observed = observed_in(arguments, points->file);
  if (!observed) return report(observed.error());

  const auto done = verify_several(*models, *observed, options);
  const int code = done ? *done : report(done.error());
  return points->cut_short ? report(*points->cut_short) : code;
}

/// The given option that has no effect with several models; empty: none. With --live, -o is the
/// folder of the collected points.
std::string only_for_one_model(const VerifyArguments& arguments) {
  if (arguments.models.size() < 2) return {};
  if (!arguments.out.empty() && !arguments.live) return "-o (report.html, grid.csv)";
  if (!arguments.origin.empty()) return "--origin-mm";
  if (!arguments.grid.empty()) return "--grid-mm";
  if (!arguments.planes.empty()) return "--planes-mm";
  return arguments.least_distance_mm ? "--least-distance-mm" : "";
}

void add_options(CLI::App& command, VerifyArguments& arguments) {
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
      "--live", arguments.live,
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
  auto arguments = std::make_shared<VerifyArguments>();
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
    const bool has_points =
        !arguments->points.empty() || !arguments->recording.empty() || arguments->live;
    if (!has_points)
      exit = report({ErrorCode::Usage, "verify: give --points, --recording or --live"});
    else if (arguments->live && arguments->out.empty())
      exit =
          report({ErrorCode::Usage, "verify --live: -o is required: the points are saved there"});
    else if (const std::string wrong = only_for_one_model(*arguments); !wrong.empty())
      exit =
          report({ErrorCode::Usage, fmt::format("verify: {} is for one model; give one", wrong)});
    else
      exit = arguments->models.size() > 1 ? run_several(*arguments) : run(*arguments);
  });
}

}  // namespace abbe::daemon
