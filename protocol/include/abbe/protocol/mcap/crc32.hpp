#pragma once
/// CRC-32 as MCAP wants it: IEEE 802.3, polynomial 0x04C11DB7 reflected, start and final XOR all
/// ones (the one of zlib, PNG and Ethernet). Eight bytes a step by eight tables
/// [Kounavis, Berry 2008, "slicing-by-8"]. Pure; noexcept.

#include <cstddef>
#include <cstdint>
#include <span>

namespace abbe::protocol::mcap {

/// A checksum that grows: update() with the pieces of a stream in order gives the checksum of the
/// whole.
class Crc32 {
 public:
  void update(std::span<const std::byte> bytes) noexcept;
  [[nodiscard]] std::uint32_t value() const noexcept { return ~state_; }

 private:
  std::uint32_t state_ = 0xFFFFFFFFu;
};

[[nodiscard]] std::uint32_t crc32(std::span<const std::byte> bytes) noexcept;

}  // namespace abbe::protocol::mcap
