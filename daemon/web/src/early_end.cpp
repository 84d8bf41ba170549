#include "early_end.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdint>
#include <fstream>

namespace abbe::web {
namespace {

constexpr std::chrono::milliseconds kMemoryPeriod{100};

/// 0 if it is not known.
std::uint64_t resident_bytes() {
  std::ifstream file("/proc/self/statm");
  std::uint64_t size_pages = 0, resident_pages = 0;
  if (!(file >> size_pages >> resident_pages)) return 0;
  return resident_pages * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
}

}  // namespace

std::optional<std::string> EarlyEnd::reason_now() {
  if (std::string why = ended_(); !why.empty()) return why;
  const auto now = Clock::now();
  if (now > begin_ + limits_.time)
    return fmt::format("the {} took longer than {} min and was ended", what_, limits_.time.count());
  if (now < next_memory_) return std::nullopt;
  next_memory_ = now + kMemoryPeriod;
  if (resident_bytes() > limits_.memory_bytes)
    return fmt::format("abbe-web has more than {} MiB of memory: the {} was ended",
                       limits_.memory_bytes >> 20, what_);
  return std::nullopt;
}

}  // namespace abbe::web
