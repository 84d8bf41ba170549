#pragma once
/// Decodes the bytes of an emScon laser tracker into points and weather, in SI units and host time.
/// Sans-I/O and deterministic: the same bytes with the same arrival times give the same samples,
/// live or replayed. Expects the units that the session sets: mm, rad, Celsius, mbar, percent,
/// right-handed Cartesian coordinates. Real time: allocation-free, no system call. One thread.
/// About 300 kB: keep it on the heap.
///
/// Raw blocks: a block FromDevice holds bytes as received; an empty one records a new connection. A
/// block ToDevice holds bytes as sent; an empty one records a lost connection. Decoding does not
/// need the blocks ToDevice; they serve for inspection and for the playback of a recording.
///
/// A recording may begin in the middle of a packet: until the first new connection the receiver
/// searches for a packet header and accepts points at once. On a new connection it accepts points
/// only after the controller has accepted StartMeasurement: points of a measurement that an earlier
/// client started would have unknown units.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <variant>

#include "abbe/drivers/clock_model.hpp"
#include "abbe/drivers/tracker/burst_times.hpp"
#include "abbe/protocol/emscon/framer.hpp"
#include "abbe/protocol/emscon/results.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

namespace emscon = protocol::emscon;

struct TrackerReceiverOptions {
  ClockModelOptions clock;
  /// Interval between two points of a continuous time measurement; a longer gap is marked
  /// GapBefore. 0: the points have no fixed interval (continuous distance), or it is not known;
  /// gaps are not detected.
  std::chrono::nanoseconds time_separation = std::chrono::milliseconds{2};
  /// Duration of a stationary measurement. The result of such a measurement contains no time stamp.
  std::chrono::nanoseconds stationary_time = std::chrono::milliseconds{500};
  /// True: the controller reads its weather station. False: it reports the values that were set;
  /// the samples contain these values, and `measured` is 0.
  bool air_measured = true;
};

/// The points of one packet, valid until the next call to push() or next().
struct TrackerBurst {
  std::span<const protocol::TrackerPoint> points;
};

/// Bytes that violate the emScon protocol. After such bytes the receiver ignores everything until a
/// new connection.
struct TrackerProtocolError {
  std::optional<emscon::DecodeError> error;  ///< nullopt: invalid packet size
  std::array<std::byte, 24> first_bytes{};
  std::size_t length = 0;
};

/// The results of next(). The messages are in the order of their bytes.
using TrackerMessage =
    std::variant<TrackerBurst, protocol::EnvironmentSample, emscon::Answer, emscon::ErrorResponse,
                 emscon::StatusChange, TrackerProtocolError>;

/// Counts since construction.
struct TrackerCounters {
  std::uint64_t packets = 0;
  std::uint64_t points = 0;
  std::uint64_t gaps = 0;  ///< gaps in the point stream that were not caused by a lost beam
  std::uint64_t beam_losses = 0;
  std::uint64_t time_disorder = 0;    ///< points whose time does not fit; not used
  std::uint64_t time_jumps = 0;       ///< new time bases of the tracker's clock
  std::uint64_t points_refused = 0;   ///< points before StartMeasurement was accepted
  std::uint64_t protocol_errors = 0;  ///< protocol errors
};

class TrackerReceiver {
 public:
  explicit TrackerReceiver(const TrackerReceiverOptions& options = {}) noexcept;
  TrackerReceiver(const TrackerReceiver&) = delete;
  TrackerReceiver& operator=(const TrackerReceiver&) = delete;

  /// Adds the bytes of one read, at most kMaxPacketSize, and their arrival time; a call without
  /// bytes marks a new connection. Call next() until it returns nullopt before the next push().
  void push(std::span<const std::byte> bytes, protocol::HostTime arrival) ABBE_RT;
  /// Call it where bytes of a recording are missing. The receiver then searches for the next
  /// packet, and marks the next sample GapBefore.
  void bytes_lost() ABBE_RT;

  /// The next message; nullopt if more bytes are needed.
  [[nodiscard]] std::optional<TrackerMessage> next() ABBE_RT;

  [[nodiscard]] TrackerCounters counters() const ABBE_RT;
  [[nodiscard]] ClockStatus clock() const ABBE_RT { return times_.clock(); }
  [[nodiscard]] double skew_beyond_limit() const ABBE_RT { return times_.skew_beyond_limit(); }

 private:
  void connection_began() ABBE_RT;
  [[nodiscard]] std::optional<TrackerMessage> understand(std::span<const std::byte> packet) ABBE_RT;
  [[nodiscard]] std::optional<TrackerMessage> take(const emscon::Answer& answer) ABBE_RT;
  [[nodiscard]] std::optional<TrackerMessage> take(const emscon::ErrorResponse& error) ABBE_RT;
  [[nodiscard]] std::optional<TrackerMessage> take(const emscon::StatusChange& change) ABBE_RT;
  [[nodiscard]] std::optional<TrackerMessage> take(const emscon::SingleResult& result) ABBE_RT;
  [[nodiscard]] std::optional<TrackerMessage> take(const emscon::MultiResult& result) ABBE_RT;
  [[nodiscard]] std::optional<TrackerMessage> take(const emscon::ReflectorPosition&) ABBE_RT {
    return {};
  }
  [[nodiscard]] std::optional<TrackerMessage> take(const emscon::OtherPacket&) ABBE_RT {
    return {};
  }
  [[nodiscard]] TrackerMessage protocol_error(std::optional<emscon::DecodeError> error,
                                              std::span<const std::byte> bytes) ABBE_RT;
  [[nodiscard]] TrackerMessage burst(std::size_t count) ABBE_RT;

  void convert(const emscon::MultiPoint& from, emscon::Status status,
               protocol::TrackerPoint& to) ABBE_RT;
  void weather(const emscon::Environment& environment, const protocol::SampleHead& head) ABBE_RT;
  void beam_lost() ABBE_RT;

  TrackerReceiverOptions options_;
  static_assert(emscon::kMaxMultiPoints <= BurstTimes::kMostPoints);
  BurstTimes times_;
  TrackerCounters counters_;  ///< all counters except those of times_
  protocol::HostTime arrival_{};
  bool accepting_ = true;     ///< points have the units that the session set
  bool silenced_ = false;     ///< a protocol error occurred on this connection
  bool points_came_ = false;  ///< points arrived on this connection
  emscon::Environment environment_{};
  /// arrival of the packet with which the environment was last returned
  protocol::HostTime environment_sent_{};
  bool environment_known_ = false;
  std::optional<protocol::EnvironmentSample> weather_due_;  ///< returned after its burst
  emscon::PacketFramer framer_;
  std::array<protocol::TrackerPoint, emscon::kMaxMultiPoints> points_{};
};

}  // namespace abbe::drivers
