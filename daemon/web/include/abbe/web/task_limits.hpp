#pragma once

#include <chrono>
#include <cstdint>

namespace abbe::web {

/// A replay or an identification that exceeds one of them ends and has failed, at the latest when
/// the identification with a bar or an array that is under way has ended.
struct TaskLimits {
  std::chrono::minutes time{60};
  /// Resident memory of the whole process, looked at between the steps of a task: far below
  /// MemoryMax of abbe-web.service, so that a task ends before the kernel ends abbe-web.
  std::uint64_t memory_bytes = std::uint64_t{1} << 30;
};

}  // namespace abbe::web
