#pragma once
/// CRC-32 of MCAP: IEEE 802.3, polynomial 0x04C11DB7 reflected, initial value and final XOR all
/// ones (as in zlib, PNG and Ethernet). Processes eight bytes per step with eight tables
/// [Kounavis, Berry 2008, "slicing-by-8"]. Pure; noexcept.

#include <cstddef>
#include <cstdint>
#include <span>

namespace abbe::protocol::mcap {

/// Incremental checksum: calling update() with all pieces of a stream in order gives the checksum
/// of the whole stream.
class Crc32 {
 public:
  void update(std::span<const std::byte> bytes) noexcept;
  [[nodiscard]] std::uint32_t value() const noexcept { return ~state_; }

 private:
  std::uint32_t state_ = 0xFFFFFFFFu;
};

[[nodiscard]] std::uint32_t crc32(std::span<const std::byte> bytes) noexcept;

}  // namespace abbe::protocol::mcap
