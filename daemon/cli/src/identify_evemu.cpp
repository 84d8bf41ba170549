#include <fmt/format.h>

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>
#include <CLI/Validators.hpp>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "abbe/base/input_file.hpp"
#include "abbe/base/json_text.hpp"
#include "abbe/base/units.hpp"
#include "abbe/calib/environment/thermal_expansion.hpp"
#include "abbe/calib/evemu/judge/judge.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/tasks/identify_evemu.hpp"
#include "commands.hpp"
#include "identified_model.hpp"
#include "scales_corrected.hpp"
#include "terminal.hpp"

namespace abbe::daemon {

namespace {

namespace evemu = calib::evemu;

struct IdentifyEvemuCommand : IdentifyEvemuArguments {
  std::string out, pdf;
  bool json = false;
};

/// A CSV table of the cross-validation error over lambda and gamma, from which both were chosen.
/// Cells that no solution path reached are left out.
std::string to_surface_csv(const evemu::SparseChoice& choice) {
  std::string text = "gamma,lambda,error_um2\n";
  constexpr double kUm2PerMm2 = 1e6;
  for (std::size_t g = 0; g < choice.all_gamma.size(); ++g)
    for (std::size_t l = 0; l < choice.all_lambda.size(); ++l) {
      const double error =
          choice.error_mm2(static_cast<Eigen::Index>(l), static_cast<Eigen::Index>(g)) * kUm2PerMm2;
      if (std::isfinite(error))
        text += fmt::format("{:.17g},{:.17g},{:.17g}\n", choice.all_gamma[g], choice.all_lambda[l],
                            error);
    }
  return text;
}

ResultFiles files_of(const EvemuOutcome& outcome) {
  const ModelDocument& document = outcome.document;
  ResultFiles files{{"coefficients.csv", to_coefficients_csv(*document.model.polynomials())}};
  if (const auto& choice = outcome.candidate.solution.sparse)
    files["cross_validation.csv"] = to_surface_csv(*choice);
  return files;
}

double u_rotation_urad(const evemu::Solution& solution) {
  return kUradPerRad * std::sqrt(solution.rotation.cov_rad2.trace() / 3.0);
}

nlohmann::json artefact_json(const evemu::ArtefactUncertainty& artefact) {
  const auto most = [](const auto& u) { return *std::ranges::max_element(u); };
  nlohmann::json object{{"u_ball_um", kUmPerM * most(artefact.u_ball_m)},
                        {"u_block_urad", kUradPerRad * most(artefact.u_block_rad)}};
  if (const auto& e = artefact.expansion)
    object.update({{"temperature_C", e->temperature_K - kZeroCelsius_K},
                   {"u_temperature_K", e->u_temperature_K},
                   {"expansion_factor", calib::expansion_factor(*e)},
                   {"u_expansion_factor", calib::u_expansion_factor(*e)}});
  return object;
}

std::string artefact_text(const evemu::ArtefactUncertainty& artefact) {
  const auto& e = artefact.expansion;
  return e ? fmt::format(", at {:.3f} C (u = {:.3f} K) expanded by {:.2f} um per m (u = {:.2f})",
                         e->temperature_K - kZeroCelsius_K, e->u_temperature_K,
                         kUmPerM * (calib::expansion_factor(*e) - 1.0),
                         kUmPerM * calib::u_expansion_factor(*e))
           : ", temperature not known: taken as 20 C";
}

void print_json(const EvemuOutcome& outcome, const std::filesystem::path& folder) {
  const ModelDocument& document = outcome.document;
  const auto& s = outcome.candidate.solution.statistics;
  const auto& held_out = outcome.candidate.verdict.held_out;
  nlohmann::json object{{"model", (folder / "model.json").string()},
                        {"id", model_id(document)},
                        {"hash", model_hash(document)},
                        {"estimator", document.estimator},
                        {"covariance", evemu::name(outcome.candidate.solution.covariance)},
                        {"positions", s.positions},
                        {"balls", s.balls},
                        {"observations", s.observations},
                        {"unknowns", s.unknowns},
                        {"rank", s.rank},
                        {"condition", s.condition},
                        {"effective_parameters", s.effective_parameters},
                        {"noise_um", s.s_m * kUmPerM},
                        {"pose_rotation_urad", s.w_rad * kUradPerRad},
                        {"u_mean_rotation_urad", u_rotation_urad(outcome.candidate.solution)},
                        {"shape_only", !outcome.candidate.solution.rotation.referenced},
                        {"residual_rms_before_um", s.before.rms_m * kUmPerM},
                        {"residual_rms_after_um", s.after.rms_m * kUmPerM},
                        {"held_out_rms_before_um", held_out.no_compensation_rms_m * kUmPerM},
                        {"held_out_rms_after_um", held_out.candidate_rms_m * kUmPerM},
                        {"gate", verdict_json(outcome.candidate.verdict)}};

  if (const auto& artefact = outcome.candidate.solution.artefact)
    object["artefact"] = artefact_json(*artefact);
  if (const auto& choice = outcome.candidate.solution.sparse)
    object["chosen"] = {{"lambda", choice->lambda.back()}, {"gamma", choice->gamma}};
  fmt::print("{}\n", indented_json_text(object));
}

void print_summary(const EvemuOutcome& outcome, const std::filesystem::path& folder) {
  const ModelDocument& document = outcome.document;
  const auto& s = outcome.candidate.solution.statistics;
  fmt::print("model       {}  ({} coefficients, tool and machine \"{}\")\n", model_id(document),
             s.unknowns, document.machine);
  fmt::print("artefact    {} positions, {} ball centres{}\n", s.positions, s.balls,
             outcome.candidate.solution.artefact
                 ? artefact_text(*outcome.candidate.solution.artefact)
                 : "");
  fmt::print(
      "solution    {}: {} observations, rank {} of {}, condition {:.3g}, {:.1f} effective "
      "parameters\n",
      document.estimator, s.observations, s.rank, s.unknowns, s.condition, s.effective_parameters);
  fmt::print("noise       {:.2f} um per ball coordinate, {:.1f} urad per position\n",
             s.s_m * kUmPerM, s.w_rad * kUradPerRad);

  if (const auto& choice = outcome.candidate.solution.sparse)
    fmt::print("chosen      lambda {:.3g}, gamma {:.3g}{}\n", choice->lambda.back(), choice->gamma,
               choice->curvature < 0.0 ? "; not convex there: other solutions may be close" : "");
  fmt::print("residuals   {:.3f} um rms before, {:.3f} um after\n", s.before.rms_m * kUmPerM,
             s.after.rms_m * kUmPerM);
  fmt::print("rotation    {}, u = {:.1f} urad about Ball1\n",
             outcome.candidate.solution.rotation.referenced ? "referenced"
                                                            : "that of the blocks: shape only",
             u_rotation_urad(outcome.candidate.solution));
  print_verdict(outcome.candidate.verdict);
  fmt::print("written     {}, coefficients.csv, report.html\n", (folder / "model.json").string());
}

int run(const IdentifyEvemuCommand& arguments) {
  ProgressBar bar;
  const auto outcome = identify_evemu(arguments, bar.progress());
  bar.clear();
  if (!outcome) return report(outcome.error());
  const calib::Verdict& verdict = outcome->candidate.verdict;
  if (const auto done =
          write_and_keep({arguments.out, arguments.keep, "abbe identify evemu", arguments.pdf},
                         outcome->document, verdict, files_of(*outcome), bar.progress());
      !done) {
    bar.clear();
    return report(done.error());
  }
  bar.clear();
  arguments.json ? print_json(*outcome, arguments.out) : print_summary(*outcome, arguments.out);

  return exit_code(verdict);
}

void add_options(CLI::App& command, IdentifyEvemuCommand& arguments) {
  EvemuInputArguments& input = arguments.input;
  auto* machine =
      command.add_option("--machine", input.machine, "machine.toml or the daemon's abbed.toml");
  auto* touches =
      command.add_option("--touches", input.touches,
                         "touches.csv: position,kind,index,x_mm,y_mm,z_mm; kind ball or block");
  auto* calibrator = command.add_option("--calibrator", input.calibrator, "calibrator.toml");
  auto* errors = command.add_option("--errors", input.errors,
                                    "instead of touches, errors.csv: "
                                    "position,ball,x_mm,y_mm,z_mm,ex_um,ey_um,ez_um");
  auto* recording = command.add_option("--recording", input.recording,
                                       "instead of files, a recording of the daemon (.mcap): its "
                                       "last complete run with a ball array,\n"
                                       "with the recorded configuration unless --machine is given");
  touches->needs(machine, calibrator);
  calibrator->needs(touches);
  auto* artefact_C =
      command.add_option("--artefact-C", input.artefact_C,
                         "temperature of the array, C, for a calibrator.toml with alpha_um_per_m_K;"
                         "\ndefault: [evemu] artefact_C");
  auto* u_artefact_K = command.add_option("--u-artefact-K", input.u_artefact_K,
                                          "standard uncertainty of --artefact-C, K");
  artefact_C->needs(calibrator, u_artefact_K)->check(CLI::Range(-50.0, 100.0));
  u_artefact_K->needs(artefact_C)->check(CLI::Range(0.0, 50.0));
  errors->needs(machine)->excludes(touches);
  recording->excludes(touches)->excludes(errors);
  recording->excludes(add_scales_corrected(command, input.scales_corrected));
  command
      .add_option("--estimator", arguments.estimator,
                  "bayes-pose: priors by order, common noise of Ball1, random pose rotations;\n"
                  "ols: least squares; ridge: one prior for all coefficients;\n"
                  "lasso, mcp, scad: penalised, chosen by cross-validation over 50 x 100 values;\n"
                  "default: that of [evemu], or bayes-pose")
      ->check(CLI::IsMember({"bayes-pose", "ols", "ridge", "lasso", "mcp", "scad"}));
  command.add_option(
      "--folds", arguments.folds,
      "what lasso, mcp and scad hold out together: position, ball, row (as published, but rows\n"
      "have common noise), or a file with one fold number per row; default: that of [evemu], or\n"
      "position");
  command
      .add_option("--order", input.order,
                  "order of the polynomials; default: that of [evemu], or 3")
      ->check(CLI::Range(calib::kLeastOrder, calib::kMostOrder));
  command
      .add_option("--positions", input.positions,
                  "required number of artefact positions; default: the requested ones, or 8")
      ->check(CLI::Range(2, 1000));
  command
      .add_flag("--rotation-known", input.rotation_known,
                "the directions of the errors do not come from the artefact's blocks")
      ->needs(errors);
  auto* reference = command.add_option(
      "--rotation-reference", input.rotation_reference,
      "errors.csv of points where V is known independently: the model is rotated to fit them;\n"
      "needs --u-reference-um");
  auto* u_reference = command
                          .add_option("--u-reference-um", input.u_reference_um,
                                      "standard uncertainty of the reference's V")
                          ->check(CLI::PositiveNumber);
  reference->needs(u_reference);
  u_reference->needs(reference);
  command.add_flag(
      "--accept-shape-only", arguments.accept_shape_only,
      "do not refuse the model because its rotation about Ball1 is unknown; as [gate] accept =\n"
      "[\"evemu-shape-only\"]");
  add_accept_option(command, arguments.accept);
  add_result_options(command, {arguments.keep, arguments.json, arguments.out, arguments.pdf});
}

}  // namespace

void add_identify_evemu(CLI::App& parent, int& exit) {
  auto arguments = std::make_shared<IdentifyEvemuCommand>();
  auto* command =
      parent.add_subcommand("evemu",
                            "Identify a model from a ball array touched in several positions.\n"
                            "Writes model.json, coefficients.csv and report.html to OUT and prints "
                            "how well the model predicts\n"
                            "positions that were not used in the fit. Exit code 5 if the gate "
                            "would refuse the model; the files\n"
                            "are written in any case.");
  add_options(*command, *arguments);

  command->callback([arguments, &exit] { exit = run(*arguments); });
}

}  // namespace abbe::daemon
