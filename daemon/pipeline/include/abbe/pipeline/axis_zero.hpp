#pragma once
/// Zero of each axis of a counter card: the reading at count 0, which converts counts to readings.
/// When the card is set up, its counters start at 0 at the current positions, and the axes are not
/// referenced. An axis gets its zero from reference marks, or when the operator states that the
/// axis is at its configured offset (`abbe reference --here`); it loses the zero when the counters
/// restart. While an axis has no zero, every sample marks it as missing. With zero = "here" in the
/// table of the card, axes without marks are assumed to be at their offset when the card is set up
/// for the first time, but not after a restart of the counters. Each axis is treated separately.
/// The uncertainty of a zero is a systematic error common to all readings of the axis and is not
/// added to their uncertainty. Deterministic: depends on the times in the samples only, so that a
/// replay from raw bytes gives the readings of the live run. Not for the RT path; not thread-safe.

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
struct FoundZero {
  std::size_t axis = 0;          ///< index in AxisSample
  double reading_at_zero = 0.0;  ///< m or rad
  double u = 0.0;                ///< standard uncertainty, m or rad
  protocol::HostTime from{};
  bool stated = false;  ///< true: stated by the operator; false: found from marks
};

/// True if the scale of this axis has reference marks, from which its zero is found.
[[nodiscard]] bool has_marks(const Config& config, const std::string& axis);

/// State of the axes at the start of a further file of a recording.
struct ZeroState {
  protocol::HostTime at{};   ///< time of the last sample before the file
  std::uint8_t unknown = 0;  ///< missing_mask of that sample
};

class AxisZeros {
 public:
  /// The treatment of axes without reference marks. NeedAZero: they are not referenced until the
  /// operator states their zero. Untouched: their readings are not changed, as in recordings
  /// without kZeroRule.
  enum class WithoutMarks { NeedAZero, Untouched };
  /// If `config` has no counter card, the object changes no sample.
  explicit AxisZeros(const Config& config, WithoutMarks without_marks = WithoutMarks::NeedAZero);

  /// For a replay that does not begin with the first file of a recording: starts from the state at
  /// the end of the previous file instead of from the first set-up of the card. Axes in the mask
  /// `state.unknown` lose every zero found before `state.at`.
  void go_on(const ZeroState& state);
  /// Adds a zero. Call it in order of time.
  void found(const FoundZero& zero);
  /// Sets the readings of axis samples, of touches and of the scans around touches.
  void apply(Batch& batch);

  [[nodiscard]] bool known(std::size_t axis) const;
  /// The zero of each referenced axis after the newest sample.
  [[nodiscard]] std::vector<FoundZero> current() const;

 private:
  struct Axis {
    std::size_t place = 0;
    double step = 0.0;
    double offset = 0.0;        // offset that the driver has used
    bool zero_is_here = false;  // the zero is known at the first set-up of the card
    std::deque<FoundZero> coming;
    std::optional<FoundZero> current;
  };
  void move_on(const protocol::SampleHead& head);
  void apply(protocol::AxisSample& sample);
  void apply(protocol::ProbeTrigger& touch) const;
  template <class Counted>
  void apply_to_counts(Counted& sample) const;

  std::vector<Axis> axes_;
  // a sample was applied: from now on a restart of the counters is not the first set-up
  bool begun_ = false;
};

/// Name of the attachment of a FoundZero in the recording, for a replay from raw bytes.
inline constexpr std::string_view kZeroName = "datum.json";
/// Key in the version entries of a recording. In a recording with this key, axes without marks are
/// not referenced until the operator states their zero (WithoutMarks::NeedAZero).
inline constexpr const char* kZeroRule = "datum";
/// Name of the attachment with the start time of a search for reference marks. The search uses only
/// crossings and samples later than this time.
inline constexpr std::string_view kReferenceRequestName = "reference.json";
[[nodiscard]] RecordingAttachment reference_request(protocol::HostTime from);
[[nodiscard]] Result<protocol::HostTime> reference_request_from(
    const RecordingAttachment& attachment);
/// Name of the attachment of a ZeroState, at the start of each further file of a recording. Every
/// zero that was found before and is still valid is attached, too.
inline constexpr std::string_view kZeroStateName = "datum-state.json";
[[nodiscard]] RecordingAttachment to_attachment(const ZeroState& state);
[[nodiscard]] Result<ZeroState> zero_state_from_attachment(const RecordingAttachment& attachment);
[[nodiscard]] RecordingAttachment to_attachment(const FoundZero& zero);
[[nodiscard]] Result<FoundZero> zero_from_attachment(const RecordingAttachment& attachment);

}  // namespace abbe::daemon
