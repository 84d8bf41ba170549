#pragma once
/// Readings of the axes whose zero is found from reference marks ([reference]). Until it is found, and again
/// after the card's counters began anew, such an axis is missing in every sample: where a counter happened to
/// stand is no reading. Its uncertainty is the same error in all readings and is not added to theirs.
/// Deterministic: decided by the samples' own times, so that a replay from raw bytes is the live run again.
/// Ordinary world; not thread-safe.

#include <deque>
#include <optional>
#include <vector>

#include "abbe/daemon/batch.hpp"
#include "abbe/daemon/config.hpp"
#include "abbe/daemon/recording_info.hpp"

namespace abbe::daemon {

/// The reading at count 0 of an axis, for samples later than `from`.
struct FoundDatum {
  std::size_t axis = 0;          ///< place in AxisSample
  double reading_at_zero = 0.0;  ///< m or rad
  double u = 0.0;
  protocol::HostTime from{};
};

class Datum {
 public:
  /// Without [reference] nothing is ever changed.
  explicit Datum(const Config& config);

  /// In the order of time.
  void found(const FoundDatum& datum);
  /// Axis samples, touches and the scans around them.
  void apply(Batch& batch);

  [[nodiscard]] bool known(std::size_t axis) const;

 private:
  struct Axis {
    std::size_t place = 0;
    double step = 0.0;
    std::deque<FoundDatum> coming;
    std::optional<FoundDatum> in_force;
  };
  void move_on(const protocol::SampleHead& head);
  void apply(protocol::AxisSample& sample);
  void apply(protocol::ProbeTrigger& touch) const;
  void apply(protocol::TouchScan& scan) const;

  std::vector<Axis> axes_;
};

/// As it lies in the recording, for a replay from raw bytes.
inline constexpr std::string_view kDatumName = "datum.json";
/// Since when the marks were searched for: crossings and samples later than this.
inline constexpr std::string_view kReferenceRequestName = "reference.json";
[[nodiscard]] RecordingAttachment reference_request(protocol::HostTime from);
[[nodiscard]] Result<protocol::HostTime> reference_request_from(const RecordingAttachment& attachment);
[[nodiscard]] RecordingAttachment to_attachment(const FoundDatum& datum);
[[nodiscard]] Result<FoundDatum> datum_from_attachment(const RecordingAttachment& attachment);

}  // namespace abbe::daemon
