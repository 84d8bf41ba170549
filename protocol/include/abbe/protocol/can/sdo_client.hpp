#pragma once
/// One SDO transfer at a time with one node: expedited and segmented, both directions [CiA 301].
/// Sans-I/O: frames and a time in, frames out. No allocation. Not thread-safe; not for the
/// real-time path.
///
/// Use: call start_*(). After every start_*(), on_frame() and on_time(), send the frames of
/// take_frame(). If the server does not answer within `timeout`, the client sends an abort
/// (05040000h) and repeats the transfer, up to `retries` times.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/can/sdo.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::protocol::can {

struct SdoClientOptions {
  std::chrono::nanoseconds timeout = std::chrono::milliseconds{500};
  unsigned retries = 2;
};

class SdoClient {
 public:
  enum class State : std::uint8_t { Idle, Busy, Done, Failed };

  explicit SdoClient(NodeId node, SdoClientOptions options = {}) noexcept
      : node_(node), options_(options) {}

  /// Reads an object. A transfer in progress is discarded.
  void start_upload(ObjectId object, HostTime now) noexcept;
  /// Writes an object of 1 to kMaxSdoBytes bytes; other sizes fail at once with LengthMismatch.
  void start_download(ObjectId object, std::span<const std::byte> value, HostTime now) noexcept;

  /// Takes any frame of the bus; ignores all but the answers to this transfer.
  void on_frame(const CanFrame& frame, HostTime now) noexcept;
  void on_time(HostTime now) noexcept;
  /// The next frame to send. Call it until it returns nullopt.
  [[nodiscard]] std::optional<CanFrame> take_frame() noexcept;

  [[nodiscard]] State state() const noexcept { return state_; }
  [[nodiscard]] ObjectId object() const noexcept { return object_; }
  /// The time at which on_time() must be called; HostTime::max() if no transfer is in progress.
  [[nodiscard]] HostTime deadline() const noexcept {
    return state_ == State::Busy ? deadline_ : HostTime::max();
  }
  /// The reason why the transfer failed, in state Failed; AbortCode::None in other states.
  [[nodiscard]] AbortCode abort_code() const noexcept { return abort_code_; }
  /// True if the server sent the abort, false if this client did.
  [[nodiscard]] bool aborted_by_server() const noexcept { return aborted_by_server_; }
  /// The value read by an upload in state Done, or the value of a download. Valid until the next
  /// start_*().
  [[nodiscard]] std::span<const std::byte> value() const noexcept {
    return {buffer_.data(), size_};
  }
  /// value() as a little-endian number; nullopt unless it has 1 to 8 bytes.
  [[nodiscard]] std::optional<std::uint64_t> number() const noexcept;

 private:
  enum class Phase : std::uint8_t { Initiate, Segments };

  void begin(HostTime now) noexcept;
  void send(const CanFrame& frame) noexcept;
  void fail(AbortCode code, bool by_server) noexcept;
  void abort(AbortCode code) noexcept;
  void send_initiate() noexcept;
  void request_segment() noexcept;
  void send_segment() noexcept;
  void on_initiate_answer(const CanFrame& frame) noexcept;
  void on_upload_initiated(const CanFrame& frame) noexcept;
  void on_upload_segment(const CanFrame& frame) noexcept;
  void on_download_segment(const CanFrame& frame) noexcept;

  NodeId node_;
  SdoClientOptions options_;
  State state_ = State::Idle;
  Phase phase_ = Phase::Initiate;
  bool upload_ = false;
  bool toggle_ = false;
  bool aborted_by_server_ = false;
  AbortCode abort_code_ = AbortCode::None;
  ObjectId object_;
  HostTime deadline_{};
  unsigned attempts_left_ = 0;
  std::size_t size_ = 0;                    ///< number of valid bytes of `buffer_`
  std::size_t sent_ = 0;                    ///< number of bytes sent of a segmented download
  std::optional<std::uint32_t> announced_;  ///< size the server announced for a segmented upload
  std::array<std::byte, kMaxSdoBytes> buffer_{};
  std::array<CanFrame, 4> outbox_{};  ///< at most abort + new initiate per event
  std::size_t outbox_head_ = 0;
  std::size_t outbox_count_ = 0;
};

}  // namespace abbe::protocol::can
