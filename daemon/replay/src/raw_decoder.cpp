#include "raw_decoder.hpp"

#include <array>
#include <span>
#include <variant>

#include "abbe/config/touch_options.hpp"
#include "abbe/devices/device_options.hpp"

namespace abbe::daemon {

RawDecoder::RawDecoder(const Config& config,
                       const std::optional<drivers::CounterCardProgress>& left) {
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
    decimation_ = drivers::ScanDecimation{config.counter_card->sample_every};
    auto options = device_options(*config.counter_card, config.daemon.speed).receiver;
    options.goes_on_from = left;
    card_ = std::make_unique<drivers::CounterCardReceiver>(options);
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
    cmm_ = std::make_unique<drivers::IppReceiver>(
        device_options(*config.cmm, config.daemon.speed).receiver);
  }
}

void RawDecoder::take(const protocol::RawBlock& block, std::string_view device, Batch& batch) {
  if (tracker_ && device == tracker_name_) take_tracker(block, batch);
  if (encoder_ && device == encoder_name_) {
    encoder_->on_raw(block, [&](const protocol::AxisSample& s) { batch.axes.push_back(s); });
  }

  if (card_ && device == card_name_) {
    card_->on_raw(block, [&](const drivers::CounterScan& s) {
      if (const auto sample = decimation_.take(s.axes)) batch.axes.push_back(*sample);
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

void RawDecoder::take_tracker(const protocol::RawBlock& block, Batch& batch) {
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

void RawDecoder::detect(const drivers::CounterScan& scan, Batch& batch) {
  touch_detector_->on_scan(scan);
  std::array<protocol::ProbeTrigger, 1> touch;
  while (touch_detector_->touches().pop(touch) == 1) batch.touches.push_back(touch[0]);
}

void RawDecoder::watch(const drivers::CounterScan& scan, Batch& batch) {
  mark_watcher_.on_scan(scan);
  for (drivers::MarkCrossing crossing; mark_watcher_.crossings().pop({&crossing, 1}) == 1;)
    batch.marks.push_back(crossing);
}

void RawDecoder::take_cmm(const protocol::RawBlock& block, Batch& batch) {
  const auto bytes = std::span{block.bytes}.first(block.length);
  if (block.direction == protocol::RawBlock::Direction::ToDevice)
    return cmm_->sent(bytes, block.time);

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

}  // namespace abbe::daemon
