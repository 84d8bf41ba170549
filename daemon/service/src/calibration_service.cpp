#include "abbe/service/calibration_service.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <utility>

#include "abbe/methods/calibration_run.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/result/try.hpp"
#include "abbe/service/background_tasks.hpp"
#include "identification_task.hpp"
#include "outcome.hpp"

namespace abbe::daemon {
namespace {

using protocol::HostTime;

/// `held`: the model is accepted, but not activated because of [drift] hold.
SessionVerdict session_verdict(const std::string& id, const calib::Verdict& verdict, bool held) {
  const auto& h = verdict.held_out;
  SessionVerdict out{
      .figures = fmt::format(
          "held-out residual rms {:.3f} um, without compensation {:.3f} um{}",
          h.candidate_rms_m * 1e6, h.no_compensation_rms_m * 1e6,
          h.active_rms_m ? fmt::format(", active model {:.3f} um", *h.active_rms_m * 1e6) : ""),
      .reasons = verdict.accepted ? std::vector<std::string>{} : verdict.reasons,
      .notes = verdict.notes};
  if (held)
    out.reasons.push_back(
        fmt::format("not activated, because the machine has changed since the active model "
                    "([drift] hold): check the machine, then `abbe model activate {}`",
                    id));
  return out;
}

/// The verdict in one line, for events.
std::string text_of(const SessionVerdict& verdict, bool accepted) {
  const std::string notes =
      verdict.notes.empty() ? "" : fmt::format("; {}", fmt::join(verdict.notes, "; "));
  if (accepted)
    return fmt::format("{}{}accepted: {}{}", fmt::join(verdict.reasons, "; "),
                       verdict.reasons.empty() ? "" : "; ", verdict.figures, notes);
  return fmt::format("refused: {} ({}{})", fmt::join(verdict.reasons, "; "), verdict.figures,
                     notes);
}

// Period of further attempts to store a model. It may be long, because a full disk or a lock
// usually lasts until an operator acts.
constexpr auto kStoreAgain = std::chrono::seconds{5};

}  // namespace

CalibrationService::CalibrationService(const Config& config, ModelAuthority& authority,
                                       RecorderThread* recorder, WallClock clock)
    : config_(config),
      shared_config_(std::make_shared<const Config>(config)),
      authority_(authority),
      recorder_(recorder),
      clock_(std::move(clock)),
      session_(Methods::options(config)),
      live_tables_(shared_config_),
      link_(std::make_shared<IdentificationLink>()) {}

CalibrationService::~CalibrationService() {
  const WallTime until = WallTime::clock::now() + kStopTimeout;
  link_->stopped = true;
  const auto stored = store_before_end(until);
  if (stored || !model_) return;
  fmt::print(stderr,
             "abbed: model {} is lost: {}; identify it again from the recording of this run: "
             "`abbe identify {} --recording RUN.mcap -o MODEL.json`\n",
             model_->id, stored.error().text, model_->document.method);
}

/// Waits for the background task. If the task has not stored its model, tries to store it once
/// more. An error while `model_` is null means that no model was identified.
Result<void> CalibrationService::store_before_end(WallTime until) {
  if (task_.valid()) {
    const bool ended = task_.wait_until(until - kLastTry) == std::future_status::ready;
    (void)take_model(link_->now);
    if (!ended) return fail(ErrorCode::Io, "the store has not answered");
    if (outcome_of(task_)) return {};
  }

  if (!model_) return {};
  ModelKeeper keeper = authority_.keeper();
  keeper.set_lock_timeout(kLastTry);
  store_in_background(std::move(keeper), link_->now);
  if (task_.wait_until(until) != std::future_status::ready)
    return fail(ErrorCode::Io, "the store has not answered");
  const auto kept = outcome_of(task_);

  return kept ? Result<void>{} : tl::unexpected(kept.error());
}

Result<void> CalibrationService::check(const CalibrationTask& task) const {
  if (config_.axes_compensated()) {
    return fail(
        ErrorCode::Refused,
        fmt::format(
            "calibrate {}: the control already corrects these axes (axes_compensated = true): "
            "switch its compensation off first, and set axes_compensated = false",
            method_of(task)));
  }

  return Methods::visit(
      task, [this](auto method, const auto& request) { return method.check(request, config_); });
}

Result<PreparedCalibration> CalibrationService::prepare(CalibrationTask task) const {
  ABBE_TRY(check(task));
  RecordingAttachment attachment = to_attachment(task);
  const MethodNeeds needs =
      Methods::visit(task, [this](auto method, const auto&) { return method.needs(config_); });
  auto session = session_.prepare(std::move(task));
  ABBE_TRY(session);
  session->request_text = std::make_shared<const std::string>(attachment.content);
  return PreparedCalibration{std::move(*session), std::move(attachment), needs};
}

Result<std::uint64_t> CalibrationService::start(PreparedCalibration&& prepared,
                                                const std::string& who, HostTime now) {
  ABBE_TRY(session_.start(std::move(prepared.session), who, now));
  set_from(prepared.attachment, now);
  if (recorder_ != nullptr) recorder_->attach(std::move(prepared.attachment), now);

  return session_.status().id;
}

Result<std::uint64_t> CalibrationService::start(CalibrationTask task, const std::string& who,
                                                HostTime now) {
  auto prepared = prepare(std::move(task));
  ABBE_TRY(prepared);
  return start(std::move(*prepared), who, now);
}

Result<void> CalibrationService::cancel(const std::string& who, HostTime now) {
  if (task_.valid() && !link_->discard()) (void)take_model(now);
  const bool stalls = store_stalls(now);
  ABBE_TRY(stalls ? session_.give_up_store(
                        fmt::format("{}; the store does not answer and may still take model {}",
                                    who, model_->id),
                        now)
                  : session_.cancel(who, now));
  link_->stopped = true;
  if (stalls) task_ = {};
  discard_model();
  return {};
}

bool CalibrationService::store_stalls(HostTime now) const {
  return session_.stage() == SessionStage::Storing &&
         now - session_.since() > ModelAuthority::kStoreTimeout;
}

void CalibrationService::report_stalled_store(HostTime now) {
  if (!store_stalls(now) || !session_.not_stored().empty()) return;
  session_.store_stalls(fmt::format("model {} is not stored: the store has not answered for {} s",
                                    model_->id, ModelAuthority::kStoreTimeout.count()),
                        "cancel discards it", now);
}

std::vector<SessionEvent> CalibrationService::cycle(std::span<const protocol::Snapshot> snapshots,
                                                    HostTime now) {
  link_->now = now;
  for (const auto& snapshot : snapshots) session_.take(snapshot);
  session_.tick(now);
  live_tables_.cycle(session_, now);
  if (auto run = session_.take_run()) begin_identification(std::move(*run), now);
  if (auto discarded = session_.take_discarded()) destroy_in_background(std::move(*discarded));
  follow_background(now);
  auto events = session_.take_events();

  if (recorder_ != nullptr) {
    for (const auto& event : events)
      recorder_->hand_over(event_message(event, config_.machine.name), now);
  }

  return events;
}

void CalibrationService::begin_identification(Acquisition acquired, HostTime now) {
  link_ = std::make_shared<IdentificationLink>();
  link_->now = now;
  revision_before_storing_ = authority_.revision();
  auto active = authority_.comparison_model();
  const bool left_out = !active && authority_.active_model() != nullptr;

  task_ = run_abandonable(IdentificationTask{
      .link = link_,
      .config = shared_config_,
      .acquired = std::move(acquired),
      .active = std::move(active),
      .active_left_out = left_out,
      .digest = recorder_ != nullptr ? recorder_->digest() : std::future<RecordingDigest>{},
      .keeper = authority_.keeper(),
      .clock = clock_,
      .who = session_.who()});
}

/// Reports the progress of the background task to the session, and stores a model again after an
/// error.
void CalibrationService::follow_background(HostTime now) {
  const bool task_ended = ready(task_);
  // If the task raises DRIFT, this cycle publishes it; a new model becomes active only in a later
  // cycle.
  const bool drift_is_new = take_model(now) && !model_->beside.drift.empty();
  if (task_ended && !drift_is_new) conclude(outcome_of(task_), now);
  if (session_.stage() == SessionStage::NotStored && now >= session_.since() + kStoreAgain) {
    session_.store_again(now);
    store_in_background(authority_.keeper(), now);
  }
  report_stalled_store(now);
}

/// Takes the model once the task has begun to store it; returns true in that cycle.
/// `revision_before_storing_` is the revision of the authority in the last cycle before that. An
/// activation with a later revision may be newer than the one that the task makes.
bool CalibrationService::take_model(HostTime now) {
  if (!task_.valid() || model_) return false;
  const auto revision = authority_.revision();
  model_ = link_->take_model();

  if (!model_) {
    revision_before_storing_ = revision;
    return false;
  }
  session_.identified(model_->verdict.held_out, now);
  if (const KeptBeside& beside = model_->beside; !beside.drift.empty())
    authority_.raise_drift(beside.drifted_model, beside.drift);
  return true;
}

void CalibrationService::store_in_background(ModelKeeper keeper, HostTime now) {
  revision_before_storing_ = authority_.revision();
  task_ = run_abandonable([keeper = std::move(keeper), model = model_, now]() mutable {
    return keeper.keep(model->document, model->verdict, model->actor, now, &model->discarded,
                       model->beside);
  });
}

void CalibrationService::discard_model() {
  if (!model_) return;
  model_->discarded = true;
  destroy_in_background(std::exchange(model_, nullptr));
}

/// The command that identifies the run of the session again. The file name loses ".part" when the
/// file is closed; abbe identify finds the file by both names.
std::string CalibrationService::identify_again() const {
  if (recorder_ == nullptr || recorder_->status().file.empty()) return {};
  std::error_code failed;
  const auto file = std::filesystem::absolute(recorder_->status().file, failed).string();
  return fmt::format("abbe identify {} --recording '{}' -o again", session_.status().method, file);
}

void CalibrationService::conclude(Result<KeptModel> kept, HostTime now) {
  again_ = identify_again();
  again_from_ = recorder_ == nullptr ? "" : recorder_->status().file.filename().string();
  again_of_ = session_.status().id;
  if (!kept && !model_) {
    session_.not_identified(kept.error(), now);
    return;
  }

  if (!kept) {
    session_.store_failed(
        fmt::format("model {} is not stored: {}", model_->id, kept.error().text),
        fmt::format("tried again every {} s, cancel discards it", kStoreAgain.count()), now);
    return;
  }

  if (kept->active) authority_.set_active(std::move(*kept->active), revision_before_storing_);
  const calib::Verdict& verdict = model_->verdict;
  const bool held = verdict.accepted && model_->beside.hold;
  SessionVerdict sentences = session_verdict(kept->id, verdict, held);
  std::string reason = text_of(sentences, verdict.accepted);
  session_.judged(kept->id, verdict.accepted && !held, std::move(reason), std::move(sentences),
                  now);
  discard_model();
}

std::string CalibrationService::recording_of_run() const {
  const SessionStatus& s = session_.status();
  const bool ended = s.state == SessionState::Refused || s.state == SessionState::Active;
  return ended && s.id == again_of_ ? again_from_ : "";
}

SessionStatus CalibrationService::status() const {
  SessionStatus s = session_.status();
  if (s.state == SessionState::Identifying) s.progress = link_->share;
  if (session_.running()) s.live = live_tables_.latest();
  if (s.state == SessionState::Refused && s.id == again_of_) s.again = again_;
  return s;
}

}  // namespace abbe::daemon
