#pragma once
/// Unsolicited packets of an emScon controller: measurements, errors, status changes; and decode()
/// for all packets of a controller. Values are in the units of SetUnits and the coordinates of
/// SetCoordinateSystemType. Pure, allocation-free, accepts any bytes.

#include <array>
#include <cassert>
#include <cstddef>
#include <cstdint>
#include <span>
#include <tl/expected.hpp>
#include <variant>

#include "abbe/protocol/emscon/answers.hpp"
#include "abbe/protocol/emscon/types.hpp"

namespace abbe::protocol::emscon {

/// Packet type 1: an error. No public source gives the status for a broken beam.
struct ErrorResponse {
  Command command{};
  Status status = Status::Unknown;
};

/// Packet type 8: the status of the controller has changed.
struct StatusChange {
  Event event{};
};

/// Packet type 2: the mean of a stationary measurement. It contains no time stamp.
struct SingleResult {
  Status status = Status::Ok;
  MeasurementMode mode = MeasurementMode::Stationary;
  bool try_mode = false;
  std::array<double, 3> value{};
  std::array<double, 3> std_dev{};
  double std_total = 0.0;
  std::array<double, 3> pointing_error{};
  std::array<double, 3> apriori_std{};
  double apriori_total = 0.0;
  Environment environment;
};

/// Packet type 7: position of the reflector, at most 10 times a second while the beam is locked.
struct ReflectorPosition {
  Status status = Status::Ok;
  std::array<double, 3> value{};
};

struct MultiHead {
  Status status = Status::Ok;
  MeasurementMode mode = MeasurementMode::ContinuousTime;
  bool try_mode = false;
  Environment environment;
};
struct MultiPoint {
  PointStatus status = PointStatus::Ok;
  TrackerClockReading time;
  std::array<double, 3> value{};
};
/// Additional data of a point in a packet of type 10.
struct MultiPointStatistics {
  std::array<double, 3> apriori_std{};
  double apriori_total = 0.0;
  std::array<double, 3> covariance{};  ///< 12, 13, 23
};
struct ExtendedMultiPoint {
  MultiPoint point;
  MultiPointStatistics statistics;
};

inline constexpr std::size_t kMultiHeadSize = 48;
inline constexpr std::size_t kMultiPointSize = 36;
inline constexpr std::size_t kExtendedMultiPointSize = 92;
inline constexpr std::size_t kMaxMultiPoints = (kMaxPacketSize - kMultiHeadSize) / kMultiPointSize;
inline constexpr std::size_t kMaxExtendedMultiPoints =
    (kMaxPacketSize - kMultiHeadSize) / kExtendedMultiPointSize;

/// Packet types 3 and 10: a burst of points of a continuous measurement. A MultiResult is a view of
/// the packet's bytes, which must outlive it; each call of point() decodes one point.
class MultiResult {
 public:
  /// Any bytes in `packet` give a result or an error.
  [[nodiscard]] static tl::expected<MultiResult, DecodeError> from(
      std::span<const std::byte> packet) ABBE_RT;

  [[nodiscard]] const MultiHead& head() const ABBE_RT { return head_; }
  [[nodiscard]] bool extended() const ABBE_RT { return point_size_ == kExtendedMultiPointSize; }
  [[nodiscard]] std::size_t size() const ABBE_RT { return points_.size() / point_size_; }
  [[nodiscard]] MultiPoint point(std::size_t k) const ABBE_RT;  ///< k < size()
  /// k < size(), extended()
  [[nodiscard]] MultiPointStatistics statistics(std::size_t k) const ABBE_RT;

 private:
  MultiResult(const MultiHead& head, std::span<const std::byte> points,
              std::size_t point_size) ABBE_RT : head_(head),
                                                points_(points),
                                                point_size_(point_size) {}

  MultiHead head_;
  std::span<const std::byte> points_;
  std::size_t point_size_;
};

/// A packet of a known type whose layout is not needed here (six-degree-of-freedom probes, Nivel,
/// type 9).
struct OtherPacket {
  PacketType type{};
};

using ControllerPacket = std::variant<Answer, ErrorResponse, StatusChange, SingleResult,
                                      ReflectorPosition, MultiResult, OtherPacket>;

/// Decodes any packet of a controller. `packet` is one complete packet from the framer.
[[nodiscard]] tl::expected<ControllerPacket, DecodeError> decode(
    std::span<const std::byte> packet) ABBE_RT;

/// Each encode() returns the number of bytes written to `out`, 0 if `out` is too small or if the
/// points do not fit into one packet.
[[nodiscard]] std::size_t encode(const ErrorResponse&, std::span<std::byte> out) ABBE_RT;
[[nodiscard]] std::size_t encode(const StatusChange&, std::span<std::byte> out) ABBE_RT;
[[nodiscard]] std::size_t encode(const SingleResult&, std::span<std::byte> out) ABBE_RT;
[[nodiscard]] std::size_t encode(const ReflectorPosition&, std::span<std::byte> out) ABBE_RT;
[[nodiscard]] std::size_t encode(const MultiHead&, std::span<const MultiPoint>,
                                 std::span<std::byte> out) ABBE_RT;
[[nodiscard]] std::size_t encode(const MultiHead&, std::span<const ExtendedMultiPoint>,
                                 std::span<std::byte> out) ABBE_RT;

}  // namespace abbe::protocol::emscon
