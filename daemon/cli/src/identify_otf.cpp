#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "abbe/base/json_text.hpp"
#include "abbe/base/units.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tasks/encoder_clock.hpp"
#include "abbe/tasks/identify_otf.hpp"
#include "backlash_lines.hpp"
#include "commands.hpp"
#include "earlier_words.hpp"
#include "identified_model.hpp"
#include "scales_corrected.hpp"
#include "terminal.hpp"
#include "tracker_drift_lines.hpp"

namespace abbe::daemon {

namespace otf = calib::otf;

namespace {

struct IdentifyOtfCommand : IdentifyOtfArguments {
  std::string out, pdf;
  bool json = false;
};

/// Adds the offsets of the ranges: for one run two numbers; for several runs two arrays, in the
/// order of the runs.
void add_range_offsets(nlohmann::json& object, const std::vector<otf::RangeOffset>& offsets) {
  nlohmann::json values = nlohmann::json::array(), us = nlohmann::json::array();
  for (const otf::RangeOffset& offset : offsets) {
    values.push_back(offset.value_m * kUmPerM);
    us.push_back(offset.u_m * kUmPerM);
  }
  const bool several = offsets.size() > 1;
  object["range_offset_um"] = several ? values : values.front();
  object["u_range_offset_um"] = several ? us : us.front();
}

void print_json(const OtfOutcome& outcome, const IdentifyOtfCommand& arguments) {
  const auto& s = outcome.document.statistics;
  const std::filesystem::path folder = arguments.out;
  nlohmann::json object{
      {"model", (folder / "model.json").string()},
      {"id", model_id(outcome.document)},
      {"hash", model_hash(outcome.document)},
      {"mode", outcome.document.mode},
      {"estimator", outcome.document.estimator},
      {"tables", calib::name(*outcome.document.model.interpolation())},
      {"samples", s.samples},
      {"lost_samples", s.lost_samples},
      {"segments", outcome.segments},
      {"segments_used", outcome.segments_used},
      {"observations", s.observations},
      {"unknowns", s.unknowns},
      {"rank", s.rank},
      {"condition", s.condition},
      {"sigma0", s.sigma0},
      {"variance_factor", s.variance_factor},
      {"residual_rms_before_um", s.before.rms_m * kUmPerM},
      {"residual_rms_after_um", s.after.rms_m * kUmPerM},
      {"held_out_rms_before_um", outcome.verdict.held_out.no_compensation_rms_m * kUmPerM},
      {"held_out_rms_after_um", outcome.verdict.held_out.candidate_rms_m * kUmPerM},
      {"gate", verdict_json(outcome.verdict)}};
  add_range_offsets(object, outcome.range_offsets);
  if (const auto& prior = outcome.smoothness)
    object["smoothness"] = {
        {"bend_um",
         {prior->bend_m[0] * kUmPerM, prior->bend_m[1] * kUmPerM, prior->bend_m[2] * kUmPerM}},
        {"chi2", prior->chi2},
        {"expected_chi2", prior->expected_chi2},
        {"bends", prior->rows},
        {"left_out", prior->left_out()}};
  if (!outcome.document.backlash.empty())
    object["backlash"] = backlash_json(outcome.document.backlash);
  if (outcome.document.tracker_drift)
    object["tracker_drift"] = tracker_drift_json(*outcome.document.tracker_drift);
  if (outcome.synchronisation)
    object["clocks"] = clock_json(*outcome.synchronisation, arguments.encoder_u_time_us);
  fmt::print("{}\n", indented_json_text(object));
}

void print_summary(const OtfOutcome& outcome, const IdentifyOtfCommand& arguments) {
  const auto& s = outcome.document.statistics;
  const std::filesystem::path folder = arguments.out;
  fmt::print("model       {}  ({} {} tables, tool and machine \"{}\")\n",
             model_id(outcome.document), outcome.document.model.tables()->layout().tables().size(),
             calib::name(*outcome.document.model.interpolation()), outcome.document.machine);
  const bool stands = outcome.document.mode == otf::name(otf::Mode::Standstill);
  fmt::print("samples     {}, {} lost; {} of {} {} used\n", s.samples, s.lost_samples,
             outcome.segments_used, outcome.segments, stands ? "standstills" : "segments");
  fmt::print(
      "solution    {}: {} observations, {} unknowns, rank {}, condition {:.3g}, sigma0 {:.3f}\n",
      outcome.document.estimator, s.observations, s.unknowns, s.rank, s.condition, s.sigma0);
  fmt::print("residuals   {:.3f} um rms before, {:.3f} um after\n", s.before.rms_m * kUmPerM,
             s.after.rms_m * kUmPerM);

  for (std::size_t run = 0; run < outcome.range_offsets.size(); ++run)
    if (const auto& offset = outcome.range_offsets[run]; offset.u_m > 0.0)
      fmt::print("ranges      offset {:.3f} um, standard uncertainty {:.3f} um{}\n",
                 offset.value_m * kUmPerM, offset.u_m * kUmPerM,
                 outcome.range_offsets.size() > 1 ? fmt::format(" (run {})", run + 1) : "");
  if (const auto& prior = outcome.smoothness)
    fmt::print("smoothness  prior {}: chi-square {:.1f}, expected {:.1f}; left out: {}\n",
               otf::size_text(*prior), prior->chi2, prior->expected_chi2, prior->left_out());
  print_backlash(outcome.document.backlash);
  if (outcome.document.tracker_drift)
    fmt::print("{}", tracker_drift_text(*outcome.document.tracker_drift));
  if (outcome.synchronisation)
    fmt::print("{}", clock_text(*outcome.synchronisation, arguments.encoder_u_time_us));
  print_verdict(outcome.verdict);
  fmt::print("written     {}, tables.csv, report.html\n", (folder / "model.json").string());
}

int run(const IdentifyOtfCommand& arguments) {
  ProgressBar bar;
  const auto outcome = identify_otf_from(arguments, bar.progress());
  bar.clear();
  if (!outcome) return report(outcome.error());
  const ModelDocument& document = outcome->document;
  if (const auto done = write_and_keep(
          {arguments.out, arguments.keep, "abbe identify otf", arguments.pdf}, document,
          outcome->verdict, {{"tables.csv", to_tables_csv(document.model, document.backlash)}},
          bar.progress());
      !done) {
    bar.clear();
    return report(done.error());
  }
  bar.clear();
  arguments.json ? print_json(*outcome, arguments) : print_summary(*outcome, arguments);
  return exit_code(outcome->verdict);
}

/// Adds the options for information that files of other programs do not contain.
void add_foreign_options(CLI::App& command, IdentifyOtfArguments& arguments, CLI::Option* encoder) {
  command
      .add_option("--tracker-unit", arguments.tracker_unit,
                  "of exported points: unit of their coordinates, if the file does not state it")
      ->check(CLI::IsMember({"mm", "m", "inch"}));
  command
      .add_option("--tracker-points-per-s", arguments.tracker_points_per_s,
                  "of exported points without times, or with times of whole seconds: they were "
                  "measured at\nthis rate, and none is missing")
      ->check(CLI::Range(0.1, 1e6));
  command
      .add_option("--encoder-pv", arguments.encoder_pvs,
                  "of a log of camonitor, three times: X=NAME, Y=NAME, Z=NAME, the process "
                  "variables of the\nscale readings")
      ->allow_extra_args(false)
      ->needs(encoder);
  command
      .add_option("--encoder-unit", arguments.encoder_unit,
                  "of a log of camonitor: unit of the values")
      ->check(CLI::IsMember({"um", "mm", "m", "inch"}))
      ->needs(encoder);
}

}  // namespace

void add_identify_otf(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<IdentifyOtfCommand>();
  auto* command = parent.add_subcommand(
      "otf",
      "Identify a model from laser tracker points measured along a path, on the fly or, with\n"
      "--mode standstill, where the machine stood still at each vertex.\n"
      "Writes model.json, tables.csv and report.html to OUT and prints how well the model\n"
      "predicts legs that were not used in the fit. Exit code 5 if the gate would refuse the\n"
      "model, also if the recording is damaged before its end; the files are written in any case.");
  auto* machine = command->add_option("--machine", arguments->machine,
                                      "machine.toml or the daemon's abbed.toml");
  auto* path = command->add_option("--path", arguments->path,
                                   "path.csv: x_mm,y_mm,z_mm, the vertices of the driven path");
  auto* tracker = command->add_option(
      "--tracker", arguments->tracker,
      "tracker.csv: time_s,range_mm,azimuth_rad,elevation_rad[,status]\n"
      "or time_s,tracker_x_mm,tracker_y_mm,tracker_z_mm[,status], in the frame of "
      "the tracker,\n"
      "or time_s,x_mm,y_mm,z_mm[,status] in another frame, with "
      "--tracker-centre-mm;\n"
      "or points that SpatialAnalyzer or PolyWorks exported as text, with --tracker-unit and\n"
      "--tracker-centre-mm");
  auto* centre = command->add_option(
      "--tracker-centre-mm", arguments->tracker_centres,
      "X,Y,Z: the tracker in the frame of points x_mm,y_mm,z_mm, such as machine or station\n"
      "coordinates, to about 0.1 m: noise and offset of the ranges act along its beams; with "
      "several\n--target-mm, one for all or one for each");
  centre->allow_extra_args(false);
  auto* encoder = command->add_option(
      "--encoder", arguments->encoder,
      "encoder.csv: time_s,x_mm,y_mm,z_mm, scale readings along the path with times of the\n"
      "machine's clock; compared with the vertices of the path, to [gate] path_tolerance_mm where\n"
      "the machine stands still. On the fly they add the component along the path: offset and "
      "drift\nof the clocks are estimated. Readings of another drive, or with useless times, are "
      "not used\nfor it, and the verdict states why. Or a log of EPICS camonitor, with "
      "--encoder-pv "
      "and\n--encoder-unit");
  auto* u_time = command->add_option(
      "--encoder-u-time-us", arguments->encoder_u_time_us,
      "standard uncertainty of the time of one reading, us; larger residuals give the readings "
      "less\nweight; a trigger line needs about 10 or less");
  u_time->needs(encoder)->check(CLI::Range(0.001, 1e6))->capture_default_str();
  add_foreign_options(*command, *arguments, encoder);
  auto* recording = command->add_option(
      "--recording", arguments->recording,
      "instead of path and tracker, a recording of the daemon (.mcap): its last complete run,\n"
      "with the recorded configuration unless --machine is given");
  auto* u_scale =
      command
          ->add_option("--u-scale-ppm", arguments->u_scale_ppm,
                       "relative standard uncertainty common to all ranges (refractive index of "
                       "air), ppm: 0.2 for 0.2 K and 30 Pa; default: that of " +
                           tables_with(Capability::TrackerPoints) + ", or 0")
          ->check(CLI::NonNegativeNumber);
  auto* corrected = add_scales_corrected(*command, arguments->scales_corrected);
  auto* orientation =
      command->add_flag("--accept-path-orientation", arguments->accept_path_orientation,
                        "do not refuse the model because the path might be rotated by 180 degrees "
                        "(two signs\nreversed); as [gate] accept = [\"path-orientation\"]");
  recording->excludes(centre)->excludes(u_scale)->excludes(corrected)->excludes(orientation);
  auto* targets = command->add_option(
      "--target-mm", arguments->targets,
      "instead of --tracker, three times or more: X,Y,Z=FILE, target offset in mm and tracker.csv "
      "of\na run of the path with it. Offsets that are not on a line give all 18 tables, valid for "
      "any\ntool; the tracker may stand elsewhere in each run (position_mm of the tracker is that "
      "of the first)");
  targets->allow_extra_args(false)
      ->needs(machine, path)
      ->excludes(tracker)
      ->excludes(recording)
      ->excludes(encoder);
  path->needs(machine);
  tracker->needs(path);
  encoder->needs(path);
  auto* mode =
      command
          ->add_option("--mode", arguments->mode,
                       "on-the-fly: components across the path, during the motion;\n"
                       "standstill: the machine stops at every vertex for 0.3 s or longer, "
                       "all three\ncomponents; default: [otf] mode, or on-the-fly")
          ->check(CLI::IsMember({"on-the-fly", "standstill"}));
  recording->excludes(path)->excludes(tracker)->excludes(encoder)->excludes(mode);
  command
      ->add_option("--estimator", arguments->estimator,
                   "simultaneous: alignment and errors together, by Gauss-Newton;\n"
                   "two-step: align, then adjust, as published;\n"
                   "default: that of [otf], or simultaneous")
      ->transform(estimator_word, "")
      ->check(CLI::IsMember({"two-step", "simultaneous"}));
  command
      ->add_option("--tables", arguments->tables,
                   "interpolation of the tables between their nodes: linear, or for smooth errors\n"
                   "cubic (natural) or not-a-knot-cubic; default: [model] basis, or linear")
      ->check(CLI::IsMember({calib::kLinearBasis, calib::kCubicBasis, calib::kNotAKnotCubicBasis}));
  command
      ->add_flag("--backlash{per-table}", arguments->backlash,
                 "also estimate the backlash of every table; --backlash=forward-backward: the\n"
                 "difference between both directions of travel at every node. The tables are the\n"
                 "mean of both directions; default: [otf] backlash, or none")
      ->check(CLI::IsMember({"none", "per-table", "forward-backward"}));
  command->add_option(
      "--smoothness-um", arguments->smoothness,
      "prior for smooth tables: none; or UM or X,Y,Z: standard deviation, in um, of the bend of\n"
      "a table over three nodes 50 mm apart (second difference; twice as many urad for angles).\n"
      "Tables rougher than the prior are named and computed without it; default: that of [otf], or "
      "none");
  command
      ->add_option(
          "--segment-samples", arguments->segment_samples,
          "samples averaged in a segment (on-the-fly); default: segments of 8.3 mm of travel")
      ->check(CLI::Range(1, 1000));
  add_accept_option(*command, arguments->accept);
  add_result_options(*command, {arguments->keep, arguments->json, arguments->out, arguments->pdf});

  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon
