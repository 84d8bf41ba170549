#pragma once
/// Our SYNC between send() and its echo, on a bus with echoes (CanBus::echoes_sync). The time of
/// the echo is the time of transmission. No further SYNC is sent before the echo has arrived: on a
/// bus that transmits nothing, SYNCs would accumulate in the queue and be transmitted in one burst
/// later.
///
/// EncoderReceiver gets the SYNC with the time of send(), marked as widened (larger uncertainty),
/// if
///  - no echo arrives within the time for answers: the cycle then ends with all axes missing,
///  - a node answers before the echo arrives: some controllers report received frames before sent
///    frames, or
///  - the echo has no usable timestamp.
/// An echo that arrives after the SYNC was passed on in this way is discarded. Sans-I/O. One
/// thread.

#include <bitset>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/drivers/can/can_bus.hpp"
#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/drivers/deadlines.hpp"
#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/time.hpp"

namespace abbe::drivers {

class PendingSync {
 public:
  explicit PendingSync(const EncoderReceiverOptions& options)
      : period_(options.sync_period), answer_within_(answer_within(options)) {}

  void sent(protocol::HostTime at);
  /// The bus was closed or is off: no echo is expected.
  void forget();
  /// True if no further SYNC may be sent yet: the latest SYNC may still be queued, or it was
  /// transmitted late and its answers are arriving. A missing echo blocks for at most kPatience.
  [[nodiscard]] bool waits(protocol::HostTime now) const;
  /// The time at which settle() must be called even without new frames; HostTime::max(): not
  /// needed.
  [[nodiscard]] protocol::HostTime deadline() const { return deadlines_.at(Due::Echo); }

  /// Converts the frames that read() delivered until `now` to the frames for the receiver: every
  /// SYNC exactly once, as an echo, before its answers. `all_read`: CanRead::all. Returns the
  /// number of frames in `out`, at most one more than in `came`.
  [[nodiscard]] std::size_t settle(std::span<const ReceivedFrame> came,
                                   std::span<ReceivedFrame> out, protocol::HostTime now,
                                   bool all_read);

  static constexpr std::chrono::nanoseconds kPatience = std::chrono::milliseconds{100};

 private:
  enum class Due : std::uint8_t {
    Echo,          ///< no echo by then: the receiver gets the SYNC with the time of send()
    Transmission,  ///< no echo by then: the SYNC is taken for lost
    Answers,       ///< by then all answers to a SYNC transmitted after its cycle have arrived
  };

  [[nodiscard]] bool pending() const { return deadlines_.is_set(Due::Echo); }
  [[nodiscard]] std::optional<ReceivedFrame> settle_echo(const ReceivedFrame& echo);
  [[nodiscard]] bool proves_transmission(const ReceivedFrame& received) const;
  [[nodiscard]] ReceivedFrame substitute();
  [[nodiscard]] ReceivedFrame as_sent() const;

  std::chrono::nanoseconds period_;
  std::chrono::nanoseconds answer_within_;
  /// sending time of the SYNC; set until its echo arrives
  std::optional<protocol::HostTime> sent_;
  Deadlines<Due::Answers> deadlines_;
  std::bitset<std::size_t{can::kMaxNodeId} + 1> answered_;  ///< nodes, for the previous SYNC
};

}  // namespace abbe::drivers
