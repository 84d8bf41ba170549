#pragma once
/// Decodes the raw bytes of all devices in a recording into samples. One thread.

#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/devices/device_kind.hpp"
#include "abbe/pipeline/batch.hpp"

namespace abbe::daemon {

class RawDecoder {
 public:
  /// `left`: the state of the counters with which the live run started; see DeviceStart.
  explicit RawDecoder(const Config& config,
                      const std::optional<CountingProgress>& left = std::nullopt);

  /// Appends the samples that are complete with this block. Ignores a block from a device that
  /// `config` does not have.
  void take(const protocol::RawBlock& block, std::string_view device, Batch& batch);
  /// Call it at the end of the recording: appends the samples that waited for further blocks.
  void finish(Batch& batch);

 private:
  std::vector<std::unique_ptr<RawDecoders>> decoders_;
};

}  // namespace abbe::daemon
