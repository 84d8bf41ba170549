#pragma once
/// A USB-QUAD08 counter card: the registers behind endpoint 0 and the stream of scans behind
/// endpoint 82h, with counters for scales, a clock and a probe. Sans-I/O and without a clock:
/// requests and a time in, answers out. Scans are computed when they are requested, for the
/// instants of the pacer's ticks. Not thread-safe.
///
/// Assumptions not yet verified on hardware:
///   - A counter with latch-on-index reports in each scan its count at the latest index edge since
///     it was set up, and 0 before the first edge.
///   - The FIFO has the depth `fifo_bytes`. A full FIFO ends the scan with status bit 4.
///   - A counter reads 0 until it is set up. It keeps counting through every event on the bus as
///     long as the card has power.

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "abbe/protocol/quad08/channel.hpp"
#include "abbe/protocol/quad08/scan_list.hpp"
#include "abbe/protocol/usb/setup.hpp"
#include "abbe/sim/exported_card.hpp"
#include "abbe/sim/sim_clock.hpp"

namespace abbe::sim {

namespace quad08 = protocol::quad08;
namespace usb = protocol::usb;

/// The signal on phases A and B of a counter.
struct ScaleSignal {
  std::function<double(HostTime)> reading;  ///< m or rad
  double step = 10e-9;        ///< m or rad per count, four counts a signal period; may be negative
  double noise = 0.0;         ///< standard deviation of a reading, m or rad
  std::vector<double> marks;  ///< scale readings of the index pulses, ascending
};
struct ClockSignal {
  double hz = 10e6;
  double deviation_ppm = 0.0;  ///< rate error relative to the host's clock
};
/// The card's own timer output 0, which runs after the command that starts it.
struct TimerSignal {};
/// A counter of probe edges: each trigger of the probe is one edge.
struct ProbeSignal {};
using PhaseSignal =
    std::variant<std::monostate, ScaleSignal, ClockSignal, TimerSignal, ProbeSignal>;

struct CardChannel {
  PhaseSignal phases;
  /// true: the probe is connected to the index input; false: a scale's own index pulses are
  bool probe_on_index = false;
};

struct CounterCardOptions {
  std::string serial = "01ABBE08";
  std::uint16_t vendor = quad08::kVendor;
  std::uint16_t product = quad08::kProduct;
  std::uint16_t firmware = 0x0104;
  std::array<CardChannel, quad08::kChannels> channels;
  std::size_t fifo_bytes = std::size_t{256} * 1024;
  double pacer_deviation_ppm = 0.0;
  std::uint64_t seed = 1;
};

class CounterCard final : public ExportedCard {
 public:
  explicit CounterCard(const CounterCardOptions& options);

  /// Answers a control transfer; nullopt: the card stalls it.
  [[nodiscard]] std::optional<std::vector<std::byte>> control(const usb::Setup& setup,
                                                              HostTime now);
  [[nodiscard]] ControlAnswer answer(const usb::Setup& setup, HostTime now) override;
  [[nodiscard]] UsbIds ids() const override { return {options_.vendor, options_.product}; }
  /// Makes the scans due until `now`. The card overruns if these scans have more bytes than the
  /// free FIFO plus the `wanted` bytes that the host has requested.
  void advance(HostTime now, std::size_t wanted) override;
  [[nodiscard]] std::vector<std::byte> take(std::size_t most) override;
  [[nodiscard]] std::size_t available() const override { return fifo_.size(); }
  [[nodiscard]] HostTime available_at(std::size_t bytes) const override;
  [[nodiscard]] bool scanning() const override { return pacing_ && !overrun_; }

  /// Adds an edge of the probe at `at`: not earlier than the previous edges nor than the scans
  /// already made.
  void add_probe_edge(HostTime at);
  /// Switches the power off and on: registers, counters and FIFO are as in a new card.
  void restart();

  // Fault injection.
  void overrun() { overrun_ = true; }
  /// The next scan lacks its first `bytes` bytes: all later scans are shifted in the stream until
  /// the scan is restarted.
  void tear(std::size_t bytes) { torn_ = bytes; }
  void lose_scans(std::size_t count);          ///< the next `count` scans are not made
  void jump_clock(std::int64_t counts);        ///< adds `counts` to every clock counter
  void corrupt_register(std::uint16_t value);  ///< the self-test register reads `value` from now on
  /// The next `count` control transfers are stalled.
  void fail_controls(std::size_t count) { failing_controls_ = count; }

  [[nodiscard]] const CounterCardOptions& options() const { return options_; }

 private:
  struct Counter {
    quad08::CounterSetup setup{.register_reading = true};
    bool set_up = false;    ///< set up since power-on; otherwise the counter reads 0
    std::int64_t zero = 0;  ///< count of the signal when the counter was set up
    HostTime set_up_at{};
    std::optional<double> last_reading;  ///< reading of a scale at the previous scan
    std::uint64_t latched = 0;
  };

  void write_register(std::uint16_t where, std::uint16_t value, HostTime now);
  [[nodiscard]] std::uint16_t read_register(std::uint16_t where, HostTime now);
  [[nodiscard]] std::optional<std::vector<std::byte>> standard(const usb::Setup& setup);
  [[nodiscard]] std::optional<std::vector<std::byte>> descriptor(const usb::Setup& setup) const;
  void control_acquisition(std::uint16_t value, HostTime now);
  void set_up_counter(std::uint16_t value, HostTime now);
  void control_timer(std::uint16_t value, HostTime now);
  [[nodiscard]] std::uint16_t status() const;

  [[nodiscard]] HostTime scan_time(std::uint64_t scan) const;
  void make_scan(HostTime at);
  [[nodiscard]] std::uint64_t value_of(std::size_t channel, HostTime at);
  [[nodiscard]] std::uint64_t latched_value(std::size_t channel, HostTime at);
  [[nodiscard]] std::int64_t signal_count(std::size_t channel, HostTime at);
  [[nodiscard]] std::int64_t scale_count(const ScaleSignal& scale, double reading) const;
  [[nodiscard]] double scale_reading(std::size_t channel, const ScaleSignal& scale, HostTime at);
  [[nodiscard]] std::int64_t timer_count(HostTime at) const;
  [[nodiscard]] std::int64_t probe_count(HostTime at) const;
  [[nodiscard]] std::optional<HostTime> latest_edge(HostTime at) const;

  CounterCardOptions options_;
  std::array<Counter, quad08::kChannels> counters_{};
  std::uint16_t bank_ = 0;
  std::uint16_t mark_ = 0;
  std::optional<std::uint16_t> corrupted_mark_;
  std::size_t failing_controls_ = 0;
  std::vector<std::uint16_t> scan_words_;
  quad08::ScanLayout layout_;
  std::uint64_t divisor_ = 0;
  bool dma_ = false;
  bool list_started_ = false;
  bool pacing_ = false;
  bool overrun_ = false;
  HostTime pacer_began_{};
  std::uint64_t next_scan_ = 0;
  std::vector<std::uint16_t> timer_words_;
  std::optional<HostTime> timer_began_;
  std::int64_t clock_jump_ = 0;
  std::uint64_t readings_ = 0;
  std::deque<HostTime> edges_;
  std::int64_t edges_forgotten_ = 0;
  std::deque<std::byte> fifo_;
  std::size_t torn_ = 0;  ///< bytes the next scan lacks
};

}  // namespace abbe::sim
