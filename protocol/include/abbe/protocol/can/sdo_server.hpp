#pragma once
/// SDO server of one node: answers requests from its object dictionary [CiA 301]. Sans-I/O, no
/// allocation. Every request gets an answer or an abort. Not thread-safe. For simulators and tests.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/can/object_dictionary.hpp"
#include "abbe/protocol/can/sdo.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::protocol::can {

class SdoServer {
 public:
  /// `objects` must outlive the server.
  SdoServer(NodeId node, ObjectDictionary& objects,
            std::chrono::nanoseconds timeout = std::chrono::milliseconds{500}) noexcept
      : node_(node), objects_(objects), timeout_(timeout) {}

  /// The answer to send, if the frame is a request to this node.
  [[nodiscard]] std::optional<CanFrame> on_frame(const CanFrame& frame, HostTime now) noexcept;
  /// The abort to send if a client has not continued a segmented transfer for `timeout`.
  [[nodiscard]] std::optional<CanFrame> on_time(HostTime now) noexcept;

 private:
  enum class Transfer : std::uint8_t { None, Upload, Download };

  CanFrame abort(ObjectId object, AbortCode code) noexcept;
  CanFrame start_upload(ObjectId object) noexcept;
  CanFrame start_download(const CanFrame& frame, ObjectId object) noexcept;
  CanFrame upload_segment(const CanFrame& frame) noexcept;
  CanFrame download_segment(const CanFrame& frame) noexcept;

  NodeId node_;
  ObjectDictionary& objects_;
  std::chrono::nanoseconds timeout_;
  Transfer transfer_ = Transfer::None;
  bool toggle_ = false;
  ObjectId object_;
  HostTime deadline_{};
  std::size_t size_ = 0;
  std::size_t done_ = 0;
  std::optional<std::uint32_t> announced_;
  std::array<std::byte, kMaxSdoBytes> buffer_{};
};

}  // namespace abbe::protocol::can
