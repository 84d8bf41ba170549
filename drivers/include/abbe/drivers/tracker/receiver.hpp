#pragma once
/// From the bytes of an emScon laser tracker to points and weather, in SI and in host time.
/// Sans-I/O and deterministic: the same bytes with the same arrival times give the same samples,
/// live or replayed. Expects the units the session asks for: mm, rad, Celsius, mbar, percent,
/// right-handed Cartesian coordinates. Real time: allocation-free, no system call. One thread.
/// About 300 kB: keep it on the heap.
///
/// Raw blocks of a tracker: FromDevice, as received; an empty one is a new connection. ToDevice, as
/// sent, an empty one is a connection that was lost (for people and for serving a recording back;
/// not needed to decode it).
///
/// A recording may begin anywhere: until the first new connection the receiver seeks a packet head
/// and takes points at once. On a new connection it takes none before the controller has accepted
/// StartMeasurement: what an earlier client left running would come in unknown units.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <variant>

#include "abbe/drivers/clock_model.hpp"
#include "abbe/protocol/emscon/framer.hpp"
#include "abbe/protocol/emscon/results.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

namespace emscon = protocol::emscon;

struct TrackerReceiverOptions {
  ClockModelOptions clock;
  /// Between two points of a continuous time measurement; a longer hole is marked GapBefore. 0:
  /// points come when they come (continuous distance, or not known), holes cannot be told.
  std::chrono::nanoseconds time_separation = std::chrono::milliseconds{2};
  /// How long a stationary measurement takes; its result says nothing of its own time.
  std::chrono::nanoseconds stationary_time = std::chrono::milliseconds{500};
  /// The controller reads its weather station. False: the air it reports is what it was set to; the
  /// samples carry these values, and `measured` is 0.
  bool air_measured = true;
};

/// Points of one packet, valid until the next call to push() or next().
struct TrackerBurst {
  std::span<const protocol::TrackerPoint> points;
};

/// Bytes that no emScon controller sends. Nothing more comes after it until a new connection.
struct TrackerProtocolError {
  std::optional<emscon::DecodeError> error;  ///< none: a packet size that cannot be
  std::array<std::byte, 24> first_bytes{};
  std::size_t length = 0;
};

/// What push()ed bytes meant, in their order.
using TrackerMessage =
    std::variant<TrackerBurst, protocol::EnvironmentSample, emscon::Answer, emscon::ErrorResponse,
                 emscon::StatusChange, TrackerProtocolError>;

/// Since construction.
struct TrackerCounters {
  std::uint64_t packets = 0;
  std::uint64_t points = 0;
  std::uint64_t gaps = 0;  ///< holes in the point stream that no lost beam explains
  std::uint64_t beam_losses = 0;
  std::uint64_t time_disorder = 0;   ///< points not later than the one before
  std::uint64_t points_refused = 0;  ///< that came before StartMeasurement was accepted
  std::uint64_t nonsense = 0;
};

class TrackerReceiver {
 public:
  explicit TrackerReceiver(const TrackerReceiverOptions& options = {}) noexcept;
  TrackerReceiver(const TrackerReceiver&) = delete;
  TrackerReceiver& operator=(const TrackerReceiver&) = delete;

  /// Bytes of one read and when they arrived; no bytes: a new connection. At most kMaxPacketSize at
  /// once, and next() until it gives nothing before the next push().
  void push(std::span<const std::byte> bytes, protocol::HostTime arrival) ABBE_RT;
  /// A hole in a recording: seeks the next packet, marks the next sample.
  void bytes_lost() ABBE_RT;

  /// The next message, or nothing: push more bytes.
  [[nodiscard]] std::optional<TrackerMessage> next() ABBE_RT;

  [[nodiscard]] const TrackerCounters& counters() const ABBE_RT { return counters_; }
  [[nodiscard]] ClockStatus clock() const ABBE_RT { return clock_.status(); }
  [[nodiscard]] double skew_beyond_limit() const ABBE_RT { return clock_.skew_beyond_limit(); }

 private:
  struct LastPoint {
    protocol::DeviceTime device_time{};
    bool known = false;
  };

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
  [[nodiscard]] TrackerMessage nonsense(std::optional<emscon::DecodeError> error,
                                        std::span<const std::byte> bytes) ABBE_RT;
  [[nodiscard]] TrackerMessage burst(std::size_t count) ABBE_RT;

  void convert(const emscon::MultiPoint& from, emscon::Status status,
               protocol::TrackerPoint& to) ABBE_RT;
  void follow(protocol::TrackerPoint& point) ABBE_RT;
  void mark_hole(std::chrono::nanoseconds since_last, protocol::TrackerPoint& point) ABBE_RT;
  void mark_pending(protocol::SampleHead& head) ABBE_RT;
  void weather(const emscon::Environment& environment, const protocol::SampleHead& head) ABBE_RT;
  void beam_lost() ABBE_RT;

  TrackerReceiverOptions options_;
  ClockModel clock_;
  TrackerCounters counters_;
  protocol::HostTime arrival_{};
  bool accepting_ = true;  ///< points are in our units
  bool silenced_ = false;  ///< nonsense was seen on this connection
  bool beam_lost_ = false;
  protocol::SampleFlags pending_flags_ = 0;  ///< for the next point
  LastPoint last_;
  emscon::Environment environment_{};
  bool environment_known_ = false;
  std::optional<protocol::EnvironmentSample> weather_due_;  ///< leaves after the burst it came with
  emscon::PacketFramer framer_;
  std::array<protocol::TrackerPoint, emscon::kMaxMultiPoints> points_{};
};

}  // namespace abbe::drivers
