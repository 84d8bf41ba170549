#pragma once
/// The lock that orders changes of several processes to one store.

#include <chrono>
#include <filesystem>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::daemon {

/// Locks FOLDER/lock (flock) until the descriptor is closed or the process ends. Only processes
/// that may write to the folder can open the file, because any process that can open it can hold
/// the lock. Io after `time_out`; the text names the process that holds the lock if the kernel
/// reports it.
[[nodiscard]] Result<FileDescriptor> lock_store(const std::filesystem::path& folder,
                                                std::chrono::nanoseconds time_out);

}  // namespace abbe::daemon
