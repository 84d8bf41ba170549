#pragma once
/// Raw device bytes into the samples they were decoded to, by the same receivers as live. One
/// thread.

#include <cstddef>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/drivers/counter_card/decimation.hpp"
#include "abbe/drivers/counter_card/receiver.hpp"
#include "abbe/drivers/environment/receiver.hpp"
#include "abbe/drivers/ippdme/receiver.hpp"
#include "abbe/drivers/sampling/mark_watcher.hpp"
#include "abbe/drivers/sampling/touch_detector.hpp"
#include "abbe/drivers/tracker/receiver.hpp"
#include "abbe/pipeline/batch.hpp"

namespace abbe::daemon {

class RawDecoder {
 public:
  /// `left`: as the live run was told (CounterCardReceiverOptions::goes_on_from).
  explicit RawDecoder(const Config& config,
                      const std::optional<drivers::CounterCardProgress>& left = std::nullopt);

  /// Appends to `batch` what the bytes complete; those of a device that `config` does not have give
  /// nothing.
  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch);

 private:
  void take_tracker(const protocol::RawBlock& block, Batch& batch);
  void detect(const drivers::CounterScan& scan, Batch& batch);
  void watch(const drivers::CounterScan& scan, Batch& batch);
  void take_cmm(const protocol::RawBlock& block, Batch& batch);

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
  drivers::ScanDecimation decimation_{1};
  std::string reference_name_;
  std::unique_ptr<drivers::CounterCardReceiver> reference_card_;
  drivers::MarkWatcher mark_watcher_;
  std::vector<std::string> environment_names_;
  std::vector<drivers::EnvironmentReceiver> environment_;
};

}  // namespace abbe::daemon
