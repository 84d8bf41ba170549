/// `abbe verify MODEL`: compares a model with independent measurements.

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "abbe/base/exit_codes.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/printable.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/units.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/effect_name.hpp"
#include "abbe/tasks/output_files.hpp"
#include "abbe/tasks/pdf_converter.hpp"
#include "abbe/tasks/verify.hpp"
#include "commands.hpp"
#include "daemon_socket.hpp"
#include "figures.hpp"
#include "identified_model.hpp"
#include "same_machine.hpp"
#include "store_option.hpp"
#include "terminal.hpp"
#include "verification_points.hpp"

namespace abbe::daemon {
namespace {

namespace verify = calib::verify;
using nlohmann::json;

struct VerifyCommand : VerifyArguments {
  std::string socket = DaemonSocket{}.socket;
  std::string pdf;
  bool live_points = false;
  std::size_t count = 0;
  bool json = false;
};

/// Sets up the option --live: the points are measured with the running daemon.
void measure_live(VerifyCommand& arguments) {
  if (!arguments.live_points) return;
  arguments.live = [&arguments](const KeepPoints& keep,
                                const AcceptMachine& accept) -> Result<LivePoints> {
    const auto socket = socket_path({arguments.socket, arguments.store.config});
    ABBE_TRY(socket);
    return points_of_daemon(*socket, arguments.count, keep, accept);
  };
}

constexpr VectorColumns kModels{.name = 32, .figure = 9};

const char* effect_of(const ModelAtPoints& one) {
  return effect_name(verify::effect_at_points(one.comparison));
}

json model_json(const ModelAtPoints& one) {
  return {{"model", model_id(one.model.document)},
          {"machine", one.model.machine},
          {"cautions", one.model.cautions},
          {"effect", effect_of(one)},
          {"before", vector_figures(one.comparison.before)},
          {"after", vector_figures(one.comparison.after)}};
}

json ratio_json(const verify::RatioStatistics& s) {
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

/// The JSON members that exist only for a single model.
json one_json(const Verification& v) {
  const auto& c = v.comparison();
  json object = model_json(v.models.front());
  object["inside"] = v.inside;
  object["turned_urad"] = {kUradPerRad * c.turned(3), kUradPerRad * c.turned(4),
                           kUradPerRad * c.turned(5)};
  object["interpolation_rms_um"] = kUmPerM * c.interpolation_rms_m;
  object["cut_short"] = v.cut_short;
  object["points_off"] = v.points_off;
  object["likely_mistakes"] = v.likely_mistakes;
  object["limits"] = json::array();
  for (const JudgedResidual& one : judged_residuals(v))
    object["limits"].push_back({{"residual", one.name},
                                {"value_um", one.value_um},
                                {"U_um", one.U_um},
                                {"limit_um", one.limit_um},
                                {"verdict", name(one.conformity)}});
  if (const auto why = why_no_ratio(c)) {
    object["R_not_given"] = *why;
  } else {
    object["R_turned"] = ratio_json(c.R_turned);
    object["R_stated"] = ratio_json(c.R_stated);
  }
  return object;
}

json several_json(const Verification& v) {
  json object{{"inside_all", v.inside},
              {"different_machines", v.different_machines},
              {"models", json::array()}};
  for (const ModelAtPoints& one : v.models) {
    object["models"].push_back(model_json(one));
    object["models"].back()["name"] = one.model.name;
  }
  return object;
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

void print_one(const Verification& v) {
  const auto& c = v.comparison();
  const auto& document = v.models.front().model.document;
  fmt::print("verdict     {}\n", verdict_text(c));
  for (const auto& line : v.likely_mistakes)
    fmt::print("mistake?    the points fit far better with {}\n", line);
  for (const auto& line : v.points_off) fmt::print("one point   {}\n", line);
  fmt::print("model       {}  (machine \"{}\", {})\n", model_id(document),
             printable_line(document.machine), document.method);
  for (const std::string& caution : v.models.front().model.cautions)
    fmt::print("caution     {}\n", printable_line(caution));
  const calib::Vector3 tool_mm = kMmPerM * v.models.front().tool_m;
  fmt::print("points      {}; {} of these places where the model is valid\n",
             shots_text(v.observations), v.inside);
  if (v.repeated > 0)
    fmt::print("            {} rows repeat another row in every digit: counted once\n", v.repeated);
  fmt::print(
      "tool        the points are taken as those of the tool offset ({:g} {:g} {:g}) mm "
      "(--tool-mm)\n",
      tool_mm.x(), tool_mm.y(), tool_mm.z());
  fmt::print(
      "left        {:.3f} um rms (largest {:.3f}) without compensation, {:.3f} um ({:.3f}) with "
      "the model\n",
      kUmPerM * c.before.rms_m, kUmPerM * c.before.max_m, kUmPerM * c.after.rms_m,
      kUmPerM * c.after.max_m);
  fmt::print("frame       {}; model turned by {:.1f}, {:.1f}, {:.1f} urad\n",
             v.observations.frame == verify::Frame::BestFit
                 ? "fitted to the readings: the best-fit rigid motion of V is not observable"
                 : "the machine's axes",
             kUradPerRad * c.turned(3), kUradPerRad * c.turned(4), kUradPerRad * c.turned(5));
  print_ratios(c);
  for (const JudgedResidual& one : judged_residuals(v))
    fmt::print("limit       {} {:.3f} um, U {:.2g} um, limit {:g} um: {}\n", one.name, one.value_um,
               one.U_um, one.limit_um, name(one.conformity));
}

void print_several(const Verification& v) {
  if (!v.different_machines.empty()) fmt::print("{}\n", v.different_machines);
  fmt::print("residual errors at {} of {} places, where all models are valid, um\n", v.inside,
             v.observations.shots.size());
  if (v.observations.repeatability_m) fmt::print("{}\n", shots_text(v.observations));
  fmt::print("{}  effect\n", vector_heading("model", kModels));
  fmt::print("{}  \n", vector_row("without a model", v.comparison().before, kModels));
  for (const ModelAtPoints& one : v.models)
    fmt::print("{}  {}\n",
               vector_row(printable_line(one.model.name), one.comparison.after, kModels),
               effect_of(one));
  for (const ModelAtPoints& one : v.models)
    for (const std::string& caution : one.model.cautions)
      fmt::print("{}: {}\n", printable_line(one.model.name), printable_line(caution));
}

json verification_json(const Verification& v) {
  json object = v.models.size() > 1 ? several_json(v) : one_json(v);
  object["points"] = v.observations.shot_count();
  object["places"] = v.observations.shots.size();
  object["repeated"] = v.repeated;
  object["repeatability_um"] = figure_or_null(kUmPerM, v.observations.repeatability_m);
  return object;
}

/// Writes report.html, grid.csv and the report as PDF, for a single model.
Result<void> write_outputs(const VerifyCommand& arguments, const Verification& v,
                           const Progress& progress) {
  if (v.models.size() > 1) return {};
  const std::string page = verification_report(v);
  if (!arguments.out.empty()) {
    const std::filesystem::path folder = arguments.out;
    ABBE_TRY(create_folder(folder));
    ABBE_TRY(replace_file(folder / "grid.csv", to_grid_csv(v.comparison())));
    ABBE_TRY(replace_file(folder / "report.html", page));
  }
  return arguments.pdf.empty() ? Result<void>{} : write_pdf(page, arguments.pdf, progress);
}

void print(const Verification& v, const VerifyCommand& arguments) {
  if (arguments.json) return fmt::print("{}\n", indented_json_text(verification_json(v)));
  v.models.size() > 1 ? print_several(v) : print_one(v);
  if (!arguments.out.empty() && v.models.size() == 1)
    fmt::print("written     {}, grid.csv\n",
               (std::filesystem::path(arguments.out) / "report.html").string());
}

/// Checks, before points are measured, that the PDF can be written.
Result<void> check_pdf(const VerifyCommand& arguments) {
  if (arguments.pdf.empty()) return {};
  if (arguments.models.size() > 1) return fail(ErrorCode::Usage, "--pdf is for one model");
  return daemon::check_pdf(std::filesystem::path(arguments.pdf));
}

int run(const VerifyCommand& arguments) {
  if (const auto possible = check_pdf(arguments); !possible) return report(possible.error());
  std::optional<Error> cut_short;
  ProgressBar bar;
  const auto found = verify_models(arguments, cut_short, bar.progress());
  bar.clear();
  if (!found) {
    const int code = report(found.error());
    return cut_short ? report(*cut_short) : code;
  }
  const auto written = write_outputs(arguments, *found, bar.progress());
  bar.clear();
  if (!written) return report(written.error());
  print(*found, arguments);
  if (cut_short) return report(*cut_short);
  const bool worse = std::ranges::any_of(found->models, [](const ModelAtPoints& one) {
    return verify::effect_at_points(one.comparison) == verify::Effect::Worse;
  });
  if (worse) return number(ExitCode::Worse);
  const bool failed = std::ranges::any_of(judged_residuals(*found), [](const JudgedResidual& one) {
    return one.conformity == Conformity::Fail;
  });
  return number(failed ? ExitCode::Refused : ExitCode::Done);
}

/// Adds the options for points that another program exported.
void add_export_options(CLI::App& command, VerifyCommand& arguments, CLI::Option* points) {
  command
      .add_option("--readings", arguments.readings,
                  "of exported points: name,x_mm,y_mm,z_mm, the scale readings of each point; "
                  "without name\nin the order of the points")
      ->needs(points);
  command
      .add_option("--points-unit", arguments.points_unit,
                  "of exported points: unit of their coordinates, if the file does not state it")
      ->check(CLI::IsMember({"mm", "m", "inch"}))
      ->needs(points);
}

void add_options(CLI::App& command, VerifyCommand& arguments) {
  command
      .add_option("MODEL", arguments.models,
                  std::string(kModelText) +
                      ";\nseveral: only the table of their residuals at the same points")
      ->required();
  add_store_options(command, arguments.store);
  auto* points = command.add_option(
      "--points", arguments.points,
      "verification.csv: x_mm,y_mm,z_mm,tracker_x_mm,tracker_y_mm,tracker_z_mm: scale reading and\n"
      "independent measurement of each point, each in its own frame; rows with the same reading\n"
      "(to 1 mm) are shots of one place; with [[thermal]] the readings must be corrected for the\n"
      "temperature of the scales. Or points that SpatialAnalyzer or PolyWorks exported as text, "
      "with\n--readings, --points-unit and --frame");
  add_export_options(command, arguments, points);
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
      .add_option_function<std::string>(
          "--frame",
          [&arguments](const std::string& frame) {
            arguments.frame = frame;
            arguments.frame_stated = true;
          },
          "fit: fit the tracker's frame to the readings; machine: its axes are the machine's axes")
      ->check(CLI::IsMember({"fit", "machine"}))
      ->default_str(arguments.frame);
  command.add_option("--tool-mm", arguments.tool,
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
  command.add_option("--details", arguments.details,
                     "certificate.toml: [verification] with date, instrument and limits, for the\n"
                     "report and a verdict of pass or fail (abbe example certificate.toml)");
  add_pdf_option(command, arguments.pdf);
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
      "mean. Exit code 8 if the errors are larger with the model (with one of several models), 5 "
      "if\n"
      "a residual is beyond a limit of --details. If the recording is damaged before its end, the\n"
      "result is printed and the exit code is 1.");
  add_options(*command, *arguments);

  command->callback([arguments, &exit] {
    measure_live(*arguments);
    exit = run(*arguments);
  });
}

}  // namespace abbe::daemon
