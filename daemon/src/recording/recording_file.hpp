#pragma once
/// The file a Recorder writes: it grows by whole pieces only, and knows the hash of what is in it.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "abbe/daemon/sha256.hpp"

namespace abbe::daemon::recording {

/// What the operating system said: errno, and what was tried.
struct IoFault {
  int error = 0;
  std::string what;  ///< "write rec.mcap.part: No space left on device"
};
[[nodiscard]] IoFault io_fault(const char* verb, const std::filesystem::path& file, int error);

/// No room: the disk, a quota or the process's file size limit.
[[nodiscard]] bool is_disk_full(int error) noexcept;

class RecordingFile {
 public:
  /// Creates `part` (it must not exist) and makes its directory entry durable.
  [[nodiscard]] static tl::expected<RecordingFile, IoFault> create(const std::filesystem::path& part);
  RecordingFile(RecordingFile&&) noexcept;
  RecordingFile& operator=(RecordingFile&&) noexcept;
  ~RecordingFile();

  /// All of `piece` with one pwrite if the system takes it at once, or nothing: after a failure the file is
  /// cut back to what it was.
  [[nodiscard]] tl::expected<void, IoFault> append(std::span<const std::byte> piece);
  [[nodiscard]] tl::expected<void, IoFault> sync();
  /// fsync, rename to `finished` (which must not exist), fsync of the directory. The file is closed.
  [[nodiscard]] tl::expected<void, IoFault> finish(const std::filesystem::path& finished);
  /// Removes it again: nothing worth keeping was written.
  void discard() noexcept;

  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] std::string sha256() const { return hash_->hex_so_far(); }
  /// Of the file system it lies on, for an unprivileged process.
  [[nodiscard]] std::uint64_t free_bytes() const noexcept;

 private:
  RecordingFile(int fd, std::filesystem::path path);
  void close() noexcept;

  int fd_ = -1;
  std::filesystem::path path_;
  std::uint64_t size_ = 0;
  std::unique_ptr<Sha256> hash_;
};

[[nodiscard]] std::uint64_t free_bytes_of(const std::filesystem::path& directory) noexcept;

}  // namespace abbe::daemon::recording
