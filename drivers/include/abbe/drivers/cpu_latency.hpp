#pragma once
/// Limits the time that an idle processor needs to wake up. The kernel keeps the limit for all
/// processors while the file /dev/cpu_dma_latency is open (Linux PM QoS). Without a limit, a
/// processor in deep sleep delays a device's interrupt, and so its kernel time stamp, by hundreds
/// of microseconds. Not for the real-time path.

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "abbe/drivers/error.hpp"

namespace abbe::drivers {

inline constexpr const char* kCpuLatencyFile = "/dev/cpu_dma_latency";

/// The limit applies during the lifetime of this object. Child processes do not inherit it.
class CpuLatencyBound {
 public:
  /// `at_most`: limit of the wake-up time; 0 makes idle processors spin instead of sleeping. The
  /// error names the file and the reason.
  [[nodiscard]] static Result<CpuLatencyBound> request(
      std::chrono::microseconds at_most, const std::filesystem::path& file = kCpuLatencyFile);

 private:
  struct Close {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };
  using File = std::unique_ptr<std::FILE, Close>;
  explicit CpuLatencyBound(File held) : held_(std::move(held)) {}

  File held_;  ///< closing it removes the limit
};

}  // namespace abbe::drivers
