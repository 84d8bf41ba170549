#pragma once
/// SHA-256 [FIPS 180-4] by OpenSSL, as the hexadecimal text used in models and recordings.

#include <cstddef>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

#include "abbe/base/error.hpp"

namespace abbe::daemon {

/// Running hash; not copyable, not thread-safe.
class Sha256 {
 public:
  Sha256();
  Sha256(const Sha256&) = delete;
  Sha256& operator=(const Sha256&) = delete;
  ~Sha256();

  void update(std::span<const std::byte> bytes);
  void update(std::string_view text);
  /// Adds the bytes of a value, as they lie in memory. The type must have no padding.
  template <class T>
  requires std::is_trivially_copyable_v<T>
  void update_bytes_of(const T& value) { update(std::as_bytes(std::span{&value, 1})); }
  [[nodiscard]] std::string hex();  ///< 64 lower-case digits; the hash is finished afterwards
  /// hash of the bytes added so far; more bytes may follow
  [[nodiscard]] std::string hex_so_far() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

[[nodiscard]] std::string sha256_hex(std::string_view text);
[[nodiscard]] Result<std::string> sha256_hex_of_file(const std::filesystem::path& file);

}  // namespace abbe::daemon
