#include <string>

#include "abbe/drivers/counter_card/receiver.hpp"
#include "abbe/drivers/sampling/mark_watcher.hpp"
#include "abbe/result/try.hpp"
#include "card_link.hpp"
#include "kinds.hpp"
#include "running.hpp"

namespace abbe::daemon {
namespace {

/// The second counter card, which latches the axes on their reference marks.
class RunningReferenceCard final : public RunningDevices {
 public:
  /// `start` starts the card; its argument is the mark watcher to which the card passes its scans.
  template <class Start>
  [[nodiscard]] static Result<std::unique_ptr<RunningDevices>> of(std::size_t place,
                                                                  const Start& start) {
    auto made = std::make_unique<RunningReferenceCard>();
    auto running = start(made->mark_watcher_);
    ABBE_TRY(running);
    made->running_ = std::move(*running);
    made->place_ = place;
    return made;
  }

  void drain(Batch& batch) override {
    while (const std::size_t n = mark_watcher_.crossings().pop(marks_))
      batch.marks.insert(batch.marks.end(), marks_.begin(),
                         marks_.begin() + static_cast<std::ptrdiff_t>(n));
    drain_raw(running_.device->raw(), blocks_, place_, batch);
  }
  [[nodiscard]] std::vector<const drivers::DeviceThread*> threads() const override {
    return {running_.thread.get()};
  }
  [[nodiscard]] std::vector<std::string> warnings() const override {
    return with_assumption(RunningDevices::warnings(), *running_.device);
  }

 private:
  // The card calls the watcher, so the card (below) must be destroyed first.
  drivers::MarkWatcher mark_watcher_;
  Running<drivers::CounterCardDevice> running_;
  std::size_t place_ = 0;
  std::array<drivers::MarkCrossing, 64> marks_;
  BlockBuffer blocks_;
};

Result<std::unique_ptr<RunningDevices>> start_reference_card(const DeviceStart& start) {
  const Config& config = start.config;
  const auto& reference = config.of<ReferenceConfig>();
  if (!reference) return nullptr;
  const UsbCardConfig& card = reference->card;
  const auto options = card_options(card, config.daemon.speed);

  return RunningReferenceCard::of(start.first, [&](drivers::MarkWatcher& watcher) {
    return run(drivers::CounterCardDevice::create(
                   options, make_link(card, drivers::identity_of(options), start.time), start.time,
                   &watcher),
               thread_options(config.daemon, "abbe-marks", config.daemon.encoder_priority,
                              config.daemon.encoder_cpu));
  });
}

class ReferenceCardDecoder final : public RawDecoders {
 public:
  explicit ReferenceCardDecoder(const Config& config)
      : name_(config.of<ReferenceConfig>()->card.name),
        receiver_(std::make_unique<drivers::CounterCardReceiver>(
            card_options(config.of<ReferenceConfig>()->card, config.daemon.speed).receiver)) {}

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) override {
    if (device != name_) return;
    receiver_->on_raw(block, [&](const drivers::CounterScan& scan) { watch(scan, batch); });
  }

 private:
  void watch(const drivers::CounterScan& scan, Batch& batch) {
    mark_watcher_.on_scan(scan);
    for (drivers::MarkCrossing crossing; mark_watcher_.crossings().pop({&crossing, 1}) == 1;)
      batch.marks.push_back(crossing);
  }

  std::string name_;
  std::unique_ptr<drivers::CounterCardReceiver> receiver_;
  drivers::MarkWatcher mark_watcher_;
};

void name_reference_card(const Config& config, DeviceNames& names) {
  if (const auto& reference = config.of<ReferenceConfig>())
    names.all.push_back(reference->card.name);
}

std::unique_ptr<RawDecoders> decoders_of_reference_card(const Config& config,
                                                        const std::optional<CountingProgress>&) {
  return config.of<ReferenceConfig>() ? std::make_unique<ReferenceCardDecoder>(config) : nullptr;
}

}  // namespace

const DeviceKind kReferenceCard{.name = &name_reference_card,
                                .start = &start_reference_card,
                                .decoders = &decoders_of_reference_card};

}  // namespace abbe::daemon
