#include "abbe/devices/counter_card_options.hpp"

#include <string>

#include "abbe/drivers/counter_card/decimation.hpp"
#include "abbe/drivers/counter_card/receiver.hpp"
#include "abbe/drivers/sampling/touch_detector.hpp"
#include "abbe/result/try.hpp"
#include "card_link.hpp"
#include "kinds.hpp"
#include "running.hpp"

namespace abbe::daemon {
namespace {

using TouchDetectorPointer = std::unique_ptr<drivers::TouchDetector>;

/// The touch detector of the probe that is connected to the card; null if there is no [probe].
TouchDetectorPointer touch_detector_of(const Config& config) {
  const auto& probe = config.of<ProbeConfig>();
  if (!probe) return nullptr;
  const drivers::CounterCardWiring& wiring = config.of<CounterCardConfig>()->card.wiring;
  return std::make_unique<drivers::TouchDetector>(touch_options(*probe, wiring, config.machine));
}

class RunningCard final : public RunningDevices {
 public:
  RunningCard(TouchDetectorPointer detector, Running<drivers::CounterCardDevice> running,
              std::size_t place)
      : touch_detector_(std::move(detector)), running_(std::move(running)), place_(place) {}

  void drain(Batch& batch) override {
    drain_ring(running_.device->samples(), axes_, batch.axes);
    for (CountingProgress p; running_.device->progress().pop({&p, 1}) != 0;) progress_ = p;

    if (touch_detector_) {
      drain_ring(touch_detector_->touches(), touches_, batch.touches);
      drain_ring(touch_detector_->windows(), touch_scans_, batch.touch_scans);
    }

    drain_raw(running_.device->raw(), blocks_, place_, batch);
  }
  [[nodiscard]] std::vector<const drivers::DeviceThread*> threads() const override {
    return {running_.thread.get()};
  }
  [[nodiscard]] std::vector<std::string> warnings() const override {
    return with_assumption(RunningDevices::warnings(), *running_.device);
  }
  [[nodiscard]] std::optional<CountingProgress> take_progress() override {
    return std::exchange(progress_, std::nullopt);
  }

 private:
  // The card calls the detector, so the card (below) must be destroyed first.
  TouchDetectorPointer touch_detector_;
  Running<drivers::CounterCardDevice> running_;
  std::size_t place_;
  std::optional<CountingProgress> progress_;
  std::array<protocol::AxisSample, kMostSamples> axes_;
  std::array<protocol::ProbeTrigger, 16> touches_;
  std::array<protocol::TouchScan, 256> touch_scans_;
  BlockBuffer blocks_;
};

Result<std::unique_ptr<RunningDevices>> start_counter_card(const DeviceStart& start) {
  const Config& config = start.config;
  const auto& counter = config.of<CounterCardConfig>();
  if (!counter) return nullptr;
  auto options = device_options(*counter, config.daemon.speed);
  if (start.left) {
    options.receiver.resume_from = start.left;
    options.session.set_up_serial = std::string{start.left->serial_number()};
  }

  auto link = make_link(counter->card, drivers::identity_of(options), start.time);
  auto detector = touch_detector_of(config);
  auto running =
      run(drivers::CounterCardDevice::create(options, std::move(link), start.time, detector.get()),
          thread_options(config.daemon, "abbe-counters", config.daemon.encoder_priority,
                         config.daemon.encoder_cpu));
  ABBE_TRY(running);

  return std::make_unique<RunningCard>(std::move(detector), std::move(*running), start.first);
}

class CardDecoder final : public RawDecoders {
 public:
  CardDecoder(const Config& config, const std::optional<CountingProgress>& left)
      : name_(config.of<CounterCardConfig>()->card.name),
        decimation_(config.of<CounterCardConfig>()->sample_every),
        touch_detector_(touch_detector_of(config)) {
    auto options = device_options(*config.of<CounterCardConfig>(), config.daemon.speed).receiver;
    options.resume_from = left;
    receiver_ = std::make_unique<drivers::CounterCardReceiver>(options);
  }

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) override {
    if (device != name_) return;
    receiver_->on_raw(block, [&](const drivers::CounterScan& scan) {
      if (const auto sample = decimation_.take(scan.axes)) batch.axes.push_back(*sample);
      if (touch_detector_) detect(scan, batch);
    });
  }

 private:
  void detect(const drivers::CounterScan& scan, Batch& batch) {
    touch_detector_->on_scan(scan);
    std::array<protocol::ProbeTrigger, 1> touch;
    while (touch_detector_->touches().pop(touch) == 1) batch.touches.push_back(touch[0]);
  }

  std::string name_;
  drivers::ScanDecimation decimation_;
  TouchDetectorPointer touch_detector_;
  std::unique_ptr<drivers::CounterCardReceiver> receiver_;
};

void name_counter_card(const Config& config, DeviceNames& names) {
  const auto& counter = config.of<CounterCardConfig>();
  if (!counter) return;
  names.axes = counter->card.name;
  names.all.push_back(counter->card.name);
  if (const auto& probe = config.of<ProbeConfig>()) names.touches = probe->name;
}

std::unique_ptr<RawDecoders> decoders_of_counter_card(const Config& config,
                                                      const std::optional<CountingProgress>& left) {
  return config.of<CounterCardConfig>() ? std::make_unique<CardDecoder>(config, left) : nullptr;
}

}  // namespace

drivers::CounterCardOptions device_options(const CounterCardConfig& config, double speed) {
  auto options = card_options(config.card, speed);
  options.sample_every = config.sample_every;
  return options;
}

const DeviceKind kCounterCard{.name = &name_counter_card,
                              .start = &start_counter_card,
                              .decoders = &decoders_of_counter_card};

}  // namespace abbe::daemon
