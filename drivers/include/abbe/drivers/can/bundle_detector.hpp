#pragma once
/// Detects bundles: several answers of one node with the same arrival time. The cause is a tunnel
/// or gateway that collects frames for longer than a SYNC period and sends them together
/// (cannelloni: 0.1 s by default). The answers then arrive after the end of their cycle, so every
/// cycle is lost. Sans-I/O. One thread.

#include <array>
#include <cstdint>

#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/protocol/can/canopen.hpp"

namespace abbe::drivers {

class BundleDetector {
 public:
  /// Least number of answers that counts as a bundle. Two answers also have the same arrival time
  /// if one of them was late.
  static constexpr unsigned kBundle = 3;

  void on_frame(const ReceivedFrame& received) {
    constexpr std::uint8_t kPositionBytes = 4;
    if (received.time_widened || !can::cob::is_tpdo(received.frame)) return;
    if (received.frame.length < kPositionBytes) return;
    auto& last = last_[received.frame.id & can::kMaxNodeId];
    last.answers = received.time == last.at ? last.answers + 1 : 1;
    last.at = received.time;
    if (last.answers == kBundle) ++count_;
  }
  /// Number of bundles since construction.
  [[nodiscard]] std::uint64_t count() const { return count_; }

 private:
  struct Last {
    protocol::HostTime at{};
    unsigned answers = 0;
  };
  std::array<Last, std::size_t{can::kMaxNodeId} + 1> last_{};
  std::uint64_t count_ = 0;
};

}  // namespace abbe::drivers
