#pragma once
/// CAN frames in UDP datagrams, the cannelloni framing: u8 version 2, u8 opcode 0, u8 sequence, u16
/// BE count, then per frame u32 BE id with Linux's flag bits (80000000h EFF, 40000000h RTR,
/// 20000000h error), u8 length (bit 7: CAN FD, then one more byte of FD flags), data (none for
/// RTR). Pure, no allocation; the decoder is total and checks the whole datagram before it gives
/// the first frame.

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

/// Writes frames into a caller's buffer. add() is false when the next frame does not fit: send
/// finish(), start anew.
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
  TooShort,  ///< no room for the header
  BadVersion,
  BadOpcode,
  Truncated,      ///< fewer frames than announced
  TrailingBytes,  ///< more bytes than the announced frames need
  BadLength,      ///< a frame longer than its format allows
  BadId,          ///< an 11-bit frame with a longer identifier
};
[[nodiscard]] const char* to_text(DatagramError error) noexcept;

/// A checked datagram; walks its frames. The bytes must outlive the view.
class DatagramView {
 public:
  [[nodiscard]] static tl::expected<DatagramView, DatagramError> parse(
      std::span<const std::byte> bytes) ABBE_RT;
  [[nodiscard]] std::uint8_t sequence() const ABBE_RT { return sequence_; }
  [[nodiscard]] std::size_t count() const ABBE_RT { return count_; }
  /// The next frame into `frame`; false after the last.
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

/// Lost datagrams by their sequence number, which wraps at 256. A number from the half before the
/// expected one is an old datagram that comes late: counted as such, it does not move the
/// expectation.
class SequenceGaps {
 public:
  /// How many datagrams are missing between the last one and this one.
  unsigned on_sequence(std::uint8_t sequence) ABBE_RT;
  /// The peer began anew: the next number is taken as it comes.
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
