#include "abbe/tasks/identify_evemu.hpp"

#include <fmt/format.h>

#include <chrono>
#include <filesystem>
#include <utility>

#include "abbe/base/sha256.hpp"
#include "abbe/base/text_file.hpp"
#include "abbe/base/wall_clock.hpp"
#include "abbe/methods/calibration_run.hpp"
#include "abbe/methods/evemu/document.hpp"
#include "abbe/result/try.hpp"
#include "abbe/tasks/accepted_reasons.hpp"
#include "abbe/tasks/identified_model.hpp"
#include "argument_checks.hpp"

namespace abbe::daemon {
namespace {

namespace evemu = calib::evemu;

/// The options for the division into folds. `given` is a keyword, or a file with one fold number
/// for each of the 3 rows of every ball, in the order of position and ball.
Result<evemu::SparseOptions> sparse_options(const std::string& given,
                                            std::vector<InputFile>& sources) {
  evemu::SparseOptions options;
  if (const auto by = evemu::folds_by(given)) {
    options.folds = *by;
    return options;
  }
  const auto text = read_text(given);
  ABBE_TRY(text);
  auto folds = calib::sparse::parse_folds(*text);
  if (!folds) return fail(ErrorCode::BadInput, fmt::format("{}: {}", given, folds.error().text));
  sources.push_back({std::filesystem::path(given).filename().string(), sha256_hex(*text)});
  options.given_folds = std::move(*folds);
  return options;
}

Result<evemu::JudgeOptions> judge_options(const IdentifyEvemuArguments& arguments,
                                          EvemuInput& input) {
  const Config& config = input.config;
  evemu::JudgeOptions options = evemu_judge_options(config);
  if (arguments.estimator)
    options.solve.estimator =
        evemu::estimator(*arguments.estimator).value_or(options.solve.estimator);
  if (arguments.accept_shape_only) options.accept_shape_only = true;
  auto sparse = sparse_options(arguments.folds.value_or(config.evemu.folds), input.sources);
  ABBE_TRY(sparse);
  options.solve.sparse = std::move(*sparse);
  return options;
}

Result<void> check(const IdentifyEvemuArguments& arguments) {
  const EvemuInputArguments& input = arguments.input;
  ABBE_TRY(require_word("--estimator", arguments.estimator.value_or(""),
                        {"bayes-pose", "ols", "ridge", "lasso", "mcp", "scad"}));
  if (input.artefact_C.has_value() != input.u_artefact_K.has_value())
    return fail(ErrorCode::Usage,
                "--artefact-C and --u-artefact-K: give both, or neither: a temperature has an "
                "uncertainty");
  if (!input.recording.empty())
    return require_none("--recording", {{"--touches", !input.touches.empty()},
                                        {"--errors", !input.errors.empty()},
                                        {"--scales-corrected", input.scales_corrected}});
  if (input.touches.empty() && input.errors.empty())
    return fail(ErrorCode::Usage,
                "identify evemu needs --machine with --touches and --calibrator or "
                "with --errors, or --recording");
  ABBE_TRY(require_all("identify evemu", {{"--machine", !input.machine.empty()}}));
  if (input.touches.empty()) return {};
  ABBE_TRY(require_none("--touches", {{"--errors", !input.errors.empty()}}));
  return require_all("--touches", {{"--calibrator", !input.calibrator.empty()}});
}

}  // namespace

Result<EvemuOutcome> identify_evemu(const IdentifyEvemuArguments& arguments,
                                    const Progress& progress) {
  ABBE_TRY(check(arguments));
  const auto active = active_model(arguments.keep);
  ABBE_TRY(active);
  auto input = read_evemu_input(arguments.input, progress);
  ABBE_TRY(input);
  ABBE_TRY(accept_also(arguments.accept, input->config));
  auto judging = judge_options(arguments, *input);
  ABBE_TRY(judging);
  ABBE_TRY(read_rotation_reference(arguments.input, *input));

  const auto other = comparison_model(*active, input->config);
  auto candidate = identify_with_array(
      {std::move(input->observations), *std::move(judging), std::move(input->rotation_reference)},
      other.model);
  ABBE_TRY(candidate);
  calib::Verdict& verdict = candidate->verdict;
  other.add_note(verdict);
  input->judge_source(verdict);
  if (const auto missing = missing_array_sensor(arguments.input, input->config); !missing.empty())
    verdict.notes.push_back(fmt::format(
        "the temperature of the array is not known: {}; give it with --artefact-C", missing));

  auto document = evemu_document(*candidate, input->config, std::move(input->sources), utc_now());
  document.recording_gap = std::move(input->recording_gap);
  add_measured(document, input->observed, input->utc);
  return EvemuOutcome{*std::move(candidate), std::move(document)};
}

}  // namespace abbe::daemon
