#pragma once
/// A bound on how long an idle processor may take to wake, kept by the kernel for all processors
/// while a file is open (Linux PM QoS). Deep sleep saves power and costs hundreds of microseconds,
/// by which a device's interrupt, and so its kernel time stamp, is late. Ordinary world.

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <memory>

#include "abbe/drivers/error.hpp"

namespace abbe::drivers {

inline constexpr const char* kCpuLatencyFile = "/dev/cpu_dma_latency";

/// As long as it lives; no child inherits it.
class CpuLatencyBound {
 public:
  /// 0: processors without work spin instead of sleeping. Error: the file and what refused it.
  [[nodiscard]] static Result<CpuLatencyBound> request(
      std::chrono::microseconds at_most, const std::filesystem::path& file = kCpuLatencyFile);

 private:
  struct Close {
    void operator()(std::FILE* file) const noexcept { std::fclose(file); }
  };
  using File = std::unique_ptr<std::FILE, Close>;
  explicit CpuLatencyBound(File held) : held_(std::move(held)) {}

  File held_;  ///< closed: the bound is gone
};

}  // namespace abbe::drivers
