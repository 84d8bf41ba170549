#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <system_error>

#include "abbe/calib/otf/identify.hpp"
#include "abbe/daemon/input_files.hpp"
#include "abbe/daemon/model_document.hpp"
#include "abbe/daemon/otf_inputs.hpp"
#include "abbe/daemon/sha256.hpp"
#include "cli/commands.hpp"
#include "cli/terminal.hpp"
#include "files/text_file.hpp"

namespace abbe::daemon {

namespace {

namespace otf = calib::otf;

struct Arguments {
  std::string machine, path, tracker, out;
  std::string estimator = "two-step";
  std::size_t block_samples = 0;  // 0: by travel
  bool json = false;
};

struct Inputs {
  Config config;
  PathFile path;
  TrackerFile tracker;
  std::vector<InputFile> sources;
};

struct Outcome {
  ModelDocument document;
  calib::Verdict verdict;
  std::size_t blocks_used = 0;
  std::size_t block_samples = 0;
};

Result<Inputs> read_inputs(const Arguments& arguments, ProgressBar& bar) {
  auto config = load_config(arguments.machine);
  if (!config) return tl::make_unexpected(config.error());
  const auto hash = sha256_hex_of_file(arguments.machine);
  if (!hash) return tl::make_unexpected(hash.error());
  auto path = read_path_csv(arguments.path);
  if (!path) return tl::make_unexpected(path.error());
  auto tracker = read_tracker_csv(arguments.tracker,
                                  [&](double fraction) { bar.show("reading the tracker", fraction); });
  if (!tracker) return tl::make_unexpected(tracker.error());
  std::vector<InputFile> sources{
      {std::filesystem::path(arguments.machine).filename().string(), *hash}, path->source, tracker->source};
  return Inputs{std::move(*config), std::move(*path), std::move(*tracker), std::move(sources)};
}

std::string_view words(otf::Stage stage) {
  switch (stage) {
    case otf::Stage::Observe:
      return "averaging blocks";
    case otf::Stage::Align:
      return "aligning";
    case otf::Stage::Solve:
      return "solving";
    case otf::Stage::Judge:
      return "judging";
  }
  return "";
}

Result<Outcome> identify(const Inputs& inputs, const Arguments& arguments, ProgressBar& bar) {
  const auto machine = otf_machine(inputs.config.machine);
  if (!machine) return tl::make_unexpected(machine.error());
  otf::Options options = otf_options(inputs.tracker.points, inputs.config.gate);
  if (arguments.block_samples > 0) options.block_samples = arguments.block_samples;
  options.progress = [&](otf::Stage stage, double fraction) { bar.show(words(stage), fraction); };
  const auto found = otf::identify(inputs.tracker.points, *machine, otf_path(inputs.path.vertices_m),
                                   otf_noise(inputs.config.machine), options);
  if (!found) return tl::make_unexpected(error_of(found.error()));
  auto verdict =
      otf::judge(found->observations, found->solution, nullptr, gate_limits(inputs.config.gate), options);
  if (!verdict) return tl::make_unexpected(error_of(verdict.error()));
  const auto now = std::chrono::time_point_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now());
  return Outcome{otf_document(found->solution, inputs.config, inputs.sources, now), std::move(*verdict),
                 found->observations.blocks_used, options.block_samples};
}

Result<void> write_outputs(const std::filesystem::path& folder, const ModelDocument& document) {
  std::error_code failed;
  std::filesystem::create_directories(folder, failed);
  if (failed) return fail(ErrorCode::Io, fmt::format("create {}: {}", folder.string(), failed.message()));
  if (auto done = replace_file(folder / "model.json", to_json(document)); !done) return done;
  return replace_file(folder / "tables.csv", to_tables_csv(document.model));
}

constexpr double kMicro = 1e6;

void print_json(const Outcome& outcome, const std::filesystem::path& folder) {
  const auto& s = outcome.document.statistics;
  const nlohmann::json object{
      {"model", (folder / "model.json").string()},
      {"id", model_id(outcome.document.model, outcome.document.method)},
      {"hash", model_hash(outcome.document.model, outcome.document.method)},
      {"samples", s.samples},
      {"lost_samples", s.lost_samples},
      {"block_samples", outcome.block_samples},
      {"blocks_used", outcome.blocks_used},
      {"observations", s.observations},
      {"unknowns", s.unknowns},
      {"rank", s.rank},
      {"condition", s.condition},
      {"sigma0", s.sigma0},
      {"covariance_factor", s.covariance_factor},
      {"residual_rms_before_um", s.before.rms_m * kMicro},
      {"residual_rms_after_um", s.after.rms_m * kMicro},
      {"held_out_rms_before_um", outcome.verdict.held_out.no_compensation_rms_m * kMicro},
      {"held_out_rms_after_um", outcome.verdict.held_out.candidate_rms_m * kMicro},
      {"gate", {{"accepted", outcome.verdict.accepted}, {"reasons", outcome.verdict.reasons}}}};
  fmt::print("{}\n", object.dump(1));
}

void print_summary(const Outcome& outcome, const std::filesystem::path& folder) {
  constexpr int kGreen = 2, kYellow = 3, kStdout = 1;
  const auto& s = outcome.document.statistics;
  const auto& held_out = outcome.verdict.held_out;
  fmt::print("model       {}  ({} tables, tool and machine \"{}\")\n",
             model_id(outcome.document.model, outcome.document.method),
             outcome.document.model.layout().tables().size(), outcome.document.machine);
  fmt::print("samples     {}, {} lost; {} blocks of {} used\n", s.samples, s.lost_samples,
             outcome.blocks_used, outcome.block_samples);
  fmt::print("solution    {} observations, {} unknowns, rank {}, condition {:.3g}, sigma0 {:.3f}\n",
             s.observations, s.unknowns, s.rank, s.condition, s.sigma0);
  fmt::print("residuals   {:.3f} um rms before, {:.3f} um after\n", s.before.rms_m * kMicro,
             s.after.rms_m * kMicro);
  fmt::print("held out    {:.3f} um rms without compensation, {:.3f} um with the model\n",
             held_out.no_compensation_rms_m * kMicro, held_out.candidate_rms_m * kMicro);
  fmt::print("gate        {}\n", outcome.verdict.accepted ? coloured("would accept", kGreen, kStdout)
                                                          : coloured("would refuse", kYellow, kStdout));
  for (const auto& reason : outcome.verdict.reasons) fmt::print("            {}\n", reason);
  fmt::print("written     {}, tables.csv\n", (folder / "model.json").string());
}

int run(const Arguments& arguments) {
  ProgressBar bar;
  const auto inputs = read_inputs(arguments, bar);
  if (!inputs) return bar.clear(), report(inputs.error());
  const auto outcome = identify(*inputs, arguments, bar);
  bar.clear();
  if (!outcome) return report(outcome.error());
  if (const auto written = write_outputs(arguments.out, outcome->document); !written)
    return report(written.error());
  arguments.json ? print_json(*outcome, arguments.out) : print_summary(*outcome, arguments.out);
  return 0;
}

}  // namespace

void add_identify_otf(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<Arguments>();
  auto* command = parent.add_subcommand("otf",
                                        "From laser tracker points taken on the fly along a path.\n"
                                        "Writes model.json and tables.csv to OUT and says how well the model "
                                        "predicts legs it was not fitted to.");
  command->add_option("--machine", arguments->machine, "machine.toml, or the daemon's abbed.toml")
      ->required();
  command->add_option("--path", arguments->path, "path.csv: x_mm,y_mm,z_mm, the vertices that were driven")
      ->required();
  command
      ->add_option("--tracker", arguments->tracker,
                   "tracker.csv: time_s,range_mm,azimuth_rad,elevation_rad[,status]\nor "
                   "time_s,x_mm,y_mm,z_mm[,status]")
      ->required();
  command->add_option("--estimator", arguments->estimator, "two-step: align, then adjust")
      ->check(CLI::IsMember({"two-step"}))
      ->capture_default_str();
  command
      ->add_option("--block-samples", arguments->block_samples,
                   "samples per block mean; default: 8.3 mm of travel")
      ->check(CLI::Range(10, 1000));
  command->add_flag("--json", arguments->json, "the summary as one JSON object");
  command->add_option("-o,--out", arguments->out, "folder for the results; created if needed")->required();
  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon
