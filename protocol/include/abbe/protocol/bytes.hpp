#pragma once
/// Bounds-checked reader and writer of bytes, used by all wire formats of this module. Past the end
/// a reader returns zeros, a writer writes nothing, and ok() becomes and stays false. A decoder may
/// therefore read all its fields and check ok() once. No alignment is needed. Not thread-safe;
/// allocation-free, usable on the real-time path.

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "abbe/protocol/rt.hpp"

namespace abbe::protocol {

/// Types with a fixed width on the wire. bool has none: use an integer type of the right width.
template <class T>
concept WireScalar =
    (std::integral<T> && !std::same_as<T, bool>) || std::floating_point<T> || std::is_enum_v<T>;

namespace detail {
template <WireScalar T, std::endian kOrder>
[[nodiscard]] T load(const std::byte* from) ABBE_RT {
  // Not initialised: memcpy() fills it.
  std::array<std::byte, sizeof(T)> raw;  // NOLINT(cppcoreguidelines-pro-type-member-init)
  std::memcpy(raw.data(), from, sizeof(T));
  if constexpr (kOrder != std::endian::native) std::reverse(raw.begin(), raw.end());
  return std::bit_cast<T>(raw);
}

template <WireScalar T, std::endian kOrder>
void store(T value, std::byte* to) ABBE_RT {
  auto raw = std::bit_cast<std::array<std::byte, sizeof(T)>>(value);
  if constexpr (kOrder != std::endian::native) std::reverse(raw.begin(), raw.end());
  std::memcpy(to, raw.data(), sizeof(T));
}
}  // namespace detail

class ByteReader {
 public:
  explicit ByteReader(std::span<const std::byte> bytes) ABBE_RT : bytes_(bytes) {}

  /// The next value, or zero and ok() == false if fewer bytes are left.
  template <WireScalar T>
  [[nodiscard]] T little() ABBE_RT {
    return scalar<T, std::endian::little>();
  }
  template <WireScalar T>
  [[nodiscard]] T big() ABBE_RT {
    return scalar<T, std::endian::big>();
  }

  /// A view of the next `count` bytes, empty and ok() == false if fewer are left.
  [[nodiscard]] std::span<const std::byte> take(std::size_t count) ABBE_RT {
    if (!claim(count)) return {};
    return bytes_.subspan(position_ - count, count);
  }
  void skip(std::size_t count) ABBE_RT { claim(count); }

  [[nodiscard]] bool ok() const ABBE_RT { return ok_; }
  [[nodiscard]] std::size_t position() const ABBE_RT { return position_; }
  [[nodiscard]] std::size_t remaining() const ABBE_RT { return bytes_.size() - position_; }

 private:
  template <WireScalar T, std::endian kOrder>
  T scalar() ABBE_RT {
    if (!claim(sizeof(T))) return T{};
    return detail::load<T, kOrder>(bytes_.data() + position_ - sizeof(T));
  }
  bool claim(std::size_t count) ABBE_RT {
    ok_ = ok_ && count <= remaining();
    if (ok_) position_ += count;
    return ok_;
  }

  std::span<const std::byte> bytes_;
  std::size_t position_ = 0;
  bool ok_ = true;
};

class ByteWriter {
 public:
  explicit ByteWriter(std::span<std::byte> bytes) ABBE_RT : bytes_(bytes) {}

  template <WireScalar T>
  void little(T value) ABBE_RT {
    if (claim(sizeof(T))) detail::store<T, std::endian::little>(value, end() - sizeof(T));
  }
  template <WireScalar T>
  void big(T value) ABBE_RT {
    if (claim(sizeof(T))) detail::store<T, std::endian::big>(value, end() - sizeof(T));
  }
  void put(std::span<const std::byte> bytes) ABBE_RT {
    if (claim(bytes.size()) && !bytes.empty())
      std::memcpy(end() - bytes.size(), bytes.data(), bytes.size());
  }
  void zeros(std::size_t count) ABBE_RT {
    if (claim(count) && count != 0) std::memset(end() - count, 0, count);
  }

  /// False once a value did not fit into the buffer. The values before it are written.
  [[nodiscard]] bool ok() const ABBE_RT { return ok_; }
  [[nodiscard]] std::size_t size() const ABBE_RT { return position_; }
  [[nodiscard]] std::span<const std::byte> written() const ABBE_RT {
    return bytes_.first(position_);
  }

 private:
  bool claim(std::size_t count) ABBE_RT {
    ok_ = ok_ && count <= bytes_.size() - position_;
    if (ok_) position_ += count;
    return ok_;
  }
  [[nodiscard]] std::byte* end() const ABBE_RT { return bytes_.data() + position_; }

  std::span<std::byte> bytes_;
  std::size_t position_ = 0;
  bool ok_ = true;
};

}  // namespace abbe::protocol
