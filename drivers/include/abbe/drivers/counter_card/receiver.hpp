#pragma once
/// From the bytes of a counter card to scans in SI and in host time. Sans-I/O and deterministic:
/// the same bytes with the same arrival times give the same scans, live or replayed. Real time:
/// allocation-free, no system call. One thread. About 200 kB: keep it on the heap.
///
/// The stream has neither head nor number. What keeps it honest is the clock channel: it must
/// advance by the same count from scan to scan. A scan that does not fit is held back until the
/// next one confirms it (then it comes after a gap, of so many scans) or does not (then it was no
/// scan; kMostRefused of these in a row: out of step).
///
/// Raw blocks of a counter card: USB/IP messages, whatever the transport was
/// (protocol/usbip/urb.hpp). ToDevice: the header of each control request, as sent. FromDevice:
/// header and data of each answer, the endpoint filled in. A recording may begin anywhere: the
/// receiver seeks the beginning of a scan by the clock.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "abbe/drivers/clock_model.hpp"
#include "abbe/drivers/counter_card/latch.hpp"
#include "abbe/drivers/counter_card/progress.hpp"
#include "abbe/drivers/counter_card/scan.hpp"
#include "abbe/drivers/counter_card/wiring.hpp"
#include "abbe/protocol/quad08/stream.hpp"
#include "abbe/protocol/rt.hpp"
#include "abbe/protocol/samples.hpp"
#include "abbe/protocol/usb/setup.hpp"
#include "abbe/protocol/usbip/urb.hpp"

namespace abbe::drivers {

struct CounterCardReceiverOptions {
  CounterCardWiring wiring;
  ClockModelOptions clock{.max_constant_delay =
                              std::chrono::milliseconds{1}};  ///< FIFO, bus, host controller
  /// The counters as an earlier run of the program left them. Their scans are withheld until the
  /// clock channel has shown, for 0.25 s, that it stands where it must if they went on (to 50 ms
  /// and 200 ppm of the time between); then the counts go on after a gap. Else
  /// CounterCardCounters::restarted, and no scans before the counters were set up.
  std::optional<CounterCardProgress> goes_on_from;
};

/// Since construction.
struct CounterCardCounters {
  std::uint64_t scans = 0;
  std::uint64_t gaps = 0;
  std::uint64_t lost_scans = 0;           ///< by the clock's count
  std::uint64_t refused_scans = 0;        ///< that the clock did not fit
  std::uint64_t edges = 0;                ///< changes of the latch
  std::uint64_t latch_disagreements = 0;  ///< latches outside the scan in which they came
  std::uint64_t clock_jumps = 0;          ///< the time base went away from the host's clock
  std::uint64_t restarted = 0;            ///< an opened card did not continue the clock's count
  std::uint64_t withheld_scans = 0;       ///< while it was not known whether the counters went on
};

class CounterCardReceiver {
 public:
  static constexpr std::size_t kMostRefused = 8;
  static constexpr std::size_t kLongestTransfer = 65536;
  static constexpr std::size_t kLongestMessage = protocol::usbip::kUrbHeaderSize + kLongestTransfer;

  /// `options.wiring` has passed check().
  explicit CounterCardReceiver(const CounterCardReceiverOptions& options);
  CounterCardReceiver(const CounterCardReceiver&) = delete;
  CounterCardReceiver& operator=(const CounterCardReceiver&) = delete;

  /// A control request on its way to the card: asking for the firmware version opens it, setting a
  /// counter up zeroes it, starting the data transfer begins the stream anew.
  void on_control(const protocol::usb::Setup& setup) ABBE_RT;
  /// Bytes of the scan endpoint; then next() until it gives nothing. The bytes are borrowed until
  /// then.
  void push(std::span<const std::byte> bytes, protocol::HostTime arrival) ABBE_RT;
  /// Scans in order, valid until the next call; none: push more.
  [[nodiscard]] std::span<const CounterScan> next() ABBE_RT;
  /// A hole in a recording: seeks the next scan.
  void bytes_lost() ABBE_RT;

  /// Bytes come that are no scans; nothing more is taken until the stream begins anew.
  [[nodiscard]] bool out_of_step() const ABBE_RT { return out_of_step_; }
  /// What the clock channel counted in the latest scan that was refused, and what it had to.
  [[nodiscard]] std::uint64_t refused_step() const ABBE_RT { return refused_step_; }
  [[nodiscard]] double expected_step() const ABBE_RT { return metronome_.step; }
  /// How far the clock channel was behind where it must stand, s, when the counters were last seen
  /// not to go on.
  [[nodiscard]] double behind_s() const ABBE_RT { return behind_s_; }

  /// Replay: one raw block; every scan it completes to sink(const CounterScan&). Total.
  template <class Sink>
  void on_raw(const protocol::RawBlock& block, Sink&& sink) {
    if (!join(block)) return;
    for (auto scans = next(); !scans.empty(); scans = next())
      for (const auto& scan : scans) sink(scan);
  }

  [[nodiscard]] const CounterCardCounters& counters() const ABBE_RT { return counters_; }
  [[nodiscard]] ClockStatus clock() const ABBE_RT { return clock_.status(); }
  [[nodiscard]] double skew_beyond_limit() const ABBE_RT { return clock_.skew_beyond_limit(); }

 private:
  static constexpr std::size_t kBatch = 512;

  struct Axis {
    std::size_t place = 0;
    double scale = 0.0;
    double offset = 0.0;
  };
  /// Counters of an earlier run, as long as it is not known whether they went on.
  struct Resumption {
    protocol::HostTime since{};               ///< of `last_`
    std::optional<protocol::HostTime> begun;  ///< first scan withheld
    double least_behind_s = 0.0;
    bool refused = false;
  };
  struct LongGap {
    std::int64_t clock_count = 0;  ///< of the scan after it
    double length_s = 0.0;
  };

  /// True: a message of scans is pushed.
  [[nodiscard]] bool join(const protocol::RawBlock& block) ABBE_RT;
  [[nodiscard]] bool on_raw_message(protocol::RawBlock::Direction direction,
                                    protocol::HostTime time) ABBE_RT;

  void counters_zeroed() ABBE_RT;
  void stream_began() ABBE_RT;
  [[nodiscard]] std::optional<quad08::RawScan> next_raw() ABBE_RT;
  void seek() ABBE_RT;
  void take(const quad08::RawScan& raw) ABBE_RT;
  void refuse(const quad08::RawScan& from, const quad08::RawScan& to) ABBE_RT;
  void accept(const quad08::RawScan& raw) ABBE_RT;
  void count_lost(std::uint64_t clock_step, CounterScan& scan) ABBE_RT;
  void judge_first_scan(const quad08::RawScan& raw) ABBE_RT;
  [[nodiscard]] bool goes_on(const quad08::RawScan& raw) ABBE_RT;
  [[nodiscard]] double seconds_behind(const quad08::RawScan& raw, protocol::HostTime since) ABBE_RT;
  void seed(const CounterCardProgress& from);
  [[nodiscard]] bool resumed(const quad08::RawScan& raw) ABBE_RT;
  void take_over(const quad08::RawScan& raw) ABBE_RT;
  void restart() ABBE_RT;
  void keep_gap(const LongGap& gap) ABBE_RT;
  [[nodiscard]] double seconds_since(const LongGap& gap, std::int64_t clock_count) const ABBE_RT;
  void unwrap(const quad08::RawScan& raw, CounterScan& scan) ABBE_RT;
  void follow_latch(const quad08::RawScan& raw, std::int64_t previous_clock,
                    CounterScan& scan) ABBE_RT;
  void stamp() ABBE_RT;
  void mark_restart(std::span<CounterScan> scans, double ahead_s) ABBE_RT;
  [[nodiscard]] bool beats(const quad08::RawScan& from, const quad08::RawScan& to) const ABBE_RT;
  [[nodiscard]] protocol::DeviceTime device_time(std::int64_t clock_count) const ABBE_RT;

  quad08::CountWidth width_;
  double clock_hz_;
  quad08::Metronome metronome_;
  std::array<Axis, protocol::kMaxAxes> axes_{};
  std::optional<std::size_t> latch_place_;
  std::optional<std::size_t> edge_place_;
  ClockModel clock_;
  LatchTracker latch_;
  CounterCardCounters counters_;

  quad08::ScanDecoder decoder_;
  std::span<const std::byte> pending_;  ///< pushed, not yet given to the decoder
  protocol::HostTime arrival_{};
  bool seeking_ = true;
  std::array<std::byte, 512> window_{};  ///< while seeking
  std::size_t window_filled_ = 0;

  bool out_of_step_ = false;
  std::uint64_t refused_step_ = 0;
  std::size_t refused_run_ = 0;
  std::optional<quad08::RawScan> last_;  ///< accepted
  bool reopened_ = false;                ///< the card was closed since
  std::optional<Resumption> resumption_;
  double behind_s_ = 0.0;
  std::uint64_t clock_wraps_ = 0;  ///< whole ranges the clock counted while the stream stood
  std::optional<quad08::RawScan> candidate_;  ///< held back until the next one confirms it
  protocol::SampleFlags pending_flags_ = 0;
  bool stream_restarted_ = false;
  std::optional<LongGap> long_gap_;  ///< that may be a restart of the card: the longest of late
  CounterScan current_;              ///< counts go on from scan to scan
  std::array<CounterScan, kBatch> scans_{};
  std::size_t scan_count_ = 0;
  bool zeroed_ = false;  ///< the stream is known from where the counters were set up

  std::array<std::byte, kLongestMessage> raw_{};  ///< replay: parts of one message
  std::size_t raw_filled_ = 0;
};

}  // namespace abbe::drivers
