#include "abbe/daemon/calibration_service.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <chrono>
#include <utility>

#include "abbe/daemon/calibration_run.hpp"
#include "abbe/daemon/device_options.hpp"
#include "abbe/daemon/otf_inputs.hpp"
#include "abbe/daemon/work_aside.hpp"
#include "session/outcome.hpp"

namespace abbe::daemon {
namespace {

using protocol::HostTime;

std::string verdict_text(const calib::Verdict& verdict) {
  const auto& h = verdict.held_out;
  const std::string figures =
      fmt::format("held-out residual rms {:.3f} um, without compensation {:.3f} um{}",
                  h.candidate_rms_m * 1e6, h.no_compensation_rms_m * 1e6,
                  h.active_rms_m ? fmt::format(", active model {:.3f} um", *h.active_rms_m * 1e6) : "");
  const std::string notes = verdict.notes.empty() ? "" : fmt::format("; {}", fmt::join(verdict.notes, "; "));
  if (verdict.accepted) return "accepted: " + figures + notes;
  return fmt::format("refused: {} ({}{})", fmt::join(verdict.reasons, "; "), figures, notes);
}

template <class T>
bool ready(const std::future<T>& work) {
  return work.valid() && work.wait_for(std::chrono::seconds{0}) == std::future_status::ready;
}

}  // namespace

CalibrationService::CalibrationService(const Config& config, ModelAuthority& authority,
                                       RecorderThread* recorder, protocol::UtcOffset utc)
    : config_(config),
      authority_(authority),
      recorder_(recorder),
      utc_(utc),
      session_(acquisition_options(config), evemu_acquisition_options(config)) {}

CalibrationService::~CalibrationService() {
  if (identification_.valid()) identification_.wait();
  if (keeping_.valid()) keeping_.wait();
}

Result<void> CalibrationService::check(const CalibrationTask& task) const {
  if (config_.axes_compensated()) {
    return fail(
        ErrorCode::Refused,
        fmt::format("calibrate {}: the control already corrects these axes (axes_compensated = true): "
                    "switch its compensation off first, and say so in the configuration",
                    method_of(task)));
  }
  if (identification_.valid()) {
    return fail(
        ErrorCode::Refused,
        fmt::format("calibrate {}: the identification of a cancelled run is still ending", method_of(task)));
  }
  if (const auto* otf = std::get_if<OtfRequest>(&task)) {
    if (config_.tracker && config_.tracker->mode == TrackerModeConfig::Stationary)
      return fail(ErrorCode::Refused,
                  "calibrate otf: [tracker] mode = \"stationary\" gives no points on the fly");
    return check_otf_path(otf->path_m, config_.machine);
  }
  return check_evemu(std::get<EvemuRequest>(task), config_);
}

Result<void> CalibrationService::start(CalibrationTask task, const std::string& who, HostTime now) {
  if (auto fine = check(task); !fine) return fine;
  CalibrationRequest request{.task = std::move(task), .from = now};
  const RecordingAttachment attachment = to_attachment(request);
  if (auto started = session_.start(std::move(request)); !started) return started;
  who_ = who;
  if (recorder_ != nullptr) recorder_->attach(attachment, now);
  return {};
}

Result<void> CalibrationService::cancel(const std::string& who, HostTime now) {
  if (keeping_.valid())
    return fail(ErrorCode::Refused, "cancel: the model is being put into the store already");
  return session_.cancel(who, now);
}

std::vector<SessionEvent> CalibrationService::turn(std::span<const protocol::Snapshot> snapshots,
                                                   HostTime now) {
  for (const auto& snapshot : snapshots) session_.take(snapshot);
  session_.tick(now);
  if (auto run = session_.take_run()) begin_identification(std::move(*run));
  if (ready(identification_)) keep(outcome_of(identification_), now);
  if (ready(keeping_)) conclude(outcome_of(keeping_), now);
  auto events = session_.take_events();
  if (recorder_ != nullptr) {
    for (const auto& event : events) recorder_->hand_over(event_message(event, config_.machine.name), now);
  }
  return events;
}

void CalibrationService::begin_identification(CalibrationRun run) {
  std::optional<calib::VolumetricModel> active;
  if (const auto* to_beat = authority_.to_beat()) active = *to_beat;
  active_left_out_ = !active && authority_.in_force() != nullptr;
  std::future<RecordingDigest> digest;
  if (recorder_ != nullptr) digest = recorder_->digest();
  identified_share_ = 0.0;
  identification_ = start_aside([this, run = std::move(run), active = std::move(active),
                                 digest = std::move(digest)]() mutable -> Result<Identified> {
    std::vector<InputFile> inputs;
    if (digest.valid()) {
      const RecordingDigest d = digest.get();
      // The hash is that of the first `bytes` bytes: the recording goes on.
      inputs.push_back({fmt::format("{} ({} bytes)", d.file.filename().string(), d.bytes), d.sha256});
    }
    const auto entered = inputs_of(run);
    inputs.insert(inputs.end(), entered.begin(), entered.end());
    auto candidate = identify(run, config_, active ? &*active : nullptr,
                              [this](double share) { identified_share_ = share; });
    if (!candidate) return tl::unexpected(candidate.error());
    return Identified{std::move(*candidate), std::move(inputs)};
  });
}

void CalibrationService::keep(Result<Identified> identified, HostTime now) {
  if (session_.status().state != SessionState::Identifying) return;  // cancelled meanwhile
  if (!identified) {
    session_.not_identified(identified.error(), now);
    return;
  }
  verdict_ = verdict_of(identified->candidate);
  if (active_left_out_) verdict_.notes.emplace_back(kOfAnotherMachine);
  held_out_ = verdict_.held_out;
  const auto created = utc_.to_utc(now);
  keeping_since_ = authority_.revision();
  keeping_ = start_aside(
      [keeper = authority_.keeper(), verdict = verdict_, now,
       actor = StoreActor{.who = who_,
                          .why = fmt::format("calibrate {}", method_of(identified->candidate)),
                          .when = created},
       document = document_of(identified->candidate, config_, std::move(identified->inputs),
                              created)]() mutable { return keeper.keep(document, verdict, actor, now); });
}

void CalibrationService::conclude(Result<KeptModel> kept, HostTime now) {
  if (!kept) {
    session_.not_identified(
        {kept.error().code, fmt::format("identified, but not kept: {}", kept.error().text), {}}, now);
    return;
  }
  if (kept->active) authority_.take_up(std::move(*kept->active), keeping_since_);
  session_.judged(kept->id, verdict_.accepted, verdict_text(verdict_), now);
}

SessionStatus CalibrationService::status() const {
  SessionStatus s = session_.status();
  if (s.state == SessionState::Identifying) s.progress = identified_share_;
  return s;
}

}  // namespace abbe::daemon
