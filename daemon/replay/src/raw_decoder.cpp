#include "raw_decoder.hpp"

#include <utility>

namespace abbe::daemon {

RawDecoder::RawDecoder(const Config& config, const std::optional<CountingProgress>& left) {
  for (const DeviceKind& kind : device_kinds()) {
    if (auto decoders = kind.decoders(config, left)) decoders_.push_back(std::move(decoders));
  }
}

void RawDecoder::take(const protocol::RawBlock& block, std::string_view device, Batch& batch) {
  for (const auto& decoders : decoders_) decoders->take(block, device, batch);
}

void RawDecoder::finish(Batch& batch) {
  for (const auto& decoders : decoders_) decoders->finish(batch);
}

}  // namespace abbe::daemon
