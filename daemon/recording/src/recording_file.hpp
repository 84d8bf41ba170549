#pragma once
/// The file that a Recorder writes. Only whole pieces are appended, and the hash of the contents is
/// updated.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "abbe/base/sha256.hpp"

namespace abbe::daemon::recording {

/// An error of the operating system: errno and the attempted operation.
struct IoFault {
  int error = 0;
  std::string what;  ///< "write rec.mcap.part: No space left on device"
};
[[nodiscard]] IoFault io_fault(const char* verb, const std::filesystem::path& file, int error);

/// True for errors about missing space: disk full, quota, or the file size limit of the process.
[[nodiscard]] bool is_disk_full(int error) noexcept;

class RecordingFile {
 public:
  /// Creates `part` (NAME.mcap.part, must not exist), locks it (flock) and makes its directory
  /// entry durable.
  [[nodiscard]] static tl::expected<RecordingFile, IoFault> create(
      const std::filesystem::path& part);
  RecordingFile(RecordingFile&&) noexcept;
  RecordingFile& operator=(RecordingFile&&) noexcept;
  ~RecordingFile();

  /// Appends all of `piece`, with one pwrite unless the system accepts only a part of it. After a
  /// failure the file is cut back to the size before the call.
  [[nodiscard]] tl::expected<void, IoFault> append(std::span<const std::byte> piece);
  /// Calls fdatasync. After a failure the file stays damaged(), even if a later call succeeds:
  /// Linux reports a write-back error only once.
  [[nodiscard]] tl::expected<void, IoFault> sync();
  /// Closes the file: fsync, rename to NAME.mcap or, if damaged(), to NAME.damaged.mcap (neither
  /// may exist), and fsync of the directory. The file is closed even if fsync failed.
  [[nodiscard]] tl::expected<void, IoFault> finish();
  /// Closes and removes the file. For a file that contains no message.
  void discard() noexcept;

  /// True if the disk reported an error while the file was written. The file then gets the name
  /// NAME.damaged.mcap(.part).
  [[nodiscard]] bool damaged() const noexcept { return damaged_; }
  [[nodiscard]] bool is_open() const noexcept { return fd_ >= 0; }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] std::string sha256() const { return hash_->hex_so_far(); }
  /// Free space, for an unprivileged process, of the file system that contains the file.
  [[nodiscard]] std::uint64_t free_bytes() const noexcept;

 private:
  RecordingFile(int fd, std::filesystem::path path);
  void close() noexcept;
  void mark_damaged();
  [[nodiscard]] std::filesystem::path finished_path() const;

  int fd_ = -1;
  bool damaged_ = false;
  std::filesystem::path path_;
  std::uint64_t size_ = 0;
  std::unique_ptr<Sha256> hash_;
};

[[nodiscard]] std::uint64_t free_bytes_of(const std::filesystem::path& directory) noexcept;

}  // namespace abbe::daemon::recording
