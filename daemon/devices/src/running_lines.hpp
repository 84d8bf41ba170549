#pragma once
/// A device that sends lines of text, as running device and as decoder of its recording.

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "abbe/devices/device_kind.hpp"
#include "abbe/drivers/lines/device.hpp"
#include "running.hpp"

namespace abbe::daemon {

/// `kStream`: the samples in a Batch.
template <class Content, std::vector<typename Content::Sample> Batch::*kStream>
class RunningLines : public RunningDevices {
 public:
  /// `place`: index in DeviceNames::all. `rate_hz`: as nominal_rate_hz().
  RunningLines(Running<drivers::LineDevice<Content>> running, std::size_t place, double rate_hz)
      : running_(std::move(running)), place_(place), rate_hz_(rate_hz) {}

  void drain(Batch& batch) override {
    drain_ring(running_.device->samples(), samples_, batch.*kStream);
    drain_raw(running_.device->raw(), blocks_, place_, batch);
  }
  [[nodiscard]] std::vector<const drivers::DeviceThread*> threads() const override {
    return {running_.thread.get()};
  }
  [[nodiscard]] double nominal_rate_hz() const override { return rate_hz_; }

 protected:
  [[nodiscard]] drivers::DeviceStatus device_status() const { return running_.thread->status(); }

 private:
  Running<drivers::LineDevice<Content>> running_;
  std::size_t place_;
  double rate_hz_;
  std::array<typename Content::Sample, kMostSamples> samples_;
  BlockBuffer blocks_;
};

template <class Content, std::vector<typename Content::Sample> Batch::*kStream>
class LinesDecoder final : public RawDecoders {
 public:
  explicit LinesDecoder(const drivers::LineDeviceOptions<Content>& options)
      : name_(options.name), blocks_(drivers::receiver_options(options)) {}

  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch) override {
    if (device != name_) return;
    auto& out = batch.*kStream;
    blocks_.take(block,
                 [&](auto samples) { out.insert(out.end(), samples.begin(), samples.end()); });
  }

 private:
  std::string name_;
  drivers::LineBlocks<drivers::LineReceiverOf<Content>> blocks_;
};

}  // namespace abbe::daemon
