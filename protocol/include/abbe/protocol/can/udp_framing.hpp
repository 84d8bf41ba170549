#pragma once
/// CAN frames in UDP datagrams, in the cannelloni framing (BE: big-endian):
///   header:    u8 version 2 | u8 opcode 0 | u8 sequence | u16 BE count
///   per frame: u32 BE id with Linux's flag bits (80000000h EFF, 40000000h RTR, 20000000h error)
///              | u8 length (bit 7: CAN FD, one more byte of FD flags follows)
///              | data (none for RTR)
/// Pure, no allocation. The decoder accepts any bytes and checks the whole datagram before it
/// returns the first frame.

#include <cstddef>
#include <cstdint>
#include <span>

#include <tl/expected.hpp>

#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/rt.hpp"

namespace abbe::protocol::can {

inline constexpr std::size_t kDatagramHeader = 5;
/// Bytes of an encoded frame.
[[nodiscard]] std::size_t encoded_size(const CanFrame& frame) ABBE_RT;

/// Writes frames into the caller's buffer. add() returns false if the frame does not fit: then send
/// the bytes of finish() and use a new writer.
class DatagramWriter {
 public:
  /// `buffer` holds at least kDatagramHeader bytes and outlives the writer.
  DatagramWriter(std::span<std::byte> buffer, std::uint8_t sequence) ABBE_RT;
  [[nodiscard]] bool add(const CanFrame& frame) ABBE_RT;
  /// The datagram so far, header included.
  [[nodiscard]] std::span<const std::byte> finish() ABBE_RT;
  [[nodiscard]] std::size_t count() const ABBE_RT { return count_; }

 private:
  std::span<std::byte> buffer_;
  std::size_t size_ = kDatagramHeader;
  std::size_t count_ = 0;
};

enum class DatagramError : std::uint8_t {
  TooShort,  ///< shorter than the header
  BadVersion,
  BadOpcode,
  Truncated,      ///< fewer frames than announced
  TrailingBytes,  ///< more bytes than the announced frames need
  BadLength,      ///< a frame is longer than its format allows
  BadId,          ///< an 11-bit frame has a longer identifier
};
[[nodiscard]] const char* to_text(DatagramError error) noexcept;

/// A valid datagram; returns its frames one by one. The bytes must outlive the view.
class DatagramView {
 public:
  [[nodiscard]] static tl::expected<DatagramView, DatagramError> parse(
      std::span<const std::byte> bytes) ABBE_RT;
  [[nodiscard]] std::uint8_t sequence() const ABBE_RT { return sequence_; }
  [[nodiscard]] std::size_t count() const ABBE_RT { return count_; }
  /// Stores the next frame in `frame`; false after the last one.
  [[nodiscard]] bool next(CanFrame& frame) ABBE_RT;

 private:
  DatagramView(std::span<const std::byte> frames, std::uint8_t sequence,
               std::uint16_t count) ABBE_RT : rest_(frames),
                                              sequence_(sequence),
                                              count_(count),
                                              left_(count) {}
  std::span<const std::byte> rest_;
  std::uint8_t sequence_;
  std::uint16_t count_;
  std::uint16_t left_;
};

/// Counts lost datagrams by their sequence number, which wraps at 256. A datagram whose number is
/// up to 128 before the expected one is late: it is counted as late and does not change the
/// expected number.
class SequenceGaps {
 public:
  /// Returns the number of datagrams missing between the last one and this one.
  unsigned on_sequence(std::uint8_t sequence) ABBE_RT;
  /// Call when the peer restarted: the next number is accepted without a check.
  void restart() ABBE_RT { started_ = false; }
  [[nodiscard]] std::uint64_t lost() const ABBE_RT { return lost_; }
  [[nodiscard]] std::uint64_t late() const ABBE_RT { return late_; }

 private:
  bool started_ = false;
  std::uint8_t expected_ = 0;
  std::uint64_t lost_ = 0;
  std::uint64_t late_ = 0;
};

}  // namespace abbe::protocol::can
