#include "identification_task.hpp"

#include <fmt/format.h>

#include <chrono>
#include <utility>

#include "abbe/methods/calibration_run.hpp"
#include "abbe/service/calibration_service.hpp"

namespace abbe::daemon {
namespace {

constexpr std::chrono::milliseconds kLookForStop{100};

// Longest wait for the hash of the recording; longer than a slow disk needs. After this time the
// model is stored without this hash.
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

}  // namespace

Result<std::shared_ptr<JudgedModel>> IdentificationTask::judged_model() {
  const CalibrationRun run = run_of(std::move(acquired));
  std::vector<InputFile> inputs = inputs_of(run);
  auto candidate = identify(run, *config, active ? &active->model : nullptr,
                            {.progress = [this](double share) { state->share = share; },
                             .stopped = [this] { return state->stopped.load(); }});
  if (!candidate) return tl::unexpected(candidate.error());

  RecordingDigest recording =
      digest.valid() ? digest_of(digest, state->stopped) : RecordingDigest{};
  cite(recording, inputs);
  const auto created = utc.to_utc(state->now);
  auto document = document_of(*candidate, *config, std::move(inputs), created);
  document.recording_gap = std::move(recording.gap);
  auto id = model_id(document);
  auto why = fmt::format("calibrate {}", method_of(*candidate));

  std::shared_ptr<JudgedModel> model{
      new JudgedModel{.id = std::move(id),
                      .document = std::move(document),
                      .verdict = verdict_of(*candidate),
                      .actor = {.who = who, .why = std::move(why), .when = created}}};
  add_notes(*model);
  return model;
}

void IdentificationTask::add_notes(JudgedModel& model) const {
  auto& notes = model.verdict.notes;
  if (active_left_out) notes.emplace_back(kOfAnotherMachine);
  if (const auto& gap = model.document.recording_gap; !gap.empty())
    notes.push_back(cannot_be_checked(gap));
}

Result<KeptModel> IdentificationTask::operator()() {
  auto judged = judged_model();
  if (!judged) return tl::unexpected(judged.error());
  const std::shared_ptr<JudgedModel> model = std::move(*judged);
  if (!state->begin_storing(model)) return fail(ErrorCode::Refused, "the model was discarded");

  if (state->stopped) keeper.set_lock_timeout(CalibrationService::kLastTry);
  return keeper.keep(model->document, model->verdict, model->actor, state->now, &model->discarded);
}

}  // namespace abbe::daemon
