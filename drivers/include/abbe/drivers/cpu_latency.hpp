#pragma once
/// A bound on how long an idle processor may take to wake, kept by the kernel for all processors while a file
/// is open (Linux PM QoS). Deep sleep saves power and costs hundreds of microseconds, by which a device's
/// interrupt, and so its kernel time stamp, is late. Ordinary world.

#include <chrono>
#include <filesystem>
#include <fstream>

#include "abbe/drivers/error.hpp"

namespace abbe::drivers {

inline constexpr const char* kCpuLatencyFile = "/dev/cpu_dma_latency";

/// As long as it lives.
class CpuLatencyBound {
 public:
  /// 0: processors without work spin instead of sleeping. Error: the file and what refused it.
  [[nodiscard]] static Result<CpuLatencyBound> request(std::chrono::microseconds at_most,
                                                       const std::filesystem::path& file = kCpuLatencyFile);

 private:
  explicit CpuLatencyBound(std::fstream held) : held_(std::move(held)) {}

  std::fstream held_;  ///< closed: the bound is gone
};

}  // namespace abbe::drivers
