#pragma once
/// Decoded data of all devices. SI units (m, rad, s, K, Pa). Trivially copyable and of fixed size,
/// so that a sample can be stored in a ring. `time` is the host time of the measurement, not of the
/// arrival of the data. Pure data; safe to copy between threads.

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "abbe/protocol/time.hpp"

namespace abbe::protocol {

inline constexpr std::size_t kMaxAxes = 8;
inline constexpr std::size_t kMaxTemperatures = 8;

/// Quality of one sample; a bit set, so that several can be true at once.
enum class SampleFlag : std::uint32_t {
  None = 0,
  GapBefore = 1u << 0,       ///< samples were lost before this one: see `lost_before`
  TimeWidened = 1u << 1,     ///< the kernel time stamp was unusable; u_time is larger
  ClockUnsettled = 1u << 2,  ///< the device clock model has not converged yet
  AxisMissing = 1u << 3,     ///< at least one axis has no value in this cycle: see `missing_mask`
  BusError = 1u << 4,        ///< the bus reported errors since the previous sample
  BusOff = 1u << 5,          ///< the CAN controller is bus-off: positions are the last known ones
  DeviceError = 1u << 6,     ///< the device itself reports an error (EMCY, alarm, bad status)
  SpeedWarning = 1u << 7,    ///< tracker: the target speed is close to its limit
  SpeedExceeded = 1u << 8,   ///< tracker: target too fast; do not use the point
  /// tracker: prism error or trigger violation; do not use the point
  PointInvalid = 1u << 9,
  BeamReturned = 1u << 10,  ///< first point after the beam was lost
  Restarted = 1u << 11,     ///< first sample after a reconnection or a restart of the device
};
using SampleFlags = std::uint32_t;

constexpr SampleFlags operator|(SampleFlag a, SampleFlag b) noexcept {
  return static_cast<SampleFlags>(a) | static_cast<SampleFlags>(b);
}
constexpr SampleFlags operator|(SampleFlags a, SampleFlag b) noexcept {
  return a | static_cast<SampleFlags>(b);
}
constexpr SampleFlags& operator|=(SampleFlags& a, SampleFlag b) noexcept {
  return a = a | b;
}
[[nodiscard]] constexpr bool has(SampleFlags flags, SampleFlag f) noexcept {
  return (flags & static_cast<SampleFlags>(f)) != 0;
}

/// Common first member of all samples in a ring. `u_time` is the standard uncertainty (k = 1) of
/// `time`.
struct SampleHead {
  HostTime time{};
  std::chrono::nanoseconds u_time{};
  SampleFlags flags = 0;
  /// samples dropped between the previous one in the ring and this one
  std::uint32_t lost_before = 0;
};

/// One point of a laser tracker, in the tracker's own frame (right-handed, z up).
struct TrackerPoint {
  SampleHead head;
  DeviceTime device_time{};
  std::array<double, 3> p_tracker_m{};  ///< position of the reflector centre
  std::int32_t device_status = 0;       ///< the point status as the device sent it
};

/// All axes of one encoder bus at one SYNC, or of one counter card at one scan.
struct AxisSample {
  SampleHead head;
  std::uint32_t cycle = 0;  ///< SYNC or scan number since start, wraps
  std::uint8_t axis_count = 0;
  std::uint8_t missing_mask = 0;               ///< bit i: axis i gave no valid answer
  std::array<std::int64_t, kMaxAxes> count{};  ///< raw device counts
  std::array<double, kMaxAxes> position{};     ///< scale reading, m (linear) or rad (rotary)
};

/// The way in which the instant of a touch was determined.
enum class TouchLatch : std::uint8_t {
  Clock = 0,     ///< the edge latched a counter of the card
  Scan = 1,      ///< between two scans, not known more precisely
  Reported = 2,  ///< the measuring machine latched and reports the position
};

/// Quality of a touch; a set of bits. None: a valid touch without restrictions.
enum class TouchFlag : std::uint32_t {
  None = 0,
  Chattered = 1u << 0,     ///< more edges followed within the chatter limit; the first one is used
  SpeedTooLow = 1u << 1,   ///< approach speed below the qualified range of the probe
  SpeedTooHigh = 1u << 2,  ///< approach speed above the qualified range of the probe
  /// the approach speed was not constant: the pre-travel may differ from the qualified one
  SpeedUnsteady = 1u << 3,
  LatchRefused = 1u << 4,  ///< the latched clock contradicts the scans; the scans were used
  NoPosition = 1u << 5,    ///< scans around the touch were lost: there is no position
  Refused = 1u << 6,       ///< the measuring machine reported a warning with the touch
};
using TouchFlags = std::uint32_t;

constexpr TouchFlags operator|(TouchFlag a, TouchFlag b) noexcept {
  return static_cast<TouchFlags>(a) | static_cast<TouchFlags>(b);
}
constexpr TouchFlags operator|(TouchFlags a, TouchFlag b) noexcept {
  return a | static_cast<TouchFlags>(b);
}
constexpr TouchFlags& operator|=(TouchFlags& a, TouchFlag b) noexcept {
  return a = a | b;
}
[[nodiscard]] constexpr bool has(TouchFlags flags, TouchFlag f) noexcept {
  return (flags & static_cast<TouchFlags>(f)) != 0;
}

/// One touch of a probe. `head.time` is the instant of contact: the instant of the first edge minus
/// the probe's delay. The position is the scale reading, not the position of the stylus tip. If
/// `axis_count` is 0, the receiver of the touch must interpolate axis samples at `head.time`.
struct ProbeTrigger {
  SampleHead head;
  std::uint32_t touch = 0;  ///< number of the touch since start
  std::uint32_t probe = 0;  ///< probe number: selects delay and qualification
  TouchLatch latch = TouchLatch::Clock;
  TouchFlags touch_flags = 0;
  std::int64_t edge_clock_count = 0;  ///< the card's time base at the first edge; Reported: 0
  std::uint8_t axis_count = 0;
  std::uint8_t missing_mask = 0;                ///< bit i: axis i is not known
  double speed_m_s = 0.0;                       ///< approach speed of the linear axes
  std::array<double, kMaxAxes> position{};      ///< position at contact, m or rad
  std::array<double, kMaxAxes> velocity{};      ///< velocity of the approach, m/s or rad/s
  std::array<double, kMaxAxes> u_position{};    ///< standard uncertainty
  std::array<double, kMaxAxes> U95_position{};  ///< half 95 % interval; for Scan not 2 u
};

/// One scan of the window around a touch, at the full rate of the card.
struct TouchScan {
  SampleHead head;
  std::uint32_t touch = 0;  ///< ProbeTrigger::touch
  std::uint8_t axis_count = 0;
  std::uint8_t missing_mask = 0;
  std::int64_t clock_count = 0;  ///< the card's time base
  std::int64_t latch_count = 0;  ///< the time base at the latest edge
  std::int64_t edge_count = 0;
  std::array<std::int64_t, kMaxAxes> count{};
  std::array<double, kMaxAxes> position{};  ///< m or rad
};

/// Quantities of an EnvironmentSample; a set of bits. Bit set and value NaN: the device measures
/// the quantity, but has no value now. Bit not set and a number: an assumed value that was set in
/// the device.
using EnvironmentMask = std::uint16_t;
inline constexpr EnvironmentMask kAirTemperature = 1u << 0;
inline constexpr EnvironmentMask kAirPressure = 1u << 1;
inline constexpr EnvironmentMask kRelativeHumidity = 1u << 2;
inline constexpr EnvironmentMask kAllOfTheAir = kAirTemperature | kAirPressure | kRelativeHumidity;
[[nodiscard]] constexpr EnvironmentMask temperature_bit(std::size_t channel) noexcept {
  return static_cast<EnvironmentMask>(1u << (8 + channel));
}

inline constexpr auto kNoTemperatures = [] {
  std::array<double, kMaxTemperatures> none{};
  none.fill(std::numeric_limits<double>::quiet_NaN());
  return none;
}();

/// Environment of the measurement: air, and temperatures (scales, parts) by channel. The
/// configuration assigns the channels. NaN if the device does not measure a quantity.
struct EnvironmentSample {
  SampleHead head;
  double air_temperature_K = 0.0;
  double air_pressure_Pa = 0.0;
  double relative_humidity = 0.0;  ///< 0 to 1
  EnvironmentMask measured = kAllOfTheAir;
  std::array<double, kMaxTemperatures> temperature_K = kNoTemperatures;
};

/// The machine at one instant: axes interpolated to `head.time`, and the measurements at that
/// instant.
struct Snapshot {
  SampleHead head;
  std::uint8_t axis_count = 0;
  std::uint8_t missing_mask = 0;
  /// false: raw scale readings; true: already corrected by the control
  bool axes_compensated = false;
  bool has_tracker_point = false;
  bool has_trigger = false;
  bool has_environment = false;
  std::array<double, kMaxAxes> position{};  ///< m or rad
  std::array<double, kMaxAxes> velocity{};  ///< m/s or rad/s
  /// Standard uncertainty of the interpolation to head.time, m or rad.
  std::array<double, kMaxAxes> u_position{};
  TrackerPoint tracker_point;
  ProbeTrigger trigger;
  EnvironmentSample environment;
};

/// Bytes exactly as sent to or received from a device, in blocks of fixed size. A message longer
/// than one block continues in the next blocks; all but the last have `continued` set.
struct RawBlock {
  static constexpr std::size_t kCapacity = 2048;
  enum class Direction : std::uint8_t { FromDevice = 0, ToDevice = 1 };

  HostTime time{};  ///< time of arrival (FromDevice) or of sending (ToDevice)
  /// blocks dropped between the previous one in the ring and this one
  std::uint32_t lost_before = 0;
  std::uint16_t length = 0;
  bool continued = false;  ///< the next block belongs to the same read
  Direction direction = Direction::FromDevice;
  std::array<std::byte, kCapacity> bytes;  // NOLINT: not initialised; the first `length` are valid
};

static_assert(std::is_trivially_copyable_v<TrackerPoint>);
static_assert(std::is_trivially_copyable_v<AxisSample>);
static_assert(std::is_trivially_copyable_v<ProbeTrigger>);
static_assert(std::is_trivially_copyable_v<TouchScan>);
static_assert(std::is_trivially_copyable_v<EnvironmentSample>);
static_assert(std::is_trivially_copyable_v<Snapshot>);
static_assert(std::is_trivially_copyable_v<RawBlock>);

}  // namespace abbe::protocol
