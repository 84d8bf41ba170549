#pragma once
/// Our SYNC between send() and its echo, on a bus that has one (CanBus::echoes_sync). The echo
/// tells when it left. While it has not come, no other is sent: on a bus on which nothing leaves
/// they would wait in line, and leave all at once when it can again.
///
/// Without an echo in the time in which a node has to answer, the SYNC counts from when it was
/// handed over, so that its cycle ends with all axes missing. So it does where a node answers first
/// (some controllers tell what they received before what they sent), and where the echo's stamp was
/// not believed; its time is then marked as widened. An echo that comes later is dropped. Sans-I/O.
/// One thread.

#include <bitset>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

class SyncUnderWay {
 public:
  explicit SyncUnderWay(const EncoderReceiverOptions& options)
      : period_(options.sync_period), answer_within_(answer_within(options)) {}

  void sent(protocol::HostTime at);
  /// The bus was closed or went off: nothing is under way.
  void forget();
  /// It may still leave, or just has, and its answers come: no other one yet. At most kPatience,
  /// for an echo may be lost.
  [[nodiscard]] bool waits(protocol::HostTime now) const;
  /// When settle() has something to do although nothing came; else HostTime::max().
  [[nodiscard]] protocol::HostTime deadline() const;

  /// What the receiver is to see of what read() gave until `now`: every SYNC once, as an echo,
  /// before its answers. `all_read`: nothing else had come. Returns how many are in `out`, at most
  /// one more than came.
  [[nodiscard]] std::size_t settle(std::span<const ReceivedFrame> came,
                                   std::span<ReceivedFrame> out, protocol::HostTime now,
                                   bool all_read);

  static constexpr std::chrono::nanoseconds kPatience = std::chrono::milliseconds{100};

 private:
  enum class Counted : std::uint8_t { NotYet, ByItsAnswer, ByTheDeadline };

  [[nodiscard]] bool unheard() const { return sent_ && counted_ == Counted::NotYet; }
  [[nodiscard]] std::optional<ReceivedFrame> settle_echo(const ReceivedFrame& echo);
  [[nodiscard]] bool proves_that_it_left(const ReceivedFrame& received) const;
  [[nodiscard]] ReceivedFrame count(Counted how);
  [[nodiscard]] ReceivedFrame as_sent() const;

  std::chrono::nanoseconds period_;
  std::chrono::nanoseconds answer_within_;
  std::optional<protocol::HostTime> sent_;
  Counted counted_ = Counted::NotYet;   ///< how the receiver came to see it without its echo
  protocol::HostTime answers_until_{};  ///< of one that left after its cycle
  std::bitset<std::size_t{can::kMaxNodeId} + 1> answered_;  ///< nodes, the SYNC before
};

}  // namespace abbe::drivers
