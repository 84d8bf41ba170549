#include "abbe/drivers/cpu_latency.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>

namespace abbe::drivers {

Result<CpuLatencyBound> CpuLatencyBound::request(std::chrono::microseconds at_most,
                                                 const std::filesystem::path& file) {
  // Both ways: only so a file that is not there stays so.
  std::fstream held(file, std::ios::in | std::ios::out | std::ios::binary);
  const auto microseconds = static_cast<std::int32_t>(at_most.count());
  if (held && held.write(reinterpret_cast<const char*>(&microseconds), sizeof microseconds).flush())
    return CpuLatencyBound(std::move(held));
  return tl::unexpected(
      Error{ErrorCode::SystemRefused, fmt::format("a bound of {} us on the processors' waking: {}: {}",
                                                  at_most.count(), file.string(), std::strerror(errno))});
}

}  // namespace abbe::drivers
