#include "abbe/replay/replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <span>
#include <string_view>
#include <thread>
#include <utility>

#include "abbe/devices/device_kind.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/methods/calibration_request.hpp"
#include "abbe/methods/calibration_session.hpp"
#include "abbe/methods/otf/inputs.hpp"
#include "abbe/model/model_document.hpp"
#include "abbe/pipeline/axis_zero.hpp"
#include "abbe/pipeline/counting_state.hpp"
#include "abbe/pipeline/pipeline.hpp"
#include "abbe/recording/recorded_clock.hpp"
#include "abbe/result/try.hpp"
#include "live_cycles.hpp"
#include "mark_search.hpp"
#include "raw_decoder.hpp"
#include "second_samples.hpp"

namespace abbe::daemon {
namespace {

using protocol::HostTime;

constexpr std::uint64_t kMessagesPerProgress = 256;
// Largest delay of a live sample after its raw bytes, in recorded time. The delay is caused by the
// threads of a busy computer, and is longer if simulated time runs many times faster than real
// time.
constexpr auto kLongestAhead = std::chrono::seconds{10};

/// The calibrations that were requested during the recording, replayed one after the other.
class Calibrations {
 public:
  Calibrations(const RecordingReader& recording, std::vector<CalibrationRequest> requests,
               const Config& config, const ReplayOptions& options)
      : recording_(recording),
        requests_(std::move(requests)),
        config_(config),
        options_(options),
        session_(Methods::options(config)) {}

  /// Starts the calibrations that were requested before the cycle `taken`. A request ends the
  /// calibration before it, which must have been cancelled in the live run.
  void begin_cycle(HostTime taken) {
    while (next_ < requests_.size() && requests_[next_].from < taken) begin_next();
  }
  void take(const protocol::Snapshot& snapshot) {
    session_.take(snapshot);
    auto acquired = session_.take_run();
    if (!acquired) return;
    CalibrationRun run = run_of(std::move(*acquired));
    options_.runs ? hand_over(std::move(run)) : identify_again(run);
  }

  [[nodiscard]] std::vector<ReplayedCalibration> finish() {
    while (next_ < requests_.size()) begin_next();
    end("the recording ends before the calibration is complete, or it was cancelled");
    return std::move(done_);
  }

 private:
  void begin_next() {
    end("another calibration was requested before this one was complete");
    session_ = CalibrationSession{Methods::options(config_)};
    (void)session_.start(requests_[next_]);
    identified_ = false;
    ++next_;
  }
  /// Ends the present calibration unless its run was identified or handed over. If its session
  /// still takes readings, its result becomes Refused with the reason `cause`.
  void end(std::string_view cause) {
    if (next_ > 0 && !identified_) done_.push_back({.ended = ended(session_.status(), cause)});
    identified_ = true;
  }
  static SessionStatus ended(SessionStatus status, std::string_view cause) {
    if (!takes_readings(status.state)) return status;
    status.reason = fmt::format("{} (last state: {}, {})", cause, name(status.state),
                                status.reason.empty() ? "no reason" : status.reason);
    status.state = SessionState::Refused;
    status.refused_as = ErrorCode::DataInsufficient;
    return status;
  }
  void hand_over(CalibrationRun run) {
    done_.push_back({.ended = session_.status(),
                     .points_sha256 = inputs_of(run).back().sha256,
                     .observed = observed(run)});
    identified_ = true;
    options_.runs(std::move(run));
  }
  void identify_again(const CalibrationRun& run) {
    ReplayedCalibration c{.ended = session_.status(),
                          .points_sha256 = inputs_of(run).back().sha256,
                          .observed = observed(run)};
    c.outcome = identify(run, config_, options_.active, {.stopped = options_.stopped});
    if (*c.outcome) {
      std::visit([this](auto& candidate) { judge_recording(recording_, candidate.verdict); },
                 **c.outcome);
      const ModelDocument document = document_of(**c.outcome, config_, {}, {});
      c.model_hash = model_hash(document);
      c.model_id = model_id(document);
    }
    done_.push_back(std::move(c));
    identified_ = true;
  }

  const RecordingReader& recording_;
  std::vector<CalibrationRequest> requests_;
  const Config& config_;
  const ReplayOptions& options_;
  CalibrationSession session_;
  std::size_t next_ = 0;
  bool identified_ = true;
  std::vector<ReplayedCalibration> done_;
};

/// Index in DeviceNames::environment; nullopt if the sample is the tracker's own weather reading.
std::optional<std::size_t> environment_place(const DeviceNames& names, std::string_view device) {
  const auto found = std::ranges::find(names.environment, device);
  if (found == names.environment.end()) return std::nullopt;
  return static_cast<std::size_t>(found - names.environment.begin());
}

/// True if the recording states that it follows the rule `name`. Recordings of earlier versions of
/// abbe do not.
bool has_rule(const RecordingReader& recording, const char* name) {
  const auto versions = recording.metadata().find("abbe.versions");
  return versions != recording.metadata().end() && versions->second.contains(name);
}

/// The zero of each axis as found in the live run. It is taken from attachments even in a replay
/// from raw bytes, because these do not show from which time a zero applies.
Result<AxisZeros> zero_of(const RecordingReader& recording, const Config& config) {
  const bool asked = has_rule(recording, kZeroRule);
  AxisZeros zero{config,
                 asked ? AxisZeros::WithoutMarks::NeedAZero : AxisZeros::WithoutMarks::Untouched};

  for (const auto& attachment : recording.attachments()) {
    if (attachment.name != kZeroStateName) continue;
    const auto state = zero_state_from_attachment(attachment);
    ABBE_TRY(state);
    zero.go_on(*state);
  }

  for (const auto& attachment : recording.attachments()) {
    if (attachment.name != kZeroName) continue;
    const auto found = zero_from_attachment(attachment);
    ABBE_TRY(found);
    zero.found(*found);
  }

  return zero;
}

/// Corrects the zero in a special case: a counter card was set up while one recording file was
/// written, and its first sample is in the next file. The raw bytes in the next file do not show
/// this restart of the counters, but the recorded live samples do.
class SetUpBefore {
 public:
  explicit SetUpBefore(const RecordingReader& recording)
      : possible_(std::ranges::any_of(recording.attachments(),
                                      [](const auto& a) { return a.name == kZeroStateName; })) {}

  [[nodiscard]] bool possible() const { return possible_; }
  void take_live(const protocol::SampleHead& head) {
    if (has(head.flags, protocol::SampleFlag::Restarted)) at_ = head.time;
  }
  /// Applies the restart of the counters if a live sample shows it and the bytes do not. Call it
  /// before `zero` is applied to the samples decoded from the bytes.
  void apply(const Batch& batch, AxisZeros& zero) {
    const bool seen = std::ranges::any_of(batch.axes, [](const auto& s) {
      return has(s.head.flags, protocol::SampleFlag::Restarted);
    });
    if (at_ && !seen) zero.go_on({.at = *at_, .unknown = 0xff});
    at_.reset();
  }

 private:
  bool possible_;
  std::optional<HostTime> at_;
};

Result<std::vector<CalibrationRequest>> requests_of(const RecordingReader& recording) {
  std::vector<CalibrationRequest> requests;
  for (const auto& attachment : recording.attachments()) {
    if (!is_calibration_request(attachment.name)) continue;
    auto request = from_attachment(attachment);
    ABBE_TRY(request);
    requests.push_back(std::move(*request));
  }
  return requests;
}

/// Slows the replay down to `speed` times the speed of the live run. `first`: recorded time of the
/// start.
class Pace {
 public:
  Pace(double speed, HostTime first) : speed_(speed), first_(first) {}
  void wait_for(HostTime recorded) const {
    if (!(speed_ > 0.0)) return;
    const std::chrono::duration<double> wall =
        std::chrono::duration<double>(recorded - first_) / speed_;
    std::this_thread::sleep_until(start_ +
                                  std::chrono::duration_cast<std::chrono::nanoseconds>(wall));
  }

 private:
  double speed_;
  HostTime first_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

/// The data that the live run received in addition to samples, from the attachments of the
/// recording.
struct Attached {
  std::vector<CalibrationRequest> requests;
  AxisZeros zero;
  MarkSearch marks;
};

Result<Attached> attached_to(const RecordingReader& recording, const Config& config) {
  auto requests = requests_of(recording);
  ABBE_TRY(requests);
  auto zero = zero_of(recording, config);
  ABBE_TRY(zero);
  auto marks = MarkSearch::of(recording, config);
  ABBE_TRY(marks);
  return Attached{std::move(*requests), std::move(*zero), std::move(*marks)};
}

/// State of the counters at the end of the previous run, if the live run started with it. A state
/// that cannot be read is ignored: the decoded counts then differ only by whole periods of the
/// counters.
std::optional<CountingProgress> left_progress(const RecordingReader& recording) {
  for (const auto& attachment : recording.attachments()) {
    if (attachment.name != kCountingStateName) continue;
    if (const auto state = counting_state_from_text(attachment.content, attachment.name))
      return state->counting.progress;
  }
  return std::nullopt;
}

/// The configuration for decoding the bytes. It is changed so that old recordings are decoded as in
/// their live run.
Config config_of_bytes(const RecordingReader& recording, Config config) {
  auto& encoder = config.of<EncoderConfig>();
  if (encoder && !has_rule(recording, kRotaryTravelRule))
    for (EncoderNodeConfig& node : encoder->nodes) node.middle.reset();
  return config;
}

/// Decodes samples from raw bytes and delivers each sample in the cycle in which the live run
/// received it.
class FromBytes {
 public:
  FromBytes(const RecordingReader& recording, const Config& config)
      : config_(config_of_bytes(recording, config)),
        decoder_(config_, left_progress(recording)),
        ahead_(recording.messages()),
        next_(ahead_.next()) {
    sink_.tracker_point = [this](const auto& p, std::string_view) { expect(points_, p); };
    sink_.axis_sample = [this](const auto& s, std::string_view) { expect(axes_, s); };
    sink_.probe_trigger = [this](const auto& t, std::string_view) { expect(touches_, t); };
    // No cycle is announced for samples of environment devices: the pipeline uses them only after
    // the watermark, so that a difference of one cycle has no effect.
    sink_.environment = [this, names = device_names(config)](const auto& e,
                                                             std::string_view device) {
      if (!environment_place(names, device)) expect(weather_, e);
    };
  }
  FromBytes(const FromBytes&) = delete;
  FromBytes& operator=(const FromBytes&) = delete;

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) {
    decoder_.take(block, device, batch);
  }
  void finish(Batch& batch) { decoder_.finish(batch); }
  void end_cycle(Batch& batch) {
    for (; next_ && next_->taken <= batch.taken + kLongestAhead; next_ = ahead_.next())
      (void)deliver(*next_, sink_);
    points_.hold(batch.taken, batch.points);
    axes_.hold(batch.taken, batch.axes);
    touches_.hold(batch.taken, batch.touches);
    weather_.hold(batch.taken, batch.environment);
  }

 private:
  template <class Sample>
  void expect(LiveCycles<Sample>& cycles, const Sample& sample) {
    cycles.expect(sample.head.time, next_->taken);
  }

  Config config_;  // configuration of decoder_
  RawDecoder decoder_;
  RecordingReader::Cursor ahead_;
  std::optional<RecordedMessage> next_;
  RecordingSink sink_;
  LiveCycles<protocol::TrackerPoint> points_;
  LiveCycles<protocol::AxisSample> axes_;
  LiveCycles<protocol::ProbeTrigger> touches_;
  LiveCycles<protocol::EnvironmentSample> weather_;
};

/// Options of the assembler. For recordings of earlier versions of abbe, which used readings of
/// sensors without checks, the checks are switched off.
AssemblerOptions assembling(const RecordingReader& recording, const Config& config) {
  auto options = assembler_options(config);
  if (!has_rule(recording, kSensorRule)) options.environment.sensors = {};
  return options;
}

/// Passes the batches of the live run to the pipeline, cycle by cycle.
class Replay : private PipelineObserver {
 public:
  Replay(const RecordingReader& recording, const Config& config, const ReplayOptions& options,
         Attached attached)
      : recording_(recording),
        config_(config),
        names_(device_names(config)),
        options_(options),
        zeros_(std::move(attached.zero)),
        marks_(std::move(attached.marks)),
        calibrations_(recording, std::move(attached.requests), config, options),
        pipeline_(assembling(recording, config),
                  options.source == ReplaySource::RawBytes ? &zeros_ : nullptr),
        set_up_(recording) {
    pipeline_.add(*this);
    if (options.source == ReplaySource::Samples) {
      take_samples();
      if (!has_rule(recording, kAxisSamplesRule)) second_samples_.emplace(recording);
    } else {
      take_bytes();
    }
    sink_.calibration_event = [this](const v1::CalibrationEvent& e) { take(e); };
  }
  Replay(const Replay&) = delete;
  Replay& operator=(const Replay&) = delete;

  /// Sets the state of the sensors at the beginning of the file: that at the end of the previous
  /// file, or that of an earlier run.
  [[nodiscard]] Result<void> go_on() {
    for (const auto& attachment : recording_.attachments()) {
      if (attachment.name == kSensorStateName) {
        ABBE_TRY(pipeline_.go_on(attachment));
      } else if (attachment.name == kSensorAcceptedName) {
        auto acceptance = sensor_acceptance_from(attachment);
        ABBE_TRY(acceptance);
        pipeline_.accept(std::move(*acceptance));
      }
    }
    return {};
  }
  [[nodiscard]] Result<ReplayReport> run() {
    const auto range = recording_.time_range();
    if (!range) return ReplayReport{};
    begin_ = batch_.taken = range->first;
    report_.recorded = range->second - range->first;
    const Error before_its_end{ErrorCode::DataInsufficient, "replay: stopped before its end"};
    take_messages(Pace{options_.speed, begin_});
    if (stopped()) return tl::unexpected(before_its_end);
    pipeline_.finish(batch_.taken);
    report_.calibrations = calibrations_.finish();
    if (stopped()) return tl::unexpected(before_its_end);
    if (bytes_) report_.zeros = marks_.compared(recording_);
    return std::move(report_);
  }

 private:
  void take_samples() {
    sink_.tracker_point = [this](const auto& p, std::string_view) { batch_.points.push_back(p); };
    sink_.axis_sample = [this](const auto& s, std::string_view) { batch_.axes.push_back(s); };
    sink_.probe_trigger = [this](const auto& t, std::string_view) { batch_.touches.push_back(t); };
    sink_.environment = [this](const auto& e, std::string_view device) { take(e, device); };
  }
  void take_bytes() {
    bytes_.emplace(recording_, config_);
    sink_.raw_block = [this](const auto& b, std::string_view device) {
      bytes_->take(b, device, batch_);
    };
    if (set_up_.possible())
      sink_.axis_sample = [this](const auto& s, std::string_view) { set_up_.take_live(s.head); };
    // Only environment samples repeated from the previous file are used (their instant is earlier
    // than their date in this file): their bytes are in the previous file. All others are decoded
    // from bytes.
    sink_.environment = [this](const auto& e, std::string_view device) {
      if (e.head.time != published_) take(e, device);
    };
  }
  void take(const protocol::EnvironmentSample& sample, std::string_view device) {
    if (const auto measuring = environment_place(names_, device)) {
      batch_.measured_environment.push_back({*measuring, sample});
    } else {
      batch_.environment.push_back(sample);
    }
  }
  void take(const v1::CalibrationEvent& event) {
    if (options_.events) options_.events(event);
    auto& ids = report_.live_model_ids;
    if (event.model_id().empty() || (!ids.empty() && ids.back() == event.model_id())) return;
    ids.push_back(event.model_id());
  }

  [[nodiscard]] bool stopped() const { return options_.stopped && options_.stopped(); }
  void take_messages(const Pace& pace) {
    std::uint64_t messages = 0;
    auto cursor = recording_.messages();
    while (const auto message = cursor.next()) {
      if (message->taken != batch_.taken) end_cycle();
      batch_.taken = message->taken;
      published_ = message->published;
      pace.wait_for(message->taken);
      if (!deliver(*message, sink_)) ++report_.undecodable;
      if (++messages % kMessagesPerProgress != 0) continue;
      if (options_.progress) options_.progress(cursor.progress());
      if (stopped()) return;
    }
    if (bytes_) bytes_->finish(batch_);
    end_cycle();
  }
  void end_cycle() {
    calibrations_.begin_cycle(batch_.taken);
    if (bytes_) bytes_->end_cycle(batch_);
    if (second_samples_) second_samples_->combine(batch_);
    pipeline_.cycle(batch_);
    batch_.clear();
  }
  void on_delivered(const Batch& batch) override {
    marks_.take(batch);
    if (bytes_) set_up_.apply(batch, zeros_);
  }
  void on_samples(const Batch& batch) override {
    report_.samples += batch.points.size() + batch.axes.size() + batch.touches.size() +
                       batch.environment.size() + batch.measured_environment.size();
    if (options_.samples) options_.samples(batch, begin_);
  }
  void on_snapshots(std::span<const protocol::Snapshot> snapshots, HostTime /*taken*/) override {
    for (const auto& snapshot : snapshots) {
      calibrations_.take(snapshot);
      if (options_.snapshots) options_.snapshots(snapshot);
    }

    report_.snapshots += snapshots.size();
  }

  const RecordingReader& recording_;
  const Config& config_;
  DeviceNames names_;
  const ReplayOptions& options_;
  AxisZeros zeros_;
  MarkSearch marks_;
  Calibrations calibrations_;
  Pipeline pipeline_;
  SetUpBefore set_up_;
  std::optional<FromBytes> bytes_;
  std::optional<SecondSamples> second_samples_;
  RecordingSink sink_;
  HostTime begin_{};
  HostTime published_{};  ///< publishing time of the message that is being delivered
  Batch batch_;
  ReplayReport report_;
};

}  // namespace

void judge_recording(const RecordingReader& recording, calib::Verdict& verdict) {
  if (auto damage = recording.damage(); !damage.empty()) {
    verdict.accepted = false;
    verdict.refuse("damage", std::move(damage));
  }
  if (recording.configuration_check() == MetadataCheck::Unchecked)
    verdict.notes.emplace_back(
        "the recorded configuration has no checksum: damage in it would not be detected");
  for (std::string& change : in_words(recorded_clock(recording).change, "abbed started"))
    verdict.notes.push_back(std::move(change));
}

Result<Config> recorded_config(const RecordingReader& recording, const std::string& file) {
  if (recording.configuration_check() == MetadataCheck::Damaged)
    return fail(ErrorCode::BadInput, fmt::format("{}: the recorded configuration is damaged (its "
                                                 "checksum is wrong): give the file it was "
                                                 "recorded with",
                                                 file));
  return parse_recorded_config(recording.info().configuration, file + " (recorded configuration)");
}

Result<ReplayReport> replay(const RecordingReader& recording, const Config& config,
                            const ReplayOptions& options) {
  auto attached = attached_to(recording, config);
  ABBE_TRY(attached);
  Replay again{recording, config, options, std::move(*attached)};
  ABBE_TRY(again.go_on());
  auto report = again.run();
  ABBE_TRY(recording.intact());
  return report;
}

}  // namespace abbe::daemon
