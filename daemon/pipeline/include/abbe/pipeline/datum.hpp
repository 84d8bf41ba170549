#pragma once
/// Readings of the axes of a counter card. Its counters begin at 0 wherever the axes stand when it
/// is set up: until the zero of an axis is found from reference marks ([reference]), or somebody
/// says that the axis stands at its offset (`abbe reference --here`), and again after the counters
/// began anew, the axis is missing in every sample. [counter_card] zero = "here" says it of the
/// first set-up only. Decided for each axis. The uncertainty of a datum is the same error in all
/// readings and is not added to theirs. Deterministic: decided by the samples' own times, so that a
/// replay from raw bytes is the live run again. Ordinary world; not thread-safe.

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "abbe/config/config.hpp"
#include "abbe/messages/recording_info.hpp"
#include "abbe/pipeline/batch.hpp"

namespace abbe::daemon {

/// The reading at count 0 of an axis, for samples later than `from`.
struct FoundDatum {
  std::size_t axis = 0;          ///< place in AxisSample
  double reading_at_zero = 0.0;  ///< m or rad
  double u = 0.0;                ///< standard uncertainty, m or rad
  protocol::HostTime from{};
  bool stated = false;  ///< somebody said so; else marks did
};

/// Whether [reference] finds the zero of this axis.
[[nodiscard]] bool has_marks(const Config& config, const std::string& axis);

/// What was known of the axes when a further file of a recording began.
struct DatumState {
  protocol::HostTime at{};   ///< of the last sample before
  std::uint8_t unknown = 0;  ///< missing_mask of that sample
};

class Datum {
 public:
  /// What is to be done with axes that have no marks. Untouched: recordings from before it was
  /// asked.
  enum class WithoutMarks { NeedAZero, Untouched };
  /// Without [counter_card] nothing is ever changed.
  explicit Datum(const Config& config, WithoutMarks without_marks = WithoutMarks::NeedAZero);

  /// Not at the first set-up of the card but where a former file ended; what was found before is
  /// over.
  void go_on(const DatumState& state);
  /// In the order of time.
  void found(const FoundDatum& datum);
  /// Axis samples, touches and the scans around them.
  void apply(Batch& batch);

  [[nodiscard]] bool known(std::size_t axis) const;
  /// As of the newest sample applied.
  [[nodiscard]] std::vector<FoundDatum> in_force() const;

 private:
  struct Axis {
    std::size_t place = 0;
    double step = 0.0;
    double offset = 0.0;        // the driver's own
    bool zero_is_here = false;  // at the first set-up
    std::deque<FoundDatum> coming;
    std::optional<FoundDatum> in_force;
  };
  void move_on(const protocol::SampleHead& head);
  void apply(protocol::AxisSample& sample);
  void apply(protocol::ProbeTrigger& touch) const;
  template <class Counted>
  void apply_to_counts(Counted& sample) const;

  std::vector<Axis> axes_;
  bool begun_ = false;  // a sample was seen: what begins anew now is not the first set-up
};

/// As it lies in the recording, for a replay from raw bytes.
inline constexpr std::string_view kDatumName = "datum.json";
/// Among the versions of a recording: axes without marks needed a zero, too.
inline constexpr const char* kDatumRule = "datum";
/// Since when the marks were searched for: crossings and samples later than this.
inline constexpr std::string_view kReferenceRequestName = "reference.json";
[[nodiscard]] RecordingAttachment reference_request(protocol::HostTime from);
[[nodiscard]] Result<protocol::HostTime> reference_request_from(
    const RecordingAttachment& attachment);
/// At the front of every further file; what was found before it and is still in force lies beside
/// it.
inline constexpr std::string_view kDatumStateName = "datum-state.json";
[[nodiscard]] RecordingAttachment to_attachment(const DatumState& state);
[[nodiscard]] Result<DatumState> datum_state_from_attachment(const RecordingAttachment& attachment);
[[nodiscard]] RecordingAttachment to_attachment(const FoundDatum& datum);
[[nodiscard]] Result<FoundDatum> datum_from_attachment(const RecordingAttachment& attachment);

}  // namespace abbe::daemon
