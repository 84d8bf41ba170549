#pragma once
/// Our SYNC between send() and its echo, on a bus that has one (CanBus::echoes_sync). The echo tells when it
/// left. While it has not come, no other is sent: on a bus on which nothing leaves they would wait in line,
/// and leave all at once when it can again.
///
/// Without an echo in the time in which a node has to answer, the SYNC counts from when it was handed over,
/// so that its cycle ends with all axes missing; so it does where an answer comes first, for some controllers
/// tell what they received before what they sent. Its echo is then none any more. Sans-I/O. One thread.

#include <chrono>
#include <cstddef>
#include <optional>
#include <span>

#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

class SyncUnderWay {
 public:
  /// `answer_within`: as in EncoderReceiverOptions, and not 0.
  explicit SyncUnderWay(std::chrono::nanoseconds answer_within) : answer_within_(answer_within) {}

  void sent(protocol::HostTime at);
  /// The bus was closed or went off: nothing is under way.
  void forget() { sent_.reset(); }
  /// It may still leave: no other one yet. At most kPatience, for an echo may be lost.
  [[nodiscard]] bool waits(protocol::HostTime now) const;
  /// When settle() has something to do although nothing came; else HostTime::max().
  [[nodiscard]] protocol::HostTime deadline() const;

  /// What the receiver is to see of what read() gave until `now`: every SYNC once, as an echo, before its
  /// answers. Returns how many are in `out`, at most one more than came.
  [[nodiscard]] std::size_t settle(std::span<const ReceivedFrame> came, std::span<ReceivedFrame> out,
                                   protocol::HostTime now);

  static constexpr std::chrono::nanoseconds kPatience = std::chrono::milliseconds{100};

 private:
  [[nodiscard]] bool take_echo();
  [[nodiscard]] bool unheard() const { return sent_ && !counted_; }
  [[nodiscard]] ReceivedFrame count_from_sending();

  std::chrono::nanoseconds answer_within_;
  std::optional<protocol::HostTime> sent_;
  bool counted_ = false;  ///< the receiver has seen it
};

}  // namespace abbe::drivers
