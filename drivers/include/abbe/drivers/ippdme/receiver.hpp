#pragma once
/// From the lines of an I++ DME server to touches and positions, in SI and in host time. Sans-I/O
/// and deterministic: the same bytes both ways with the same times give the same samples, live or
/// replayed. What a response means is known from the command with its tag, so the sent lines are
/// needed, too. Real time: allocation-free, no system call. One thread. About 130 kB: keep it on
/// the heap.
///
/// The protocol carries no time. A position lies somewhere between its command and its answer, a
/// touch likewise: the middle, with half of the whole as a rectangular half-width. For a touch that
/// is seconds; what counts is the position that the machine latched itself.

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
  double u_position_m = 1e-6;  ///< of the machine, what its acceptance test says (MPE / 2)
  /// Between a position and the line that reports it by itself (OnMoveReportE).
  std::chrono::nanoseconds max_report_delay = std::chrono::milliseconds{100};
};

/// Text out of a line, cut at its capacity.
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
/// Data of a command that is not about a place.
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
/// A line that no I++ DME server sends. After it only the answers to AbortE come, until a new
/// connection.
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

  /// A command line as it was sent, with its CR LF.
  void sent(std::span<const std::byte> line, protocol::HostTime time) ABBE_RT;
  /// Bytes of one read and when they arrived; no bytes: a new connection. next() until it gives
  /// nothing before the next push().
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
  static constexpr std::size_t kMostAsked = 16;  ///< one at a time is asked, and one report goes on

  [[nodiscard]] Asked* find(ippdme::Tag tag) ABBE_RT;
  [[nodiscard]] std::optional<IppMessage> understand(std::string_view line) ABBE_RT;
  [[nodiscard]] static IppError refusal_of(const ippdme::Response& response) ABBE_RT;
  [[nodiscard]] static std::optional<IppMessage> of_the_abort(std::string_view line) ABBE_RT;
  [[nodiscard]] std::optional<IppMessage> data(const ippdme::Response& response,
                                               std::string_view line) ABBE_RT;
  [[nodiscard]] IppMessage nonsense(ippdme::LineError error, std::string_view line) ABBE_RT;
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
  bool silenced_ = false;            ///< but for the answers to AbortE
  bool position_restarted_ = false;  ///< for the first sample of each kind after a new connection
  bool touch_restarted_ = false;
  std::uint32_t cycle_ = 0;
  std::uint32_t touches_ = 0;
  std::array<Asked, kMostAsked> asked_{};
  std::size_t next_asked_ = 0;
  std::optional<IppError> error_due_;  ///< leaves after the touch it failed
  ippdme::LineFramer framer_;
};

}  // namespace abbe::drivers
