#pragma once
/// A whole file mapped into memory for reading.

#include <cstddef>
#include <filesystem>
#include <span>

#include "abbe/base/error.hpp"

namespace abbe::daemon::recording {

class MappedFile {
 public:
  /// Error (Io) if the file cannot be opened or mapped. For an empty file bytes() is empty.
  [[nodiscard]] static Result<MappedFile> open(const std::filesystem::path& file);
  MappedFile(MappedFile&& other) noexcept;
  MappedFile& operator=(MappedFile&&) = delete;
  ~MappedFile();

  [[nodiscard]] std::span<const std::byte> bytes() const noexcept { return {data_, size_}; }

 private:
  MappedFile(const std::byte* data, std::size_t size) noexcept : data_(data), size_(size) {}
  const std::byte* data_ = nullptr;
  std::size_t size_ = 0;
};

}  // namespace abbe::daemon::recording
