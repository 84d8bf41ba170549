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

std::string verdict_text(const calib::Verdict& verdict) {
  const auto& h = verdict.held_out;
  const std::string figures = fmt::format(
      "held-out residual rms {:.3f} um, without compensation {:.3f} um{}", h.candidate_rms_m * 1e6,
      h.no_compensation_rms_m * 1e6,
      h.active_rms_m ? fmt::format(", active model {:.3f} um", *h.active_rms_m * 1e6) : "");
  const std::string notes =
      verdict.notes.empty() ? "" : fmt::format("; {}", fmt::join(verdict.notes, "; "));
  if (verdict.accepted) return "accepted: " + figures + notes;
  return fmt::format("refused: {} ({}{})", fmt::join(verdict.reasons, "; "), figures, notes);
}

/// Before the verdict on a model that is not activated because of [drift] hold.
std::string held_text(const std::string& id) {
  return fmt::format(
      "not activated, because the machine has changed since the active model ([drift] hold): check "
      "the machine, then `abbe model activate {}`; ",
      id);
}

// Period of further attempts to store a model. It may be long, because a full disk or a lock
// usually lasts until an operator acts.
constexpr auto kStoreAgain = std::chrono::seconds{5};

template <class T>
bool ready(const std::future<T>& work) {
  return work.valid() && work.wait_for(std::chrono::seconds{0}) == std::future_status::ready;
}

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
      state_(std::make_shared<IdentificationState>()) {}

CalibrationService::~CalibrationService() {
  const WallTime until = WallTime::clock::now() + kStopTimeout;
  state_->stopped = true;
  const auto stored = store_before_end(until);
  if (stored || !to_keep_) return;
  fmt::print(stderr,
             "abbed: model {} is lost: {}; identify it again from the recording of this run: "
             "`abbe identify {} --recording RUN.mcap -o MODEL.json`\n",
             to_keep_->id, stored.error().text, to_keep_->document.method);
}

/// Waits for the background task. If the task has not stored its model, tries to store it once
/// more. An error while `to_keep_` is null means that no model was identified.
Result<void> CalibrationService::store_before_end(WallTime until) {
  if (task_.valid()) {
    const bool ended = task_.wait_until(until - kLastTry) == std::future_status::ready;
    follow_task(latest_cycle_);
    if (!ended) return fail(ErrorCode::Io, "the store has not answered");
    if (outcome_of(task_)) return {};
  }

  if (!to_keep_) return {};
  ModelKeeper keeper = authority_.keeper();
  keeper.set_lock_timeout(kLastTry);
  store_in_background(std::move(keeper), latest_cycle_);
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
  auto text = std::make_shared<const std::string>(attachment.content);
  const MethodNeeds needs =
      Methods::visit(task, [this](auto method, const auto&) { return method.needs(config_); });
  auto session = session_.prepare(std::move(task));
  ABBE_TRY(session);
  return PreparedCalibration{std::move(*session), std::move(attachment), needs, std::move(text)};
}

Result<std::uint64_t> CalibrationService::start(PreparedCalibration&& prepared,
                                                const std::string& who, HostTime now) {
  if (task_.valid() && !session_.running())
    return fail(ErrorCode::Refused,
                fmt::format("calibrate {}: the identification of a cancelled run is still ending",
                            prepared.session.method));
  SessionStatus before = session_.status();
  ABBE_TRY(session_.start(std::move(prepared.session), now));
  if (before.id != 0) ended_.push_back(std::move(before));
  if (ended_.size() > kEndedKept) ended_.pop_front();
  who_ = who;
  std::swap(request_text_, prepared.request_text);  // the caller destroys the previous text
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
  if (task_.valid() && !state_->discard()) follow_task(now);
  const bool stalls = store_stalls(now);
  if (storing() && !stalls)
    return fail(ErrorCode::Refused, "cancel: the model is already being stored");
  state_->stopped = true;
  const std::string late =
      stalls ? fmt::format("; the store does not answer and may still take model {}", to_keep_->id)
             : "";
  auto cancelled = session_.cancel(who + late, now);
  if (!cancelled) return cancelled;
  if (stalls) task_ = {};
  discard_unstored();
  return {};
}

bool CalibrationService::storing() const {
  return task_.valid() && to_keep_ != nullptr;
}

bool CalibrationService::store_stalls(HostTime now) const {
  return storing() && now - storing_from_ > ModelAuthority::kStoreTimeout;
}

void CalibrationService::report_stalled_store(HostTime now) {
  if (!store_stalls(now) || !not_stored_.empty()) return;
  not_stored_ = fmt::format("model {} is not stored: the store has not answered for {} s",
                            to_keep_->id, ModelAuthority::kStoreTimeout.count());
  session_.not_stored(not_stored_ + "; cancel discards it", now);
}

std::vector<SessionEvent> CalibrationService::cycle(std::span<const protocol::Snapshot> snapshots,
                                                    HostTime now) {
  latest_cycle_ = now;
  state_->now = now;
  for (const auto& snapshot : snapshots) session_.take(snapshot);
  session_.tick(now);
  live_tables_.cycle(session_, now);
  if (auto run = session_.take_run()) begin_identification(std::move(*run));
  if (auto discarded = session_.take_discarded()) destroy_in_background(std::move(*discarded));
  const bool ended = ready(task_), known = to_keep_ != nullptr;
  follow_task(now);
  // The cycle that raises DRIFT publishes it, before another model becomes active.
  const bool drift_is_new = !known && to_keep_ != nullptr && !to_keep_->beside.drift.empty();
  if (ended && !drift_is_new) conclude(outcome_of(task_), now);
  if (to_keep_ && !task_.valid() && now >= store_again_at_)
    store_in_background(authority_.keeper(), now);
  report_stalled_store(now);
  auto events = session_.take_events();

  if (recorder_ != nullptr) {
    for (const auto& event : events)
      recorder_->hand_over(event_message(event, config_.machine.name), now);
  }

  return events;
}

void CalibrationService::begin_identification(Acquisition acquired) {
  state_ = std::make_shared<IdentificationState>();
  state_->now = latest_cycle_;
  revision_before_storing_ = authority_.revision();
  auto active = authority_.comparison_model();
  const bool left_out = !active && authority_.active_model() != nullptr;

  task_ = run_abandonable(IdentificationTask{
      .state = state_,
      .config = shared_config_,
      .acquired = std::move(acquired),
      .active = std::move(active),
      .active_left_out = left_out,
      .digest = recorder_ != nullptr ? recorder_->digest() : std::future<RecordingDigest>{},
      .keeper = authority_.keeper(),
      .clock = clock_,
      .who = who_});
}

/// Takes the model once the task has begun to store it. `revision_before_storing_` is the revision
/// of the authority in the last cycle before that: an activation with a later revision may be newer
/// than the one that the task makes.
void CalibrationService::follow_task(HostTime now) {
  if (!task_.valid() || to_keep_) return;
  const auto revision = authority_.revision();
  to_keep_ = state_->take_model();

  if (!to_keep_) {
    revision_before_storing_ = revision;
    return;
  }
  storing_from_ = now;
  held_out_ = to_keep_->verdict.held_out;
  if (const KeptBeside& beside = to_keep_->beside; !beside.drift.empty())
    authority_.raise_drift(beside.drifted_model, beside.drift);
}

/// Stores a model again after an error.
void CalibrationService::store_in_background(ModelKeeper keeper, HostTime now) {
  storing_from_ = now;
  revision_before_storing_ = authority_.revision();
  task_ = run_abandonable([keeper = std::move(keeper), model = to_keep_, now]() mutable {
    return keeper.keep(model->document, model->verdict, model->actor, now, &model->discarded,
                       model->beside);
  });
}

void CalibrationService::discard_unstored() {
  if (to_keep_) {
    to_keep_->discarded = true;
    destroy_in_background(std::exchange(to_keep_, nullptr));
  }
  not_stored_.clear();
}

void CalibrationService::conclude(Result<KeptModel> kept, HostTime now) {
  if (!kept && !to_keep_) {
    session_.not_identified(kept.error(), now);  // no effect if the session was cancelled
    return;
  }

  if (!kept) {
    store_again_at_ = now + kStoreAgain;
    not_stored_ = fmt::format("model {} is not stored: {}", to_keep_->id, kept.error().text);
    session_.not_stored(fmt::format("{}; tried again every {} s, cancel discards it", not_stored_,
                                    kStoreAgain.count()),
                        now);
    return;
  }

  if (kept->active) authority_.set_active(std::move(*kept->active), revision_before_storing_);
  const calib::Verdict& verdict = to_keep_->verdict;
  const bool held = verdict.accepted && to_keep_->beside.hold;
  session_.judged(kept->id, verdict.accepted && !held,
                  (held ? held_text(kept->id) : std::string{}) + verdict_text(verdict), now);
  discard_unstored();
}

SessionStatus CalibrationService::status() const {
  SessionStatus s = session_.status();
  if (s.state == SessionState::Identifying) s.progress = state_->share;
  if (session_.running()) s.live = live_tables_.latest();
  return s;
}

}  // namespace abbe::daemon
