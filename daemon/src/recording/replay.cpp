#include "abbe/daemon/replay.hpp"

#include <algorithm>
#include <chrono>
#include <map>
#include <thread>
#include <utility>
#include <variant>

#include "abbe/daemon/assembler.hpp"
#include "abbe/daemon/calibration_request.hpp"
#include "abbe/daemon/calibration_session.hpp"
#include "abbe/daemon/datum.hpp"
#include "abbe/daemon/device_options.hpp"
#include "abbe/daemon/model_document.hpp"
#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/drivers/counter_card/receiver.hpp"
#include "abbe/drivers/counter_card/thinning.hpp"
#include "abbe/drivers/environment/receiver.hpp"
#include "abbe/drivers/ippdme/receiver.hpp"
#include "abbe/drivers/sampling/mark_watcher.hpp"
#include "abbe/drivers/sampling/touch_detector.hpp"
#include "abbe/drivers/tracker/receiver.hpp"
#include "recording/mark_search.hpp"

namespace abbe::daemon {
namespace {

using protocol::HostTime;

// Messages between two turns of the assembler: enough to make the turn cheap, few enough to stay in the
// cache.
constexpr std::size_t kMessagesPerTurn = 256;

/// Gives messages of a stream in the order in which they were recorded: a recording is read in the order of
/// host time. Points of a tracker are mapped to that: while the clock model is still learning, a burst may
/// begin before the end of the one before. And bytes are stamped by the kernel: a busy driver reads an answer
/// that came just before it sent the next question only after that.
template <class Message>
class RecordedOrder {
 public:
  template <class Give>
  void take(std::uint32_t sequence, Message message, const Give& give) {
    waiting_.emplace(sequence, std::move(message));
    // Nothing is farther out of order than a few bursts: a number still missing then was lost with a damaged
    // chunk.
    while (!waiting_.empty() && (waiting_.begin()->first == next_ || waiting_.size() > kMostWaiting))
      give_first(give);
  }
  template <class Give>
  void finish(const Give& give) {
    while (!waiting_.empty()) give_first(give);
  }

 private:
  static constexpr std::size_t kMostWaiting = 4096;
  template <class Give>
  void give_first(const Give& give) {
    give(waiting_.begin()->second);
    next_ = waiting_.begin()->first + 1;
    waiting_.erase(waiting_.begin());
  }

  std::map<std::uint32_t, Message> waiting_;
  std::uint32_t next_ = 0;
};

/// Raw device bytes into the samples they were decoded to.
class RawDecoder {
 public:
  explicit RawDecoder(const Config& config) {
    if (config.tracker) {
      tracker_name_ = config.tracker->name;
      tracker_ = std::make_unique<drivers::TrackerReceiver>(
          drivers::receiver_options(device_options(*config.tracker, config.daemon.speed)));
    }
    for (const EnvironmentConfig& device : config.environment) {
      environment_names_.push_back(device.name);
      environment_.emplace_back(device.map, drivers::transport_of(device.address));
    }
    if (config.encoder) {
      encoder_name_ = config.encoder->name;
      encoder_.emplace(device_options(*config.encoder, config.daemon.speed).receiver);
    }
    if (config.counter_card) {
      card_name_ = config.counter_card->name;
      thinning_ = drivers::ScanThinning{config.counter_card->sample_every};
      card_ = std::make_unique<drivers::CounterCardReceiver>(
          device_options(*config.counter_card, config.daemon.speed).receiver);
    }
    if (config.reference) {
      reference_name_ = config.reference->card.name;
      reference_card_ = std::make_unique<drivers::CounterCardReceiver>(
          device_options(config.reference->card, config.daemon.speed).receiver);
    }
    if (config.counter_card && config.probe) {
      touch_detector_ = std::make_unique<drivers::TouchDetector>(
          touch_options(*config.probe, *config.counter_card, config.machine));
    }
    if (config.cmm) {
      cmm_name_ = config.cmm->name;
      cmm_is_the_axes_ = config.cmm_reads_axes();
      cmm_ =
          std::make_unique<drivers::IppReceiver>(device_options(*config.cmm, config.daemon.speed).receiver);
    }
  }

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) {
    if (tracker_ && device == tracker_name_) take_tracker(block, batch);
    if (encoder_ && device == encoder_name_) {
      encoder_->on_raw(block, [&](const protocol::AxisSample& s) { batch.axes.push_back(s); });
    }
    if (card_ && device == card_name_) {
      card_->on_raw(block, [&](const drivers::CounterScan& s) {
        if (const auto sample = thinning_.take(s.axes)) batch.axes.push_back(*sample);
        if (touch_detector_) detect(s, batch);
      });
    }
    if (reference_card_ && device == reference_name_) {
      reference_card_->on_raw(block, [&](const drivers::CounterScan& s) { watch(s, batch); });
    }
    for (std::size_t i = 0; i < environment_.size(); ++i) {
      if (device == environment_names_[i] && environment_[i].on_raw(block))
        batch.measured_environment.push_back({i, environment_[i].sample()});
    }
    if (cmm_ && device == cmm_name_) take_cmm(block, batch);
  }

 private:
  void take_tracker(const protocol::RawBlock& block, Batch& batch) {
    if (block.direction != protocol::RawBlock::Direction::FromDevice) return;
    if (block.lost_before > 0) tracker_->bytes_lost();
    tracker_->push(std::span{block.bytes}.first(block.length), block.time);
    while (const auto message = tracker_->next()) {
      if (const auto* burst = std::get_if<drivers::TrackerBurst>(&*message)) {
        batch.points.insert(batch.points.end(), burst->points.begin(), burst->points.end());
      } else if (const auto* weather = std::get_if<protocol::EnvironmentSample>(&*message)) {
        batch.environment.push_back(*weather);
      }
    }
  }

  void detect(const drivers::CounterScan& scan, Batch& batch) {
    touch_detector_->on_scan(scan);
    std::array<protocol::ProbeTrigger, 1> touch;
    while (touch_detector_->touches().pop(touch) == 1) batch.touches.push_back(touch[0]);
  }

  void watch(const drivers::CounterScan& scan, Batch& batch) {
    mark_watcher_.on_scan(scan);
    for (drivers::MarkCrossing crossing; mark_watcher_.crossings().pop({&crossing, 1}) == 1;)
      batch.marks.push_back(crossing);
  }

  void take_cmm(const protocol::RawBlock& block, Batch& batch) {
    const auto bytes = std::span{block.bytes}.first(block.length);
    if (block.direction == protocol::RawBlock::Direction::ToDevice) return cmm_->sent(bytes, block.time);
    // A hole cuts a line in two: what comes is taken from the next connection on.
    if (block.lost_before > 0) cmm_->push({}, block.time);
    cmm_->push(bytes, block.time);
    while (const auto message = cmm_->next()) {
      if (const auto* touch = std::get_if<protocol::ProbeTrigger>(&*message)) {
        batch.touches.push_back(*touch);
      } else if (const auto* sample = std::get_if<protocol::AxisSample>(&*message);
                 sample && cmm_is_the_axes_) {
        batch.axes.push_back(*sample);
      }
    }
  }

  std::string tracker_name_;
  std::string encoder_name_;
  std::unique_ptr<drivers::TouchDetector> touch_detector_;
  std::string cmm_name_;
  bool cmm_is_the_axes_ = false;
  std::unique_ptr<drivers::IppReceiver> cmm_;
  std::unique_ptr<drivers::TrackerReceiver> tracker_;
  std::optional<drivers::EncoderReceiver> encoder_;
  std::string card_name_;
  std::unique_ptr<drivers::CounterCardReceiver> card_;
  drivers::ScanThinning thinning_{1};
  std::string reference_name_;
  std::unique_ptr<drivers::CounterCardReceiver> reference_card_;
  drivers::MarkWatcher mark_watcher_;
  std::vector<std::string> environment_names_;
  std::vector<drivers::EnvironmentReceiver> environment_;
};

/// The calibrations the recording asks for, one after the other.
class Calibrations {
 public:
  Calibrations(std::vector<CalibrationRequest> requests, const Config& config, const ReplayOptions& options)
      : requests_(std::move(requests)),
        config_(config),
        options_(options),
        session_(acquisition_options(config), evemu_acquisition_options(config)) {
    begin_next();
  }

  void take(const protocol::Snapshot& snapshot) {
    // A request that came later ends the one before, as it did live (by a cancellation).
    if (next_ < requests_.size() && snapshot.head.time >= requests_[next_].from) {
      end();
      begin_next();
    }
    session_.take(snapshot);
    if (auto run = session_.take_run()) options_.runs ? hand_over(std::move(*run)) : identify_again(*run);
  }

  [[nodiscard]] std::vector<ReplayedCalibration> finish() {
    end();
    return std::move(done_);
  }

 private:
  void begin_next() {
    if (next_ == requests_.size()) return;
    session_ = CalibrationSession{acquisition_options(config_), evemu_acquisition_options(config_)};
    (void)session_.start(requests_[next_]);
    identified_ = false;
    ++next_;
  }
  void end() {
    if (next_ > 0 && !identified_) done_.push_back({.ended = session_.status()});
    identified_ = true;
  }
  void hand_over(CalibrationRun run) {
    done_.push_back({.ended = session_.status(), .points_sha256 = inputs_of(run).back().sha256});
    identified_ = true;
    options_.runs(std::move(run));
  }
  void identify_again(const CalibrationRun& run) {
    ReplayedCalibration c{.ended = session_.status(), .points_sha256 = inputs_of(run).back().sha256};
    c.outcome = identify(run, config_, options_.active);
    if (*c.outcome) {
      const ModelDocument document = document_of(**c.outcome, config_, {}, {});
      c.model_hash = model_hash(document);
      c.model_id = model_id(document);
    }
    done_.push_back(std::move(c));
    identified_ = true;
  }

  std::vector<CalibrationRequest> requests_;
  const Config& config_;
  const ReplayOptions& options_;
  CalibrationSession session_;
  std::size_t next_ = 0;
  bool identified_ = true;
  std::vector<ReplayedCalibration> done_;
};

/// Which of Config::environment it is; none: the tracker's weather.
std::optional<std::size_t> environment_place(const Config& config, std::string_view device) {
  for (std::size_t i = 0; i < config.environment.size(); ++i) {
    if (config.environment[i].name == device) return i;
  }
  return std::nullopt;
}

/// What the marks gave in the live run: since when a datum was known is not in the bytes.
Result<Datum> datum_of(const RecordingReader& recording, const Config& config) {
  const auto versions = recording.metadata().find("abbe.versions");
  const bool asked = versions != recording.metadata().end() && versions->second.contains(kDatumRule);
  Datum datum{config, asked ? Datum::WithoutMarks::NeedAZero : Datum::WithoutMarks::Untouched};
  for (const auto& attachment : recording.attachments()) {
    if (attachment.name != kDatumStateName) continue;
    const auto state = datum_state_from_attachment(attachment);
    if (!state) return tl::unexpected(state.error());
    datum.go_on(*state);
  }
  for (const auto& attachment : recording.attachments()) {
    if (attachment.name != kDatumName) continue;
    const auto found = datum_from_attachment(attachment);
    if (!found) return tl::unexpected(found.error());
    datum.found(*found);
  }
  return datum;
}

/// A card that was set up while one file was written and spoke in the next: what a replay from the bytes of
/// this next file cannot see, but the samples of the live run say.
class SetUpBefore {
 public:
  explicit SetUpBefore(const RecordingReader& recording)
      : possible_(std::ranges::any_of(recording.attachments(),
                                      [](const auto& a) { return a.name == kDatumStateName; })) {}

  void take_live(const protocol::SampleHead& head) {
    if (possible_ && has(head.flags, protocol::SampleFlag::Restarted)) at_ = head.time;
  }
  /// Before `datum` is applied to the samples from the bytes.
  void apply(const Batch& batch, Datum& datum) {
    const bool seen = std::ranges::any_of(
        batch.axes, [](const auto& s) { return has(s.head.flags, protocol::SampleFlag::Restarted); });
    if (at_ && !seen) datum.go_on({.at = *at_, .unknown = 0xff});
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
    if (!request) return tl::unexpected(request.error());
    requests.push_back(std::move(*request));
  }
  return requests;
}

/// Holds the replay back to `speed` times the recorded time, which began at `first`.
class Pace {
 public:
  Pace(double speed, HostTime first) : speed_(speed), first_(first) {}
  void wait_for(HostTime recorded) const {
    if (!(speed_ > 0.0)) return;
    const std::chrono::duration<double> wall = std::chrono::duration<double>(recorded - first_) / speed_;
    std::this_thread::sleep_until(start_ + std::chrono::duration_cast<std::chrono::nanoseconds>(wall));
  }

 private:
  double speed_;
  HostTime first_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

}  // namespace

Result<ReplayReport> replay(const RecordingReader& recording, const Config& config,
                            const ReplayOptions& options) {
  auto requests = requests_of(recording);
  if (!requests) return tl::unexpected(requests.error());
  auto datum = datum_of(recording, config);
  if (!datum) return tl::unexpected(datum.error());
  auto marks = MarkSearch::of(recording, config);
  if (!marks) return tl::unexpected(marks.error());
  const bool from_raw = options.source != ReplaySource::Samples;  // recorded samples have their datum
  Calibrations calibrations{std::move(*requests), config, options};
  Assembler assembler{assembler_options(config)};
  RawDecoder raw{config};
  Batch batch;
  SetUpBefore set_up{recording};
  const auto give_datum = [&] {
    if (!from_raw) return;
    set_up.apply(batch, *datum);
    datum->apply(batch);
  };
  ReplayReport report;
  std::vector<protocol::Snapshot> snapshots;

  RecordedOrder<protocol::TrackerPoint> points_in_order;
  const auto give_point = [&batch](const protocol::TrackerPoint& p) { batch.points.push_back(p); };
  RecordedOrder<std::pair<protocol::RawBlock, std::string>> blocks_in_order;
  const auto give_block = [&](const std::pair<protocol::RawBlock, std::string>& b) {
    raw.take(b.first, b.second, batch);
  };
  std::uint32_t sequence = 0;  // of the message being delivered
  HostTime logged{};           // the same
  RecordingSink sink;
  const auto take_environment = [&](const protocol::EnvironmentSample& e, std::string_view device) {
    const auto measuring = environment_place(config, device);
    if (measuring) {
      batch.measured_environment.push_back({*measuring, e});
    } else {
      batch.environment.push_back(e);
    }
  };
  if (options.source == ReplaySource::Samples) {
    sink.tracker_point = [&](const protocol::TrackerPoint& p, std::string_view) {
      points_in_order.take(sequence, p, give_point);
    };
    sink.axis_sample = [&](const protocol::AxisSample& s, std::string_view) { batch.axes.push_back(s); };
    sink.environment = take_environment;
    sink.probe_trigger = [&](const protocol::ProbeTrigger& t, std::string_view) {
      batch.touches.push_back(t);
    };
  } else {
    sink.raw_block = [&](const protocol::RawBlock& b, std::string_view device) {
      blocks_in_order.take(sequence, {b, std::string{device}}, give_block);
    };
    // The bytes of what a former file handed on are in that file.
    sink.axis_sample = [&](const protocol::AxisSample& s, std::string_view) { set_up.take_live(s.head); };
    sink.environment = [&](const protocol::EnvironmentSample& e, std::string_view device) {
      if (e.head.time != logged) take_environment(e, device);
    };
  }
  sink.calibration_event = [&](const v1::CalibrationEvent& e) {
    if (!e.model_id().empty() &&
        (report.live_model_ids.empty() || report.live_model_ids.back() != e.model_id())) {
      report.live_model_ids.push_back(e.model_id());
    }
  };

  const auto hand_on = [&] {
    for (const auto& s : snapshots) {
      calibrations.take(s);
      if (options.snapshots) options.snapshots(s);
    }
    report.snapshots += snapshots.size();
    snapshots.clear();
  };

  const auto range = recording.time_range();
  if (!range) return report;
  report.recorded = range->second - range->first;
  const Pace pace{options.speed, range->first};
  auto cursor = recording.messages();
  std::size_t taken = 0;
  while (const auto message = cursor.next()) {
    pace.wait_for(message->time);
    sequence = message->sequence;
    logged = message->time;
    if (!deliver(*message, sink)) ++report.undecodable;
    if (++taken % kMessagesPerTurn != 0) continue;
    marks->take(batch);
    give_datum();
    if (options.samples) options.samples(batch, range->first);
    assembler.take(batch);
    batch.clear();
    assembler.emit(snapshots);
    hand_on();
    if (options.progress) options.progress(cursor.progress());
  }
  points_in_order.finish(give_point);
  blocks_in_order.finish(give_block);
  marks->take(batch);
  give_datum();
  if (options.samples) options.samples(batch, range->first);
  assembler.take(batch);
  assembler.finish(snapshots);
  hand_on();
  report.calibrations = calibrations.finish();
  if (from_raw) report.datums = marks->compared(recording);
  return report;
}

}  // namespace abbe::daemon
