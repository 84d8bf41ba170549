#pragma once
/// Converts the frames of an encoder bus to AxisSamples. Sans-I/O and deterministic: the same
/// events in the same order give the same samples, so replay from raw bytes uses the same class.
/// Real time: no allocation after construction. One thread.
///
/// A cycle begins when our SYNC is sent (on_sent), or with external_sync when the machine's SYNC
/// arrives. It ends when the last axis has answered, at the deadline, at the next SYNC, or at
/// bus-off. Then its sample is output, or held (below). Axes without an answer are marked in
/// missing_mask and keep their previous value; an axis that never answered has position NaN. All
/// axes have one time: SYNC + sampling delay. An answer that arrives after the end of its cycle is
/// counted and not used. An answer with a time before the SYNC is not an answer to this SYNC.
///
/// An answer does not identify its SYNC. An answer that may belong to an earlier SYNC is doubtful,
/// and its axis is marked missing. Doubtful are
///  - the first answer after cycles without an answer, unless the node booted or the SYNC paused
///    for a period in between, and
///  - all answers of a cycle in which the node answers twice.
/// A sample is output once and not changed afterwards. Therefore a sample that contains an answer
/// of an unsettled axis is held until the next SYNC, but at most for a period after its own SYNC:
/// if the axis answers a second time, it is marked missing. A cycle that an axis does not answer
/// exactly once and in time makes it unsettled, until it has answered 100 cycles exactly once and
/// in time. An axis is also unsettled in the first cycle after its boot-up or a pause of the SYNC.
/// All other samples are output at once. If a settled axis nevertheless answers twice, its sample
/// was already output, and the axis is missing in the next sample.
///
/// What this class does not detect: if a node answers late in more than two consecutive cycles, its
/// first and its last late answers are doubtful, those in between are not. If a node is late from
/// its first answer on, or still late after a pause, its first late answers are not doubtful
/// either. Therefore the period must be longer than the slowest answer. The first of two answers of
/// a settled axis is used; drivers/docs/encoder.md gives the reasons.
///
/// The scale is configured, or read from SDO answers on the bus (6005h:01, else 6501h; rotary:
/// 6001h, else 6501h), so that a recording contains it. A scale of 0 is refused: the axis stays
/// missing. Also read from SDO answers: the position's place in a PDO mapping that could not be
/// written, and the period of a heartbeat that could not be set.
///
/// Raw blocks of a CAN bus: each block is one whole datagram of protocol/can/udp_framing.hpp; all
/// its frames have one host time.
///   FromDevice  frames as received; without frames (no bytes or count 0): no further frame arrived
///               before that time, which ends a cycle at its deadline, or releases a held sample
///   ToDevice    frames as sent, including the SYNC
/// The sequence number counts blocks.

#include <algorithm>
#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abbe/drivers/axis_kind.hpp"
#include "abbe/drivers/error.hpp"
#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/frame.hpp"
#include "abbe/protocol/can/pdo.hpp"
#include "abbe/protocol/can/sdo.hpp"
#include "abbe/protocol/can/udp_framing.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"

namespace abbe::drivers {

namespace can = protocol::can;

struct EncoderAxis {
  std::string name;  ///< "X"; for messages
  can::NodeId node = 1;
  AxisKind kind = AxisKind::Linear;
  can::PositionType position = can::PositionType::Signed32;
  std::uint8_t tpdo = 1;           ///< 1 or 2
  std::uint8_t position_byte = 0;  ///< byte in the TPDO at which the position begins
  std::optional<double> scale{};   ///< m or rad per count, negative reverses; none: read by SDO
  double offset = 0.0;             ///< m or rad: the reading at count 0
  /// Number of counts after which the position wraps to 0. 0: the range that the encoder reports;
  /// if it reports none, its revolution if it is a single-turn encoder, else 2^32 (2^64 for a
  /// position of 64 bits).
  std::uint64_t wrap_counts = 0;
  /// For a rotary axis: the middle of its travel, rad. The first count is moved by whole ranges
  /// (wrap_counts) so that its reading is nearest to the middle. nullopt: the first count is used
  /// as sent.
  std::optional<double> middle{};
  std::optional<std::uint32_t> serial{};  ///< compared with the encoder's if set
};

struct EncoderReceiverOptions {
  std::vector<EncoderAxis> axes;  ///< 1 to protocol::kMaxAxes, in the order of the sample
  std::chrono::nanoseconds sync_period = std::chrono::milliseconds{1};
  std::chrono::nanoseconds answer_within{};  ///< time after the SYNC; 0: 0.8 of the period
  /// Delay from the time of the SYNC to the sampling of the position in the encoder. It depends on
  /// the device and must be calibrated.
  std::chrono::nanoseconds sampling_delay{};
  /// standard uncertainty of sampling_delay
  std::chrono::nanoseconds u_sampling_delay = std::chrono::microseconds{50};
  std::chrono::nanoseconds heartbeat_timeout = std::chrono::milliseconds{350};
  bool external_sync = false;  ///< a cycle begins when the machine's SYNC arrives
};
/// Error BadConfiguration names the axis and what is wrong with it.
[[nodiscard]] Result<void> check(const EncoderReceiverOptions& options);
/// Time for the answers to a SYNC: `options.answer_within` or, if that is 0, 0.8 of the SYNC
/// period.
[[nodiscard]] std::chrono::nanoseconds answer_within(const EncoderReceiverOptions& options);
/// Tolerance when times of two clocks are compared: an answer earlier than the SYNC by less than
/// this counts as simultaneous with it.
[[nodiscard]] constexpr std::chrono::nanoseconds stamp_slack(
    std::chrono::nanoseconds sync_period) ABBE_RT {
  return sync_period / 50;
}

/// Numbers of events since construction.
struct EncoderCounters {
  std::uint64_t samples = 0;
  std::uint64_t missing_answers = 0;  ///< axes x cycles, including doubtful answers
  std::uint64_t late_frames = 0;
  std::uint64_t duplicate_frames = 0;  ///< answers after the first one in a cycle
  std::uint64_t short_frames = 0;      ///< TPDOs too short for a position
  std::uint64_t missed_syncs = 0;      ///< periods in which no SYNC was sent
  std::uint64_t emergencies = 0;
  std::uint64_t heartbeat_losses = 0;
  std::uint64_t bus_reports = 0;  ///< error frames
  std::uint64_t scale_refusals = 0;
  std::uint64_t bad_blocks = 0;  ///< raw blocks that are not a valid datagram
};

class EncoderReceiver {
 public:
  /// Precondition: `options` have passed check(). Allocates.
  explicit EncoderReceiver(const EncoderReceiverOptions& options);

  // Events, in the order in which they happened. Each returns the samples it completes (at most
  // two), valid until the next event.
  //
  // `time_widened`: the frame has no usable kernel timestamp. Then a position may be the answer to
  // the previous SYNC, and a SYNC may have been sent earlier than `time`: the sample is flagged
  // TimeWidened and its u_time is widened by one period, rectangular. Raw blocks do not contain
  // this flag: a replay from raw bytes gives the same positions without it.
  [[nodiscard]] std::span<const protocol::AxisSample> on_sent(const can::CanFrame& frame,
                                                              protocol::HostTime time,
                                                              bool time_widened = false) ABBE_RT;
  [[nodiscard]] std::span<const protocol::AxisSample> on_frame(const can::CanFrame& frame,
                                                               protocol::HostTime time,
                                                               bool time_widened = false) ABBE_RT;
  /// No further frame arrived before `now`: a cycle whose deadline has passed ends, and a sample
  /// whose time to be held has passed is output.
  [[nodiscard]] std::span<const protocol::AxisSample> on_time(protocol::HostTime now) ABBE_RT;
  /// Frames were lost at this point. The open cycle ends, because the next answer may belong to a
  /// SYNC that was lost; the next sample is flagged GapBefore.
  [[nodiscard]] std::span<const protocol::AxisSample> on_loss() ABBE_RT;
  /// No further event follows: a held sample is output. An open cycle gives no sample.
  [[nodiscard]] std::span<const protocol::AxisSample> on_end() ABBE_RT;
  /// The instant at which on_time() next has something to do: the deadline of the open cycle, the
  /// end of the period of a held sample, else HostTime::max().
  [[nodiscard]] protocol::HostTime deadline() const ABBE_RT;

  /// Replay: processes all events of one raw block and passes every sample to
  /// sink(const AxisSample&). Accepts any bytes.
  template <class Sink>
  void on_raw(const protocol::RawBlock& block, Sink&& sink) {
    const auto give = [&](std::span<const protocol::AxisSample> samples) {
      for (const auto& sample : samples) sink(sample);
    };

    const auto bytes =
        std::span{block.bytes}.first(std::min<std::size_t>(block.length, block.bytes.size()));
    if (block.lost_before > 0) give(on_loss());
    const bool sent = block.direction == protocol::RawBlock::Direction::ToDevice;
    if (bytes.empty() && !sent) return give(on_time(block.time));
    auto view = can::DatagramView::parse(bytes);
    if (!view) return count_bad_block();
    if (view->count() == 0 && !sent) return give(on_time(block.time));
    can::CanFrame frame;
    while (view->next(frame)) give(sent ? on_sent(frame, block.time) : on_frame(frame, block.time));
  }

  [[nodiscard]] const EncoderCounters& counters() const ABBE_RT { return counters_; }
  [[nodiscard]] bool bus_off() const ABBE_RT { return bus_off_; }
  /// Scale of the axis, m or rad per count; nullopt while it is unknown.
  [[nodiscard]] std::optional<double> scale(std::size_t axis) const ABBE_RT;

 private:
  struct Axis {
    can::NodeId node = 0;
    AxisKind kind{};
    can::PositionType type{};
    std::uint32_t tpdo_id = 0;
    std::uint16_t mapping = 0;  ///< mapping object of this TPDO, 1A00h or 1A01h
    std::uint8_t position_byte = 0;
    std::uint32_t bits_before = 0;  ///< offset of the mapping entry that is read next
    std::uint32_t units = 0;        ///< rotary: counts per revolution, as read
    bool single_turn = false;       ///< value from the device type
    std::optional<double> middle;   ///< middle of the travel of a rotary axis
    std::chrono::nanoseconds heartbeat_timeout{};
    bool scale_configured = false;
    bool wrap_configured = false;
    double scale = 0.0;         ///< 0: unknown
    double offset = 0.0;        ///< reading at count 0
    std::uint64_t modulus = 0;  ///< 0: 2^64
    bool seen = false;
    bool answers = false;            ///< node has answered since boot-up or the last SYNC pause
    bool reply_outstanding = false;  ///< the answer to an earlier SYNC may still arrive
    /// regular cycles until the axis is settled; 0: it is settled
    std::uint8_t cycles_to_hold = 0;
    std::uint64_t raw = 0;        ///< the latest count as sent, modulo `modulus`
    std::uint16_t emergency = 0;  ///< the latest code; 0: none
    bool heartbeat_lost = false;
    std::optional<protocol::HostTime> last_heartbeat;
  };
  using Samples = std::span<const protocol::AxisSample>;

  void begin_cycle(protocol::HostTime time, bool time_widened) ABBE_RT;
  void follow_time(protocol::HostTime now) ABBE_RT;
  void close_cycle() ABBE_RT;
  void lose() ABBE_RT;
  void emit(protocol::HostTime time) ABBE_RT;
  void release() ABBE_RT;
  void output() ABBE_RT;
  [[nodiscard]] std::uint8_t unsettled_mask() const ABBE_RT;
  [[nodiscard]] protocol::SampleFlags take_flags(std::uint8_t missing) ABBE_RT;
  [[nodiscard]] Samples done() const ABBE_RT { return {out_.data(), out_count_}; }
  void on_position(std::size_t i, const can::CanFrame& frame, protocol::HostTime time,
                   bool time_widened) ABBE_RT;
  void end_bus_off() ABBE_RT;
  void count_late(std::size_t i) ABBE_RT;
  void on_second_answer(std::size_t i, protocol::HostTime time) ABBE_RT;
  void judge_answers(bool paused) ABBE_RT;
  void take_position(std::size_t i, std::int64_t count) ABBE_RT;
  void on_node_frame(Axis& axis, const can::CanFrame& frame, protocol::HostTime time) ABBE_RT;
  void on_heartbeat(Axis& axis, can::NodeState state, protocol::HostTime time) ABBE_RT;
  void on_bus_report(const can::CanFrame& frame, protocol::HostTime time) ABBE_RT;
  void on_sdo_answer(Axis& axis, const can::CanFrame& frame) ABBE_RT;
  void read_mapping(Axis& axis, std::uint8_t sub, std::uint32_t value) ABBE_RT;
  void read_object(Axis& axis, can::ObjectId object, std::uint32_t value) ABBE_RT;
  static void wrap_at(Axis& axis, std::uint64_t counts) ABBE_RT;
  [[nodiscard]] static std::int64_t first_count(const Axis& axis, std::int64_t count) ABBE_RT;
  void check_heartbeats(protocol::HostTime time) ABBE_RT;
  void count_bad_block() ABBE_RT { ++counters_.bad_blocks; }

  std::array<Axis, protocol::kMaxAxes> axes_{};
  std::size_t axis_count_ = 0;
  std::uint8_t all_mask_ = 0;
  std::chrono::nanoseconds period_;
  std::chrono::nanoseconds answer_within_;
  std::chrono::nanoseconds sampling_delay_;
  std::chrono::nanoseconds u_sampling_delay_;
  std::chrono::nanoseconds u_widened_;
  std::chrono::nanoseconds heartbeat_timeout_;
  bool external_sync_;

  bool open_ = false;                            ///< the cycle has not ended
  std::optional<protocol::HostTime> sync_time_;  ///< time of the latest SYNC
  std::uint32_t cycle_ = 0;
  std::uint8_t received_mask_ = 0;  ///< answered in the latest cycle, also too late
  /// Axes that have answered in the latest cycle, but too late or with an answer that may belong to
  /// another SYNC.
  std::uint8_t doubtful_mask_ = 0;
  std::uint8_t mark_next_mask_ = 0;  ///< axes doubtful in the next cycle, whatever they answer
  /// Unsettled axes that have answered in current_. While there are any, current_ is held for their
  /// second answers; 0: it is not held.
  std::uint8_t held_for_ = 0;
  bool bus_off_ = false;
  bool bus_error_pending_ = false;  ///< an error frame arrived since the previous sample
  bool restarted_pending_ = false;
  bool gap_pending_ = false;
  bool time_widened_ = false;       ///< for the SYNC or for an answer of the open cycle
  std::uint32_t lost_pending_ = 0;  ///< SYNCs not sent; the next sample reports them as lost
  protocol::AxisSample current_;    ///< counts and positions are kept between cycles
  std::array<protocol::AxisSample, 4> out_{};
  std::size_t out_count_ = 0;
  EncoderCounters counters_;
};

}  // namespace abbe::drivers
