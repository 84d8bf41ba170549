#pragma once
/// Decodes the lines of an I++ DME server into touches and positions, in SI units and host time.
/// Sans-I/O and deterministic: the same bytes in both directions with the same times give the same
/// samples, live or replayed. The meaning of a response depends on the command with the same tag,
/// so the sent lines are an input, too. Real time: allocation-free, no system call. One thread.
/// About 130 kB: keep it on the heap.
///
/// The protocol has no time stamps. The instant of a position or a touch lies between its command
/// and its answer. Its time is the middle of that interval, with a rectangular distribution over
/// the interval. For a touch this is several seconds; the relevant result is the position that the
/// machine latched.

#include <array>
#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <variant>

#include "abbe/protocol/ippdme/lines.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

namespace ippdme = protocol::ippdme;

struct IppReceiverOptions {
  std::uint32_t probe = 1;
  double u_position_m = 1e-6;  ///< uncertainty of the machine's positions, from its MPE / 2
  /// Largest delay from a position to the unsolicited line that reports it (OnMoveReportE).
  std::chrono::nanoseconds max_report_delay = std::chrono::milliseconds{100};
};

/// Text from a line, truncated to its capacity.
struct IppText {
  std::array<char, 96> characters{};
  std::uint8_t length = 0;
  [[nodiscard]] std::string_view view() const noexcept { return {characters.data(), length}; }
};

struct IppAck {
  ippdme::Tag tag;
};
struct IppComplete {
  ippdme::Tag tag;
};
/// Data of a response that is neither a position nor a touch.
struct IppData {
  ippdme::Tag tag;
  IppText text;
};
struct IppError {
  ippdme::Tag tag;
  int severity = 0;
  int code = 0;
  IppText text;
};
/// A line that violates I++ DME. After such a line only the answers to AbortE are evaluated, until
/// a new connection.
struct IppProtocolError {
  ippdme::LineError error{};
  IppText line;
};

using IppMessage = std::variant<protocol::AxisSample, protocol::ProbeTrigger, IppAck, IppComplete,
                                IppData, IppError, IppProtocolError>;

class IppReceiver {
 public:
  explicit IppReceiver(const IppReceiverOptions& options = {}) noexcept : options_(options) {}
  IppReceiver(const IppReceiver&) = delete;
  IppReceiver& operator=(const IppReceiver&) = delete;

  /// Registers a command line, including its CR LF, that was sent at `time`.
  void sent(std::span<const std::byte> line, protocol::HostTime time) ABBE_RT;
  /// Adds the bytes of one read and their arrival time; a call without bytes marks a new
  /// connection. Call next() until it returns nullopt before the next push().
  void push(std::span<const std::byte> bytes, protocol::HostTime arrival) ABBE_RT;
  [[nodiscard]] std::optional<IppMessage> next() ABBE_RT;

 private:
  enum class Purpose : std::uint8_t { Other, Position, Touch, MoveReport };
  struct Asked {
    ippdme::Tag tag;
    Purpose purpose = Purpose::Other;
    protocol::HostTime time{};
    std::uint32_t touch = 0;
    bool known = false;
    bool warned = false;
  };
  /// Commands sent. Entry 0 is the event that reports motion continuously; the others are the
  /// latest commands.
  static constexpr std::size_t kMostAsked = 16;

  [[nodiscard]] Asked* find(ippdme::Tag tag) ABBE_RT;
  [[nodiscard]] std::optional<IppMessage> understand(std::string_view line) ABBE_RT;
  [[nodiscard]] static IppError refusal_of(const ippdme::Response& response) ABBE_RT;
  [[nodiscard]] static std::optional<IppMessage> of_the_abort(std::string_view line) ABBE_RT;
  [[nodiscard]] std::optional<IppMessage> data(const ippdme::Response& response,
                                               std::string_view line) ABBE_RT;
  [[nodiscard]] IppMessage protocol_error(ippdme::LineError error, std::string_view line) ABBE_RT;
  [[nodiscard]] IppMessage error(const ippdme::Response& response) ABBE_RT;
  [[nodiscard]] protocol::AxisSample position(const ippdme::PointReport& at,
                                              const protocol::SampleHead& head) ABBE_RT;
  [[nodiscard]] protocol::ProbeTrigger touch(const ippdme::PointReport& at,
                                             const protocol::SampleHead& head, std::uint32_t number,
                                             bool warned) ABBE_RT;
  [[nodiscard]] protocol::SampleHead between(protocol::HostTime from) ABBE_RT;

  IppReceiverOptions options_;
  protocol::HostTime arrival_{};
  bool aborting_ = false;            ///< AbortE was sent on this connection
  bool silenced_ = false;            ///< only the answers to AbortE are evaluated
  bool position_restarted_ = false;  ///< flag for the first sample of a kind on a new connection
  bool touch_restarted_ = false;
  std::uint32_t cycle_ = 0;
  std::uint32_t touches_ = 0;
  std::array<Asked, kMostAsked> asked_{};
  std::size_t next_asked_ = 0;
  std::optional<IppError> error_due_;  ///< next() returns it after the failed touch
  ippdme::LineFramer framer_;
};

}  // namespace abbe::drivers
