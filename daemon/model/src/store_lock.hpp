#pragma once
/// The lock that orders the changes of several processes to one store.

#include <chrono>
#include <filesystem>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"

namespace abbe::daemon {

/// Locks FOLDER/lock (flock) until the descriptor is closed or the process dies. The file can be
/// opened only by who may write to the folder: anybody who can open it can hold it. Io after
/// `patience`, naming the holder where the kernel shows it.
[[nodiscard]] Result<FileDescriptor> lock_store(const std::filesystem::path& folder,
                                                std::chrono::nanoseconds patience);

}  // namespace abbe::daemon
