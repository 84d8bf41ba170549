#pragma once
/// A program that prints measurements as lines of text, without its transport: a time in, text out.
/// It measures on a grid of its own clock while a receiver is connected, and prints a burst every
/// 332 ms (5 to 95 %: 324 to 344), as the programs of tracker manufacturers do, or each line at
/// once. Derived classes measure and print one line. Not thread-safe.

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>

#include "abbe/protocol/lines/line_format.hpp"
#include "abbe/sim/device_clock.hpp"
#include "abbe/sim/fault.hpp"
#include "abbe/sim/sim_clock.hpp"
#include "abbe/sim/tracker_model.hpp"

namespace abbe::sim {

namespace lines = protocol::lines;

struct LineTimes {
  DeviceClock clock{};
  /// from a measurement to the earliest burst that contains it, or to its line
  std::chrono::nanoseconds delay = std::chrono::milliseconds{1};
  std::chrono::nanoseconds separation = std::chrono::milliseconds{2};
  bool bursts = true;  ///< false: each line at once
  std::uint64_t seed = 1;
};

class LineSource {
 public:
  /// Switched on at `now`.
  LineSource(const LineTimes& times, HostTime now) : times_(times), power_on_(now) {}
  LineSource(const LineSource&) = delete;
  LineSource& operator=(const LineSource&) = delete;
  virtual ~LineSource() = default;

  /// A receiver is connected from now on, or none any more: what is measured meanwhile is lost.
  void connected(HostTime now);
  void disconnected();
  /// Measures and prints everything that is due until `now`.
  void advance(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  /// The lines printed since the last call.
  [[nodiscard]] std::string take_output();
  /// True once after a fault that breaks the connection.
  [[nodiscard]] bool take_hang_up();

  /// Faults of every program: Stall, Mute, Disconnect, TrackerGarbage (a line that is no
  /// measurement), PrismError (invalid status). Derived classes have more.
  void inject(const Fault& fault, HostTime now);

  [[nodiscard]] std::optional<HostTime> first_stream() const { return first_stream_; }
  [[nodiscard]] std::uint64_t points_sent() const { return points_sent_; }

 protected:
  /// One measurement of the grid; `index` selects the random numbers of its noise.
  struct Instant {
    HostTime measured{};
    DeviceTime shown{};  ///< on the clock of the program
    std::uint64_t index = 0;
    bool valid = true;  ///< no fault makes it invalid
  };
  /// The line of a measurement, with LF; empty: nothing was measured.
  [[nodiscard]] virtual std::string print(const Instant& instant) const = 0;
  /// A fault that is not one of every program.
  virtual void inject_own(const Fault& /*fault*/, HostTime /*now*/, HostTime /*until*/) {}

 private:
  void print_until(HostTime at);
  [[nodiscard]] DeviceTime next_instant() const;
  [[nodiscard]] HostTime next_print(HostTime after);

  LineTimes times_;
  HostTime power_on_;
  std::optional<DeviceTime> grid_;  ///< time of the measurement number 0
  std::uint64_t next_point_ = 0;    ///< on the grid
  std::optional<HostTime> next_print_;
  std::uint64_t bursts_ = 0;
  std::uint64_t points_sent_ = 0;
  std::optional<HostTime> first_stream_;
  std::string out_;
  bool hang_up_ = false;
  MeasuringTime invalid_;
  HostTime mute_until_ = HostTime::min();
  HostTime stall_until_ = HostTime::min();
};

/// The text of a time column.
[[nodiscard]] std::string time_text(DeviceTime t, lines::TimeUnit unit);
/// The text of a status column: the first valid status of the format, or "1"; invalid: "bad".
[[nodiscard]] std::string status_text(const lines::LineSyntax& syntax, bool valid);
/// A line with LF; `column(i)` is the text of column i, with a decimal point.
template <class Column>
[[nodiscard]] std::string printed(const lines::LineSyntax& syntax, Column column) {
  std::string line;
  for (std::size_t i = 0; i < syntax.column_count; ++i) {
    std::string text = column(i);
    for (char& c : text)
      if (c == '.') c = syntax.decimal_sign;
    if (i > 0) line += syntax.separator;
    line += text;
  }
  return line + "\n";
}

}  // namespace abbe::sim
