#include "abbe/service/calibration_service.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <utility>

#include "abbe/devices/device_options.hpp"
#include "abbe/methods/calibration_run.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/service/background_tasks.hpp"
#include "outcome.hpp"

namespace abbe::daemon {
namespace {

using protocol::HostTime;

constexpr std::chrono::milliseconds kLookForStop{100};

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

// A full disk or a lock lasts until an operator acts; one attempt writes one small file.
constexpr auto kKeepAgain = std::chrono::seconds{5};
// Longer than a slow disk needs. After it the model is stored without the hash of its recording.
constexpr auto kDigestTimeout = std::chrono::seconds{10};

/// Digest of the recording of the run. Never fails: RecordingDigest::gap states why there is none.
RecordingDigest digest_of(std::future<RecordingDigest>& wanted, const std::atomic<bool>& stopped) {
  try {
    for (auto waited = kLookForStop; !stopped && waited < kDigestTimeout; waited += kLookForStop)
      if (wanted.wait_for(kLookForStop) == std::future_status::ready) return wanted.get();
    return {.gap = "the recorder did not answer: its disk stalls"};
  } catch (const std::exception&) {  // a broken promise
    return {.gap = "the recorder failed"};
  }
}

/// Adds the recording to `inputs`. The first input is the one with which the model can be checked:
/// a recording with a gap is therefore added at the end.
void cite(const RecordingDigest& recording, std::vector<InputFile>& inputs) {
  if (recording.bytes == 0) return;
  // The hash is that of the first `bytes` bytes: the recording goes on.
  const auto name =
      fmt::format("{} ({} bytes)", recording.file.filename().string(), recording.bytes);
  inputs.insert(recording.gap.empty() ? inputs.begin() : inputs.end(), {name, recording.sha256});
}

template <class T>
bool ready(const std::future<T>& work) {
  return work.valid() && work.wait_for(std::chrono::seconds{0}) == std::future_status::ready;
}

}  // namespace

CalibrationService::CalibrationService(const Config& config, ModelAuthority& authority,
                                       RecorderThread* recorder, protocol::UtcOffset utc)
    : config_(config),
      shared_config_(std::make_shared<const Config>(config)),
      authority_(authority),
      recorder_(recorder),
      utc_(utc),
      session_(Methods::options(config)) {}

CalibrationService::~CalibrationService() {
  const WallTime until = WallTime::clock::now() + kStopTimeout;
  watch_->stopped = true;
  stop_identification(until - kLastTry);
  if (!to_keep_) return;
  if (const auto kept = try_once_more(until); !kept)
    fmt::print(stderr,
               "abbed: model {} is lost: {}; identify it again with `abbe identify {} "
               "--recording`\n",
               to_keep_->id, kept.error().text, to_keep_->document.method);
}

/// Takes the result of an identification that ends before `until`.
void CalibrationService::stop_identification(WallTime until) {
  if (!identification_.valid() || identification_.wait_until(until) != std::future_status::ready)
    return;
  (void)sign(outcome_of(identification_), latest_cycle_);
}

Result<void> CalibrationService::try_once_more(WallTime until) {
  if (keeping_.valid()) {
    if (keeping_.wait_until(until - kLastTry) != std::future_status::ready)
      return fail(ErrorCode::Io, "the store has not answered");
    if (outcome_of(keeping_)) return {};
  }

  ModelKeeper keeper = authority_.keeper();
  keeper.set_lock_timeout(kLastTry);
  keeping_ = run_abandonable([keeper = std::move(keeper), model = to_keep_]() mutable {
    return keeper.keep(model->document, model->verdict, model->actor, {});
  });

  if (keeping_.wait_until(until) != std::future_status::ready)
    return fail(ErrorCode::Io, "the store has not answered");
  const auto kept = outcome_of(keeping_);

  return kept ? Result<void>{} : tl::unexpected(kept.error());
}

Result<void> CalibrationService::check(const CalibrationTask& task) const {
  if (config_.axes_compensated()) {
    return fail(
        ErrorCode::Refused,
        fmt::format(
            "calibrate {}: the control already corrects these axes (axes_compensated = true): "
            "switch its compensation off first, and say so in the configuration",
            method_of(task)));
  }

  return Methods::visit(
      task, [this](auto method, const auto& request) { return method.check(request, config_); });
}

Result<PreparedCalibration> CalibrationService::prepare(CalibrationTask task) const {
  if (auto valid = check(task); !valid) return tl::unexpected(valid.error());
  RecordingAttachment attachment = to_attachment(task);
  const MethodNeeds needs =
      Methods::visit(task, [this](auto method, const auto&) { return method.needs(config_); });
  auto session = session_.prepare(std::move(task));
  if (!session) return tl::unexpected(session.error());
  return PreparedCalibration{std::move(*session), std::move(attachment), needs};
}

Result<std::uint64_t> CalibrationService::start(PreparedCalibration&& prepared,
                                                const std::string& who, HostTime now) {
  if (identification_.valid() && !session_.running())
    return fail(ErrorCode::Refused,
                fmt::format("calibrate {}: the identification of a cancelled run is still ending",
                            prepared.session.method));
  SessionStatus before = session_.status();
  if (auto started = session_.start(std::move(prepared.session), now); !started)
    return tl::unexpected(started.error());
  if (before.id != 0) ended_.push_back(std::move(before));
  if (ended_.size() > kEndedKept) ended_.pop_front();
  who_ = who;
  set_from(prepared.attachment, now);
  if (recorder_ != nullptr) recorder_->attach(std::move(prepared.attachment), now);

  return session_.status().id;
}

Result<std::uint64_t> CalibrationService::start(CalibrationTask task, const std::string& who,
                                                HostTime now) {
  auto prepared = prepare(std::move(task));
  if (!prepared) return tl::unexpected(prepared.error());
  return start(std::move(*prepared), who, now);
}

Result<void> CalibrationService::cancel(const std::string& who, HostTime now) {
  const bool stalls = store_stalls(now);
  if (keeping_.valid() && !stalls)
    return fail(ErrorCode::Refused, "cancel: the model is being put into the store already");
  watch_->stopped = true;
  const std::string late =
      stalls ? fmt::format("; the store does not answer and may still take model {}", to_keep_->id)
             : "";
  auto cancelled = session_.cancel(who + late, now);
  if (!cancelled) return cancelled;
  keeping_ = {};
  discard_unstored();
  return {};
}

bool CalibrationService::store_stalls(HostTime now) const {
  return keeping_.valid() && now - keeping_from_ > ModelAuthority::kStoreTimeout;
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
  for (const auto& snapshot : snapshots) session_.take(snapshot);
  session_.tick(now);
  if (auto run = session_.take_run()) begin_identification(std::move(*run));
  if (auto discarded = session_.take_discarded()) destroy_in_background(std::move(*discarded));
  if (ready(identification_)) keep(outcome_of(identification_), now);
  if (ready(keeping_)) conclude(outcome_of(keeping_), now);
  if (to_keep_ && !keeping_.valid() && now >= keep_again_at_) begin_keeping(now);
  report_stalled_store(now);
  auto events = session_.take_events();

  if (recorder_ != nullptr) {
    for (const auto& event : events)
      recorder_->hand_over(event_message(event, config_.machine.name), now);
  }

  return events;
}

void CalibrationService::begin_identification(Acquisition acquired) {
  auto active = authority_.to_beat();
  active_left_out_ = !active && authority_.in_force() != nullptr;
  std::future<RecordingDigest> digest;
  if (recorder_ != nullptr) digest = recorder_->digest();
  watch_ = std::make_shared<Watch>();

  identification_ = run_abandonable([watch = watch_, config = shared_config_,
                                     acquired = std::move(acquired), active = std::move(active),
                                     digest = std::move(digest)]() mutable -> Result<Identified> {
    const CalibrationRun run = run_of(std::move(acquired));
    std::vector<InputFile> inputs = inputs_of(run);
    auto candidate = identify(run, *config, active ? &active->model : nullptr,
                              {.progress = [&watch](double share) { watch->share = share; },
                               .stopped = [&watch] { return watch->stopped.load(); }});
    if (!candidate) return tl::unexpected(candidate.error());
    RecordingDigest recording =
        digest.valid() ? digest_of(digest, watch->stopped) : RecordingDigest{};
    cite(recording, inputs);
    auto document = document_of(*candidate, *config, std::move(inputs), {});
    document.recording_gap = recording.gap;
    auto id = model_id(document);
    auto why = fmt::format("calibrate {}", method_of(*candidate));
    return Identified{.model = std::shared_ptr<ToKeep>(
                          new ToKeep{.id = std::move(id),
                                     .document = std::move(document),
                                     .verdict = verdict_of(*candidate),
                                     .actor = {.who = {}, .why = std::move(why), .when = {}}}),
                      .recording_gap = std::move(recording.gap)};
  });
}

/// True if there is a model to store: the session was not cancelled and the identification
/// succeeded.
bool CalibrationService::sign(Result<Identified> identified, HostTime now) {
  if (session_.status().state != SessionState::Identifying) {
    destroy_in_background(std::move(identified));
    return false;
  }

  if (!identified) {
    session_.not_identified(identified.error(), now);
    return false;
  }

  to_keep_ = std::move(identified->model);
  calib::Verdict& verdict = to_keep_->verdict;
  if (active_left_out_) verdict.notes.emplace_back(kOfAnotherMachine);
  if (!identified->recording_gap.empty())
    verdict.notes.push_back(cannot_be_checked(identified->recording_gap));
  const auto created = utc_.to_utc(now);
  to_keep_->document.created = to_keep_->actor.when = created;
  to_keep_->actor.who = who_;

  return true;
}

void CalibrationService::keep(Result<Identified> identified, HostTime now) {
  if (!sign(std::move(identified), now)) return;
  verdict_ = to_keep_->verdict;
  held_out_ = verdict_.held_out;
  begin_keeping(now);
}

void CalibrationService::begin_keeping(HostTime now) {
  keeping_from_ = now;
  keeping_since_ = authority_.revision();
  keeping_ = run_abandonable([keeper = authority_.keeper(), model = to_keep_, now]() mutable {
    return keeper.keep(model->document, model->verdict, model->actor, now, &model->discarded);
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
  if (!kept) {
    keep_again_at_ = now + kKeepAgain;
    not_stored_ = fmt::format("model {} is not stored: {}", to_keep_->id, kept.error().text);
    session_.not_stored(fmt::format("{}; tried again every {} s, cancel discards it", not_stored_,
                                    kKeepAgain.count()),
                        now);
    return;
  }
  discard_unstored();
  if (kept->active) authority_.take_up(std::move(*kept->active), keeping_since_);
  session_.judged(kept->id, verdict_.accepted, verdict_text(verdict_), now);
}

SessionStatus CalibrationService::status() const {
  SessionStatus s = session_.status();
  if (s.state == SessionState::Identifying) s.progress = watch_->share;
  return s;
}

}  // namespace abbe::daemon
