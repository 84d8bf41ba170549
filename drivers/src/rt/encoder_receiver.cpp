#include "abbe/drivers/can/encoder_receiver.hpp"

#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "abbe/protocol/can/cia406.hpp"
#include "abbe/protocol/can/error_frame.hpp"

namespace abbe::drivers {

using protocol::HostTime;
using protocol::SampleFlag;

namespace {

constexpr std::uint64_t kModulus32 = std::uint64_t{1} << 32;
constexpr double kMetresPerNanometre = 1e-9;
/// Number of cycles with exactly one answer in time after which an axis is settled. If n answers in
/// a row are late, n - 2 wrong positions are not detected. The row ends with a cycle that has two
/// answers. While the samples of the axis are held, the second answer detects one more wrong
/// position. After a row of more than 100 they are no longer held, but one position is less than 1
/// % of that row.
constexpr std::uint8_t kCyclesToSettle = 100;
/// Number of such cycles for an axis that has booted, or after a pause of the SYNC: no answer to an
/// earlier SYNC should be outstanding then, and one cycle confirms it.
constexpr std::uint8_t kCyclesToConfirm = 1;

/// Widens u, because the instant is uncertain by +- one period, rectangular. [GUM] 4.3.7.
std::chrono::nanoseconds widened(std::chrono::nanoseconds u,
                                 std::chrono::nanoseconds period) ABBE_RT {
  const double u_ns = std::hypot(static_cast<double>(u.count()),
                                 static_cast<double>(period.count()) / std::numbers::sqrt3);
  return std::chrono::nanoseconds{std::llround(u_ns)};
}

/// `count` modulo `modulus`, from 0 to modulus - 1; a modulus of 0 stands for 2^64.
std::uint64_t on_circle(std::int64_t count, std::uint64_t modulus) ABBE_RT {
  if (modulus == 0) return static_cast<std::uint64_t>(count);
  const auto m = static_cast<std::int64_t>(modulus);  // check() keeps it below 2^63
  return static_cast<std::uint64_t>((count % m + m) % m);
}

/// The step of smallest magnitude from `from` to `to`, for counts that wrap at `modulus` (0: 2^64).
std::int64_t wrapped_step(std::uint64_t from, std::uint64_t to, std::uint64_t modulus) ABBE_RT {
  if (modulus == 0) return static_cast<std::int64_t>(to - from);
  const std::uint64_t ahead = to >= from ? to - from : to + modulus - from;
  if (ahead < modulus - ahead) return static_cast<std::int64_t>(ahead);
  return -static_cast<std::int64_t>(modulus - ahead);
}

}  // namespace

EncoderReceiver::EncoderReceiver(const EncoderReceiverOptions& options)
    : axis_count_(std::min(options.axes.size(), axes_.size())),
      all_mask_(static_cast<std::uint8_t>((1u << axis_count_) - 1u)),
      period_(options.sync_period),
      answer_within_(answer_within(options)),
      sampling_delay_(options.sampling_delay),
      u_sampling_delay_(options.u_sampling_delay),
      u_widened_(widened(options.u_sampling_delay, options.sync_period)),
      heartbeat_timeout_(options.heartbeat_timeout),
      external_sync_(options.external_sync) {
  for (std::size_t i = 0; i < axis_count_; ++i) {
    const auto& from = options.axes[i];
    auto& axis = axes_[i];
    axis.node = from.node;
    axis.kind = from.kind;
    axis.type = from.position;
    axis.tpdo_id = can::cob::tpdo(from.tpdo, from.node);
    axis.mapping = static_cast<std::uint16_t>(can::object::kTpdoMapping + from.tpdo - 1);
    axis.position_byte = from.position_byte;
    axis.heartbeat_timeout = options.heartbeat_timeout;
    axis.cycles_to_hold = options.external_sync ? kCyclesToConfirm : 0;
    axis.scale_configured = from.scale.has_value();
    axis.scale = from.scale.value_or(0.0);
    axis.offset = from.offset;
    if (from.kind == AxisKind::Rotary) axis.middle = from.middle;
    axis.wrap_configured = from.wrap_counts != 0;
    axis.modulus = from.wrap_counts;
    if (!axis.wrap_configured && from.position != can::PositionType::Signed64)
      axis.modulus = kModulus32;
  }
  current_.axis_count = static_cast<std::uint8_t>(axis_count_);
  current_.position.fill(std::numeric_limits<double>::quiet_NaN());
  for (std::size_t i = axis_count_; i < current_.position.size(); ++i) current_.position[i] = 0.0;
}

std::optional<double> EncoderReceiver::scale(std::size_t axis) const ABBE_RT {
  if (axis >= axis_count_ || axes_[axis].scale == 0.0) return std::nullopt;
  return axes_[axis].scale;
}

HostTime EncoderReceiver::deadline() const ABBE_RT {
  if (open_) return *sync_time_ + answer_within_;
  return held_for_ != 0 ? *sync_time_ + period_ : HostTime::max();
}

EncoderReceiver::Samples EncoderReceiver::on_sent(const can::CanFrame& frame, HostTime time,
                                                  bool time_widened) ABBE_RT {
  out_count_ = 0;
  if (can::decode_sync(frame)) begin_cycle(time, time_widened);
  return done();
}

EncoderReceiver::Samples EncoderReceiver::on_time(HostTime now) ABBE_RT {
  out_count_ = 0;
  follow_time(now);
  return done();
}

EncoderReceiver::Samples EncoderReceiver::on_loss() ABBE_RT {
  out_count_ = 0;
  lose();
  return done();
}

EncoderReceiver::Samples EncoderReceiver::on_end() ABBE_RT {
  out_count_ = 0;
  release();
  return done();
}

void EncoderReceiver::lose() ABBE_RT {
  close_cycle();
  release();
  judge_answers(true);
  received_mask_ = 0;
  gap_pending_ = true;
}

EncoderReceiver::Samples EncoderReceiver::on_frame(const can::CanFrame& frame, HostTime time,
                                                   bool time_widened) ABBE_RT {
  out_count_ = 0;
  follow_time(time);
  if (frame.is(can::FrameFlag::Error)) {
    on_bus_report(frame, time);
  } else if (external_sync_ && can::decode_sync(frame)) {
    begin_cycle(time, time_widened);
  } else if (frame.is_standard_data()) {
    for (std::size_t i = 0; i < axis_count_; ++i) {
      if (frame.id == axes_[i].tpdo_id) {
        on_position(i, frame, time, time_widened);
      } else {
        on_node_frame(axes_[i], frame, time);
      }
    }
  }
  return done();
}

/// Ends the open cycle and releases the held sample if their deadlines have passed.
void EncoderReceiver::follow_time(HostTime now) ABBE_RT {
  if (open_ && now >= deadline()) close_cycle();
  if (held_for_ != 0 && now >= deadline()) release();
}

void EncoderReceiver::begin_cycle(HostTime time, bool time_widened) ABBE_RT {
  close_cycle();
  release();
  bool paused = false;
  if (sync_time_ && period_.count() > 0) {
    const auto periods = (time - *sync_time_ + period_ / 2) / period_;
    paused = periods > 1;
    if (paused) {
      lost_pending_ += static_cast<std::uint32_t>(std::min<std::int64_t>(periods - 1, 0xFFFF));
      counters_.missed_syncs += static_cast<std::uint64_t>(periods - 1);
    }
    ++cycle_;
  }
  judge_answers(paused);
  sync_time_ = time;
  time_widened_ = time_widened;
  received_mask_ = 0;
  doubtful_mask_ = std::exchange(mark_next_mask_, std::uint8_t{0});
  open_ = true;
  check_heartbeats(time);
}

/// Judges the answers of a cycle that has ended, before the next one begins. `paused`: the SYNC
/// paused, so that answers to earlier SYNCs have arrived or are lost.
void EncoderReceiver::judge_answers(bool paused) ABBE_RT {
  if (!sync_time_) return;
  for (std::size_t i = 0; i < axis_count_; ++i) {
    auto& axis = axes_[i];
    const bool answered = ((received_mask_ >> i) & 1u) != 0;
    const bool regular = answered && ((doubtful_mask_ >> i) & 1u) == 0;

    axis.reply_outstanding = !paused && (axis.reply_outstanding || (axis.answers && !answered));
    axis.answers = axis.answers && !paused;

    if (!regular) {
      axis.cycles_to_hold = kCyclesToSettle;
    } else if (axis.cycles_to_hold != 0) {
      --axis.cycles_to_hold;
    }
    if (!axis.answers) axis.cycles_to_hold = std::max(axis.cycles_to_hold, kCyclesToConfirm);
  }
}

void EncoderReceiver::close_cycle() ABBE_RT {
  if (open_) emit(*sync_time_ + sampling_delay_);
}

void EncoderReceiver::emit(HostTime time) ABBE_RT {
  open_ = false;
  auto known = std::uint8_t{0};
  for (std::size_t i = 0; i < axis_count_; ++i) {
    if (axes_[i].scale != 0.0) known = static_cast<std::uint8_t>(known | (1u << i));
  }
  const bool invalid = bus_off_;
  const auto usable =
      invalid ? 0u : static_cast<unsigned>(received_mask_ & ~doubtful_mask_ & known);
  const auto missing = static_cast<std::uint8_t>(all_mask_ & ~usable);

  for (std::size_t i = 0; i < axis_count_; ++i) counters_.missing_answers += (missing >> i) & 1u;
  current_.head.time = time;
  current_.head.u_time = time_widened_ ? u_widened_ : u_sampling_delay_;
  current_.head.lost_before = lost_pending_;
  current_.head.flags = take_flags(missing);
  current_.cycle = cycle_;
  current_.missing_mask = missing;
  held_for_ = static_cast<std::uint8_t>(usable & unsettled_mask());
  if (held_for_ == 0) output();
}

std::uint8_t EncoderReceiver::unsettled_mask() const ABBE_RT {
  unsigned mask = 0;
  for (std::size_t i = 0; i < axis_count_; ++i) mask |= axes_[i].cycles_to_hold != 0 ? 1u << i : 0u;
  return static_cast<std::uint8_t>(mask);
}

void EncoderReceiver::release() ABBE_RT {
  if (std::exchange(held_for_, std::uint8_t{0}) != 0) output();
}

void EncoderReceiver::output() ABBE_RT {
  ++counters_.samples;
  if (out_count_ < out_.size()) out_[out_count_++] = current_;
}

protocol::SampleFlags EncoderReceiver::take_flags(std::uint8_t missing) ABBE_RT {
  protocol::SampleFlags flags = 0;
  if (missing != 0) flags |= SampleFlag::AxisMissing;
  if (lost_pending_ != 0 || gap_pending_) flags |= SampleFlag::GapBefore;
  if (time_widened_) flags |= SampleFlag::TimeWidened;
  if (bus_error_pending_) flags |= SampleFlag::BusError;
  if (bus_off_) flags |= SampleFlag::BusOff;
  if (restarted_pending_ && missing != all_mask_) {
    flags |= SampleFlag::Restarted;
    restarted_pending_ = false;
  }
  for (std::size_t i = 0; i < axis_count_; ++i) {
    if (axes_[i].emergency != 0 || axes_[i].heartbeat_lost) flags |= SampleFlag::DeviceError;
  }
  lost_pending_ = 0;
  gap_pending_ = false;
  time_widened_ = false;
  bus_error_pending_ = false;
  return flags;
}

void EncoderReceiver::on_position(std::size_t i, const can::CanFrame& frame, HostTime time,
                                  bool time_widened) ABBE_RT {
  const auto count = can::decode_position(frame.payload(), axes_[i].type, axes_[i].position_byte);
  if (!count) {
    ++counters_.short_frames;
    return;
  }
  end_bus_off();
  const auto bit = static_cast<std::uint8_t>(1u << i);
  axes_[i].answers = true;

  if (sync_time_ && time + stamp_slack(period_) < *sync_time_) {
    ++counters_.late_frames;
    axes_[i].reply_outstanding = false;
    return;
  }

  const bool again = (received_mask_ & bit) != 0;
  if (again) ++counters_.duplicate_frames;
  if (!open_) return again ? on_second_answer(i, time) : count_late(i);
  if (again || std::exchange(axes_[i].reply_outstanding, false))
    doubtful_mask_ = static_cast<std::uint8_t>(doubtful_mask_ | bit);
  take_position(i, *count);
  time_widened_ = time_widened_ || time_widened;
  received_mask_ = static_cast<std::uint8_t>(received_mask_ | bit);
  if (received_mask_ == all_mask_) close_cycle();
}

/// Counts an answer that arrived after the deadline. It is discarded and no longer awaited.
void EncoderReceiver::count_late(std::size_t i) ABBE_RT {
  const auto bit = static_cast<std::uint8_t>(1u << i);
  ++counters_.late_frames;
  doubtful_mask_ = static_cast<std::uint8_t>(doubtful_mask_ | bit);
  if (!std::exchange(axes_[i].reply_outstanding, false))
    received_mask_ = static_cast<std::uint8_t>(received_mask_ | bit);
}

/// The cycle has ended with an answer of axis i that may belong to an earlier SYNC. If the sample
/// of the cycle is held, the axis becomes missing in it; if it was already output, the axis is
/// missing in the next sample. An answer more than a period after the SYNC belongs to a SYNC that
/// was not recorded; it does not affect the sample.
void EncoderReceiver::on_second_answer(std::size_t i, HostTime time) ABBE_RT {
  const auto bit = static_cast<std::uint8_t>(1u << i);
  const bool of_this_cycle = sync_time_ && time <= *sync_time_ + period_;
  if (!of_this_cycle) return;
  doubtful_mask_ = static_cast<std::uint8_t>(doubtful_mask_ | bit);
  if ((current_.missing_mask & bit) != 0) return;

  if (held_for_ == 0) {
    mark_next_mask_ = static_cast<std::uint8_t>(mark_next_mask_ | bit);
    return;
  }

  current_.missing_mask = static_cast<std::uint8_t>(current_.missing_mask | bit);
  current_.head.flags |= SampleFlag::AxisMissing;
  ++counters_.missing_answers;
  held_for_ = static_cast<std::uint8_t>(held_for_ & ~bit);
  if (held_for_ == 0) output();
}

/// A frame of a node was received, so the controller is no longer in bus-off.
void EncoderReceiver::end_bus_off() ABBE_RT {
  if (!bus_off_) return;
  bus_off_ = false;
  restarted_pending_ = true;
}

/// The first count of an axis. It is used as sent, because an absolute scale may be negative. For a
/// rotary axis, the first count may differ from the travel by whole ranges of the encoder; the
/// count nearest to the middle of the travel is used.
std::int64_t EncoderReceiver::first_count(const Axis& axis, std::int64_t count) ABBE_RT {
  if (!axis.middle || axis.modulus == 0 || axis.scale == 0.0) return count;
  constexpr double kMostCounts = 0x1p62;
  const double away = (*axis.middle - axis.offset) / axis.scale - static_cast<double>(count);
  if (!(std::abs(away) < kMostCounts)) return count;
  const auto ranges = std::llround(away / static_cast<double>(axis.modulus));
  return static_cast<std::int64_t>(static_cast<std::uint64_t>(count) +
                                   static_cast<std::uint64_t>(ranges) * axis.modulus);
}

void EncoderReceiver::take_position(std::size_t i, std::int64_t count) ABBE_RT {
  auto& axis = axes_[i];
  const auto raw = on_circle(count, axis.modulus);
  // Later counts are used as steps from the previous one.
  if (axis.seen) {
    const auto step = static_cast<std::uint64_t>(wrapped_step(axis.raw, raw, axis.modulus));
    current_.count[i] =
        static_cast<std::int64_t>(static_cast<std::uint64_t>(current_.count[i]) + step);
  } else {
    current_.count[i] = first_count(axis, count);
  }
  axis.raw = raw;
  axis.seen = true;
  if (axis.scale != 0.0)
    current_.position[i] = axis.offset + static_cast<double>(current_.count[i]) * axis.scale;
}

void EncoderReceiver::on_node_frame(Axis& axis, const can::CanFrame& frame, HostTime time) ABBE_RT {
  if (frame.id == can::cob::kHeartbeat + axis.node) {
    end_bus_off();
    if (const auto heartbeat = can::decode_heartbeat(frame))
      on_heartbeat(axis, heartbeat->state, time);
  } else if (frame.id == can::cob::kEmergency + axis.node) {
    if (const auto emergency = can::decode_emergency(frame)) {
      axis.emergency = emergency->code;
      if (emergency->code != 0) ++counters_.emergencies;
    }
  } else if (frame.id == can::cob::kSdoResponse + axis.node) {
    on_sdo_answer(axis, frame);
  }
}

void EncoderReceiver::on_heartbeat(Axis& axis, can::NodeState state, HostTime time) ABBE_RT {
  axis.last_heartbeat = time;
  axis.heartbeat_lost = false;
  if (state != can::NodeState::BootUp) return;
  axis.emergency = 0;
  axis.answers = axis.reply_outstanding = false;
  axis.last_heartbeat.reset();  // no heartbeat before it is configured
  if (axis.seen) restarted_pending_ = true;
}

void EncoderReceiver::check_heartbeats(HostTime time) ABBE_RT {
  for (std::size_t i = 0; i < axis_count_; ++i) {
    auto& axis = axes_[i];
    if (!axis.last_heartbeat || axis.heartbeat_lost ||
        time - *axis.last_heartbeat <= axis.heartbeat_timeout)
      continue;
    axis.heartbeat_lost = true;
    ++counters_.heartbeat_losses;
  }
}

void EncoderReceiver::on_bus_report(const can::CanFrame& frame, HostTime time) ABBE_RT {
  const auto report = can::decode_error_frame(frame);
  if (!report) return;
  ++counters_.bus_reports;
  using can::BusCondition;
  if (report->conditions != static_cast<can::BusConditions>(BusCondition::Active))
    bus_error_pending_ = true;
  if (has(report->conditions, BusCondition::ReceiveOverflow)) lose();
  const bool back = has(report->conditions, BusCondition::Restarted) ||
                    has(report->conditions, BusCondition::Active);
  if (has(report->conditions, BusCondition::BusOff) && !bus_off_) {
    bus_off_ = true;
    release();
    const auto last = open_ ? *sync_time_ + sampling_delay_ : time;
    // immediately, because until the deadline subscribers would use the previous sample
    emit(last);
  } else if (back && bus_off_) {
    bus_off_ = false;
    restarted_pending_ = true;
  }
}

void EncoderReceiver::on_sdo_answer(Axis& axis, const can::CanFrame& frame) ABBE_RT {
  // these are SDOs of the machine's master; the PDO mapping is configured in abbed.toml
  if (external_sync_) return;
  const auto index = static_cast<std::uint16_t>(frame.byte(1) | (frame.byte(2) << 8));
  const can::ObjectId object{index, frame.byte(3)};
  constexpr std::uint8_t kWritten = 0x60;
  if (frame.length == 8 && frame.byte(0) == kWritten && object == can::ObjectId{axis.mapping, 1})
    axis.position_byte = 0;
  // Expedited upload answer with its size: 4Fh, 4Bh, 47h, 43h for 1 to 4 bytes [CiA 301].
  const auto command = frame.byte(0);
  if (frame.length != 8 || (command & 0xF3) != 0x43) return;
  const std::size_t bytes = 4u - ((command >> 2) & 3u);
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < bytes; ++i) value |= std::uint32_t{frame.byte(4 + i)} << (8 * i);
  if (index == axis.mapping) {
    read_mapping(axis, object.sub, value);
  } else {
    read_object(axis, object, value);
  }
}

/// Reads the next entry of a PDO mapping that could not be written.
void EncoderReceiver::read_mapping(Axis& axis, std::uint8_t sub, std::uint32_t value) ABBE_RT {
  constexpr unsigned kBitsPerByte = 8;
  if (sub <= 1) axis.bits_before = 0;
  if (sub == 0) return;
  const auto wanted = can::mapped_position(axis.type);
  const auto mapped = can::decode_mapping(value);
  const bool multi_sensor = can::ObjectId{mapped.index, mapped.sub} == can::object::kMultiPosition;
  if (mapped == wanted || (multi_sensor && mapped.bits == wanted.bits)) {
    axis.position_byte = static_cast<std::uint8_t>(axis.bits_before / kBitsPerByte);
  }
  axis.bits_before += mapped.bits;
}

void EncoderReceiver::read_object(Axis& axis, can::ObjectId object, std::uint32_t value) ABBE_RT {
  namespace obj = can::object;
  const bool linear = axis.kind == AxisKind::Linear;
  const bool step = linear && (object == obj::kPositionStep || object == obj::kMeasuringStep);
  const bool turn =
      !linear && (object == obj::kUnitsPerRevolution || object == obj::kMeasuringStep);
  if (object == obj::kHeartbeatTime) {
    // The node's heartbeat period could not be set: the time-out is 3.5 times the period it
    // reports.
    axis.heartbeat_timeout = std::max(
        heartbeat_timeout_, std::chrono::nanoseconds{std::chrono::milliseconds{value}} * 7 / 2);
  } else if (object == obj::kDeviceType) {
    axis.single_turn = static_cast<obj::EncoderKind>(value >> 16) == obj::EncoderKind::SingleTurn;
  } else if (step || turn) {
    axis.units = turn ? value : 0;
    if (turn && axis.single_turn) wrap_at(axis, value);
    if (axis.scale_configured) return;
    if (value == 0) {
      ++counters_.scale_refusals;
      axis.scale = 0.0;
      return;
    }
    axis.scale = step ? kMetresPerNanometre * value : 2.0 * std::numbers::pi / value;
  } else if (!linear && object == obj::kTotalRange) {
    wrap_at(axis, value);
  } else if (!linear && object == obj::kRevolutions) {
    // Without scaling the position wraps after the number of distinguishable revolutions.
    wrap_at(axis, std::uint64_t{axis.units} * value);
  }
}

/// Sets the number of counts after which the position wraps, as the encoder reports it. The values
/// 0 and 1 are invalid and are ignored.
void EncoderReceiver::wrap_at(Axis& axis, std::uint64_t counts) ABBE_RT {
  if (axis.wrap_configured || counts <= 1) return;
  axis.modulus = axis.type == can::PositionType::Signed64 ? counts : std::min(counts, kModulus32);
  axis.raw %= axis.modulus;
}

}  // namespace abbe::drivers
