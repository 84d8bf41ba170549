#pragma once
/// The bytes of a recording on the disk, read piece by piece. The file is not mapped: a mapped file
/// that becomes shorter ends the process with SIGBUS, and a recording may be larger than the
/// memory.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "abbe/base/error.hpp"
#include "abbe/base/file_descriptor.hpp"
#include "abbe/protocol/mcap/records.hpp"

namespace abbe::daemon::recording {

/// Const functions may be called by several threads.
class RecordedBytes {
 public:
  /// Error (Io) if `file` cannot be opened or is not a regular file.
  [[nodiscard]] static Result<std::unique_ptr<RecordedBytes>> open(
      const std::filesystem::path& file);

  /// size when the file was opened
  [[nodiscard]] std::uint64_t size() const noexcept { return size_; }
  /// Fills `out`. False if the file does not have these bytes any more or cannot be read; intact()
  /// is then an Error.
  [[nodiscard]] bool read(std::uint64_t offset, std::span<std::byte> out) const;
  /// Records that the content of the file has changed.
  void mark_changed() const;
  /// Error (Io) of the first failure; no error if all bytes that were requested could be read.
  [[nodiscard]] Result<void> intact() const;

 private:
  RecordedBytes(FileDescriptor fd, std::filesystem::path file, std::uint64_t size);
  void fail_with(const char* what) const;

  FileDescriptor fd_;
  std::filesystem::path file_;
  std::uint64_t size_;
  mutable std::mutex mutex_;
  mutable std::optional<Error> failure_;  ///< guarded by mutex_
};

/// A part of the file in memory, for reading from the front to the end. Belongs to one thread.
class ByteWindow {
 public:
  explicit ByteWindow(const RecordedBytes& file) : file_(file) {}
  /// The bytes from `offset` on, at most `length` of them, fewer at the end of the file. Valid
  /// until the next call. nullopt if they cannot be read.
  [[nodiscard]] std::optional<protocol::mcap::Bytes> at(std::uint64_t offset, std::uint64_t length);
  [[nodiscard]] std::uint64_t file_size() const noexcept { return file_.size(); }

 private:
  const RecordedBytes& file_;
  std::vector<std::byte> buffer_;
  std::uint64_t begin_ = 0, size_ = 0;  ///< position and size of the valid part of the buffer
};

}  // namespace abbe::daemon::recording
