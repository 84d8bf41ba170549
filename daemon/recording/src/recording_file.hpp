#pragma once
/// The file a Recorder writes: it grows by whole pieces only, and knows the hash of what is in it.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "abbe/base/sha256.hpp"

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
  /// Creates `part` (NAME.mcap.part, must not exist), locks it (flock) and makes its directory
  /// entry durable.
  [[nodiscard]] static tl::expected<RecordingFile, IoFault> create(
      const std::filesystem::path& part);
  RecordingFile(RecordingFile&&) noexcept;
  RecordingFile& operator=(RecordingFile&&) noexcept;
  ~RecordingFile();

  /// All of `piece` with one pwrite if the system takes it at once, or nothing: after a failure the
  /// file is cut back to what it was.
  [[nodiscard]] tl::expected<void, IoFault> append(std::span<const std::byte> piece);
  /// After a failure the file is damaged() for good: Linux reports an error of write-back once, so
  /// a later success proves nothing.
  [[nodiscard]] tl::expected<void, IoFault> sync();
  /// fsync, rename to NAME.mcap or NAME.damaged.mcap (which must not exist), fsync of the
  /// directory. The file is closed, also where fsync failed and it became damaged().
  [[nodiscard]] tl::expected<void, IoFault> finish();
  /// Removes it again: nothing worth keeping was written.
  void discard() noexcept;

  /// The disk reported an error while it was written; its name says so, too:
  /// NAME.damaged.mcap(.part).
  [[nodiscard]] bool damaged() const noexcept { return damaged_; }
  [[nodiscard]] bool is_open() const noexcept { return fd_ >= 0; }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  [[nodiscard]] std::string sha256() const { return hash_->hex_so_far(); }
  /// Of the file system it lies on, for an unprivileged process.
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
