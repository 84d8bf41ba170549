#include "abbe/drivers/cpu_latency.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cstdint>
#include <cstring>
#include <utility>

namespace abbe::drivers {

Result<CpuLatencyBound> CpuLatencyBound::request(std::chrono::microseconds at_most,
                                                 const std::filesystem::path& file) {
  File held(std::fopen(file.c_str(), "r+e"));  // does not create the file; closed on exec
  const auto microseconds = static_cast<std::int32_t>(at_most.count());
  const bool written = held != nullptr && std::setvbuf(held.get(), nullptr, _IONBF, 0) == 0 &&
                       std::fwrite(&microseconds, sizeof microseconds, 1, held.get()) == 1;
  if (written) return CpuLatencyBound(std::move(held));
  return tl::unexpected(
      Error{ErrorCode::SystemRefused,
            fmt::format("limit of {} us for the wake-up time of idle processors: {}: {}",
                        at_most.count(), file.string(), std::strerror(errno))});
}

}  // namespace abbe::drivers
