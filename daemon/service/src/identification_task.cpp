#include "identification_task.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <ratio>
#include <utility>
#include <variant>
#include <vector>

#include "abbe/calib/otf/solve/backlash.hpp"
#include "abbe/config/capabilities.hpp"
#include "abbe/methods/calibration_run.hpp"
#include "abbe/methods/drift.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/calibration_service.hpp"

namespace abbe::daemon {
namespace {

constexpr std::chrono::milliseconds kLookForStop{100};

// Longest wait for the hash of the recording; more than a slow disk needs. After this time the
// model is stored without the hash.
constexpr auto kDigestTimeout = std::chrono::seconds{10};

/// Hash of the recording of the run. Never fails: if there is no hash, RecordingDigest::gap states
/// the reason.
RecordingDigest digest_of(std::future<RecordingDigest>& wanted, const std::atomic<bool>& stopped) {
  try {
    for (auto waited = kLookForStop; !stopped && waited < kDigestTimeout; waited += kLookForStop)
      if (wanted.wait_for(kLookForStop) == std::future_status::ready) return wanted.get();
    return {.gap = stopped ? "abbed ended before the recorder answered"
                           : "the recorder did not answer: its disk stalls"};
  } catch (const std::exception&) {  // std::future_error: the recorder has ended
    return {.gap = "the recorder failed"};
  }
}

/// Adds the recording to `inputs`, the files that the model names as its inputs. A model is checked
/// by a replay of its first input, so a recording with a gap is added at the end.
void cite(const RecordingDigest& recording, std::vector<InputFile>& inputs) {
  if (recording.bytes == 0) return;
  // The recording continues, so its hash covers only the first `bytes` bytes of the file.
  const auto name =
      fmt::format("{} ({} bytes)", recording.file.filename().string(), recording.bytes);
  inputs.insert(recording.gap.empty() ? inputs.begin() : inputs.end(), {name, recording.sha256});
}

std::vector<calib::Backlash> determined_backlash(const calib::VolumetricModel& model) {
  std::vector<calib::Backlash> all;
  for (const auto& backlash : calib::backlash_of(model))
    if (backlash.determined) all.push_back(backlash);
  return all;
}

/// Stores the verdict in the model, so that the receiver of its file knows it.
void keep_verdict(ModelDocument& document, const calib::Verdict& verdict) {
  document.verdict = model_verdict(verdict);
}

/// The document of an update: the document of the run, with the updated model. Its parents, the run
/// and the previous model, are the last inputs, with the hashes of their content. Statistics and
/// residuals stay those of the run, and RunFigures::of_model names its model; the backlash is that
/// of the update.
ModelDocument updated_document(calib::ModelWithOffset model, const ModelDocument& run,
                               const PublishedModel& previous) {
  ModelDocument document = run;
  document.model = std::move(model.model);
  if (model.range_offset) document.tracker_place->range_offset = *std::move(model.range_offset);
  document.estimator += ", update";
  document.inputs.push_back({fmt::format("run, model {}", model_id(run)), model_hash(run)});
  document.inputs.push_back({fmt::format("previous model {}", previous.id), previous.hash});
  document.backlash = determined_backlash(document.model);
  if (document.run) {
    document.run->of_model = model_id(run);
    document.run->held_out_cells.clear();  // they are predictions of the model of the run
  }
  return document;
}

}  // namespace

Result<std::shared_ptr<JudgedModel>> IdentificationTask::judged_model() {
  const CalibrationRun run = run_of(std::move(acquired));
  std::vector<InputFile> inputs = inputs_of(run);
  auto candidate = identify(run, *config, active ? &active->model : nullptr,
                            {.progress = [this](double share) { link->share = share; },
                             .stopped = [this] { return link->stopped.load(); }});
  ABBE_TRY(candidate);

  RecordingDigest recording = digest.valid() ? digest_of(digest, link->stopped) : RecordingDigest{};
  cite(recording, inputs);
  const auto created = clock.now();
  auto document = document_of(*candidate, *config, std::move(inputs), created);
  document.recording_gap = std::move(recording.gap);
  add_measured(document, observed(run), clock.offset(link->now));
  auto id = model_id(document);
  auto why = fmt::format("calibrate {}", method_of(*candidate));

  std::shared_ptr<JudgedModel> model{
      new JudgedModel{.id = std::move(id),
                      .document = std::move(document),
                      .verdict = verdict_of(*candidate),
                      .actor = {.who = who, .why = std::move(why), .when = created}}};
  add_notes(*model);
  if (active) compare_with_active(*model, run);
  keep_verdict(model->document, model->verdict);
  return model;
}

void IdentificationTask::add_notes(JudgedModel& model) const {
  auto& notes = model.verdict.notes;
  if (active_left_out) notes.emplace_back(kOfAnotherMachine);
  if (const auto& gap = model.document.recording_gap; !gap.empty())
    notes.push_back(cannot_be_checked(gap));
  for (std::string& change : in_words(clock.since_start(), "abbed started"))
    notes.push_back(std::move(change));
}

/// Adds drift of the active model to the verdict. With [drift] continuous, the document becomes an
/// update of the active model; the model of the run is stored in addition to it.
void IdentificationTask::compare_with_active(JudgedModel& model, const CalibrationRun& run) const {
  const DriftConfig& drift = config->drift;
  const DriftFinding finding =
      find_drift(model.document.model, model.verdict, active->model, drift);
  auto& notes = model.verdict.notes;
  notes.insert(notes.end(), finding.notes.begin(), finding.notes.end());
  model.beside = {.drifted_model = active->id,
                  .drift = finding.state(),
                  .hold = drift.hold && !finding.state().empty()};
  if (!drift.continuous || !finding.test) return;

  const std::chrono::duration<double, std::ratio<86400>> since =
      model.document.created - active->created;
  const auto options = update_options(run, finding, std::max(0.0, since.count()), drift);
  const auto& place = model.document.tracker_place;
  auto common = offset_in_common(place, active->tracker_place, since.count(), drift);
  if (!common.note.empty()) notes.push_back(std::move(common.note));
  if (const auto* otf = std::get_if<OtfRun>(&run);
      otf != nullptr && !place && config->machine.u_range_offset_m > 0.0)
    notes.push_back(
        fmt::format("the offset of the ranges counts as new information in every run: where the "
                    "tracker stays at its place, name it ({} place)",
                    tables_with(Capability::TrackerPoints)));
  calib::ModelWithOffset of_run{model.document.model};
  if (place) of_run.range_offset = place->range_offset;
  auto updated = updated_model(of_run, model.verdict, {active->model, std::move(common.of_active)},
                               *finding.test, options, config->gate);
  if (!updated) {
    notes.push_back(fmt::format("the active model was not updated: {}", updated.error().text));
    return;
  }

  keep_verdict(model.document, model.verdict);
  model.beside.run = model.document;
  model.beside.run_accepted = model.verdict.accepted;
  model.beside.run_reasons = model.verdict.reasons;
  model.document = updated_document(std::move(updated->model), model.document, *active);
  model.verdict = std::move(updated->verdict);
  model.id = model_id(model.document);
}

Result<KeptModel> IdentificationTask::operator()() {
  auto judged = judged_model();
  ABBE_TRY(judged);
  const std::shared_ptr<JudgedModel> model = std::move(*judged);
  if (!link->begin_storing(model)) return fail(ErrorCode::Refused, "the model was discarded");

  if (link->stopped) keeper.set_lock_timeout(CalibrationService::kLastTry);
  return keeper.keep(model->document, model->verdict, model->actor, link->now, &model->discarded,
                     model->beside);
}

}  // namespace abbe::daemon
