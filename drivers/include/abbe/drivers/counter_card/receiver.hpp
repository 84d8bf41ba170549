#pragma once
/// Converts the bytes of a counter card to scans in SI units and host time. Sans-I/O and
/// deterministic: the same bytes with the same arrival times give the same scans, live or replayed.
/// Real time: no allocation, no system call. One thread. About 200 kB: keep it on the heap.
///
/// The stream has neither headers nor sequence numbers. The clock channel serves as the check: it
/// must advance by the same count from scan to scan. A scan whose clock count does not fit the
/// previous one is held back.
///  - If the next scan fits to the held scan, both are output after a gap. The clock's count gives
///    the number of lost scans.
///  - Otherwise the held scan is refused: its bytes were not a scan. After kMostRefused consecutive
///    refusals the receiver is out of step: it has lost the beginning of the scans.
///
/// Raw blocks of a counter card are USB/IP messages (protocol/usbip/urb.hpp), for any transport:
///   ToDevice    header of each control request, as sent
///   FromDevice  header and data of each answer, with the endpoint filled in
/// A recording may begin at any byte: the receiver finds the beginning of a scan by the clock.

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
  /// Model of the card's clock. The constant part of the delay of a scan in FIFO, USB bus and host
  /// controller is at most 1 ms; the variable part is not limited.
  ClockModelOptions clock{.max_constant_delay = std::chrono::milliseconds{1}};
  /// State of the counters at the end of an earlier run of the program. Scans are withheld until
  /// the clock channel agrees for 0.25 s with the count expected of counters that ran on since then
  /// (tolerance: 50 ms and 200 ppm of the time between); then the counts continue after a gap.
  /// Otherwise CounterCardCounters::restarted increases, and scans are withheld until the counters
  /// are set up.
  std::optional<CounterCardProgress> resume_from;
};

/// Numbers of events since construction.
struct CounterCardCounters {
  std::uint64_t scans = 0;
  std::uint64_t gaps = 0;
  std::uint64_t lost_scans = 0;           ///< computed from the clock's count
  std::uint64_t refused_scans = 0;        ///< their clock count did not fit
  std::uint64_t edges = 0;                ///< changes of the latch
  std::uint64_t latch_disagreements = 0;  ///< latches outside their scan interval
  std::uint64_t clock_jumps = 0;          ///< the card's clock jumped relative to the host's
  std::uint64_t restarted = 0;            ///< times that counters had not continued after opening
  std::uint64_t withheld_scans = 0;       ///< scans before it was known that counters continued
};

class CounterCardReceiver {
 public:
  static constexpr std::size_t kMostRefused = 8;
  static constexpr std::size_t kLongestTransfer = 65536;
  static constexpr std::size_t kLongestMessage = protocol::usbip::kUrbHeaderSize + kLongestTransfer;

  /// Precondition: `options.wiring` has passed check().
  explicit CounterCardReceiver(const CounterCardReceiverOptions& options);
  CounterCardReceiver(const CounterCardReceiver&) = delete;
  CounterCardReceiver& operator=(const CounterCardReceiver&) = delete;

  /// Call it for every control request to the card: reading the firmware version opens the card, a
  /// counter set-up zeroes the counters, and a start of the data transfer restarts the stream.
  void on_control(const protocol::usb::Setup& setup) ABBE_RT;
  /// Takes bytes of the scan endpoint. Call next() until it returns an empty span; the bytes must
  /// stay valid until then.
  void push(std::span<const std::byte> bytes, protocol::HostTime arrival) ABBE_RT;
  /// The next scans in order, valid until the next call; empty: all pushed bytes are processed.
  [[nodiscard]] std::span<const CounterScan> next() ABBE_RT;
  /// Call it where bytes of a recording are missing. The receiver then searches for the beginning
  /// of the next scan.
  void bytes_lost() ABBE_RT;

  /// True if the received bytes are not scans. Further bytes are ignored until the stream restarts.
  [[nodiscard]] bool out_of_step() const ABBE_RT { return out_of_step_; }
  /// Clock counts per scan: as observed in the latest refused scan, and as expected.
  [[nodiscard]] std::uint64_t refused_step() const ABBE_RT { return refused_step_; }
  [[nodiscard]] double expected_step() const ABBE_RT { return metronome_.step; }
  /// Delay of the clock channel relative to its expected count, s, when it was last found that the
  /// counters had not continued; negative: the clock channel was ahead.
  [[nodiscard]] double behind_s() const ABBE_RT { return behind_s_; }

  /// Replay: processes one raw block and passes every scan to sink(const CounterScan&). Accepts
  /// any bytes.
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
  /// Counters of an earlier run, until it is known whether they have continued.
  struct Resumption {
    protocol::HostTime since{};               ///< time of `last_`
    std::optional<protocol::HostTime> begun;  ///< arrival of the first withheld scan
    double least_behind_s = 0.0;
    bool refused = false;
  };
  struct LongGap {
    std::int64_t clock_count = 0;  ///< clock count of the scan after the gap
    double length_s = 0.0;
  };

  /// Adds a recorded block to raw_. True: the block completed a message with scans, which was
  /// passed to push().
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
  [[nodiscard]] bool clock_fits(const quad08::RawScan& from,
                                const quad08::RawScan& to) const ABBE_RT;
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
  std::span<const std::byte> pending_;  ///< pushed, but not yet decoded
  protocol::HostTime arrival_{};
  bool seeking_ = true;
  /// used while the receiver searches for the beginning of a scan
  std::array<std::byte, 512> window_{};
  std::size_t window_filled_ = 0;

  bool out_of_step_ = false;
  std::uint64_t refused_step_ = 0;
  std::size_t refused_run_ = 0;
  std::optional<quad08::RawScan> last_;  ///< the last accepted scan
  bool reopened_ = false;                ///< the card was opened again since `last_`
  std::optional<Resumption> resumption_;
  double behind_s_ = 0.0;
  std::uint64_t clock_wraps_ = 0;             ///< wraps of the clock while the stream was stopped
  std::optional<quad08::RawScan> candidate_;  ///< held back until the next one confirms it
  protocol::SampleFlags pending_flags_ = 0;
  bool stream_restarted_ = false;
  std::optional<LongGap> long_gap_;  ///< longest recent gap; possibly a restart of the card
  CounterScan current_;              ///< counts are kept between scans
  std::array<CounterScan, kBatch> scans_{};
  std::size_t scan_count_ = 0;
  bool zeroed_ = false;  ///< the stream was received since the set-up of the counters

  std::array<std::byte, kLongestMessage> raw_{};  ///< replay: parts of one message
  std::size_t raw_filled_ = 0;
};

}  // namespace abbe::drivers
