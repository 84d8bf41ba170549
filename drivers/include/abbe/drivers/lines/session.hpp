#pragma once
/// The connection to a sender of lines with its states, faults and raw blocks: what all devices
/// that send lines have in common. The device thread alone uses it; status() any thread.
///
/// States: "disconnected", "connecting", "waiting for the sender" (TCP server), "connected" (no
/// line yet), "streaming", "unreadable lines" (lines come, none can be read), "faulted" (no line
/// for silence_timeout). TCP connections are opened again after a silence; a datagram socket or a
/// serial line stays open.

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/lines/link.hpp"
#include "abbe/drivers/lines/receiver.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::drivers {

struct LineSessionOptions {
  std::string name;
  LineAddress address;
  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{3};
  /// A longer time without a line is a fault.
  std::chrono::nanoseconds silence_timeout = std::chrono::milliseconds{1500};
  std::size_t raw_capacity_blocks = 4096;
};

/// What the messages about lines name.
struct LineTexts {
  LineWords words;
  std::vector<std::string> columns;            ///< names, in their order
  std::chrono::nanoseconds time_separation{};  ///< as configured
  double max_skew = 0.0;                       ///< as in ClockModelOptions
};

class LineSession {
 public:
  /// `time` must outlive it.
  LineSession(LineSessionOptions options, LineTexts texts, const TimeSource& time);

  /// Reports what the receiver has found since the last call, and judges the silence.
  void report(const LineReception& found);
  /// Opens the connection if it is due, then waits for bytes and reads them.
  void wait(std::chrono::nanoseconds at_most);

  /// The next read of this cycle, whose raw blocks are then in raw(); an empty one is a new
  /// connection. nullopt: none.
  [[nodiscard]] std::optional<std::span<const std::byte>> next_read() ABBE_RT;
  [[nodiscard]] protocol::HostTime arrival() const ABBE_RT { return arrival_; }
  /// Samples of a read are in their ring.
  void received(std::size_t samples, protocol::HostTime last, const ClockStatus& clock) ABBE_RT;
  void count_gaps(std::uint64_t gaps) ABBE_RT;

  [[nodiscard]] DeviceStatus status(std::uint64_t dropped) const;
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }
  /// Of a TCP server or a datagram socket, once wait() has opened it; else 0.
  [[nodiscard]] std::uint16_t local_port() const noexcept { return link_.local_port(); }

 private:
  void open();
  void await_bytes(std::chrono::nanoseconds at_most);
  [[nodiscard]] bool take_ready(std::chrono::nanoseconds wall);
  void established();
  void read();
  void discard_reads() ABBE_RT { next_read_ = read_count_ = taken_ = filled_ = 0; }
  void lose(const std::string& why);
  void close();
  void overdue();
  void open_later(std::chrono::nanoseconds pause);
  void look_at_lines(const LineCounters& counters);
  void report_unreadable(const LineReception& found);
  void report_times(const BurstTimeCounters& counters);
  void report_skew(double skew);
  void report_rate(std::chrono::nanoseconds other);
  void report_condition(const LineReception& found);
  void report_turned_away();
  void fault(const std::string& what);
  void fault_once(const std::string& what);

  LineSessionOptions options_;
  LineTexts texts_;
  std::string name_;  ///< in messages: "tracker 10.0.0.7:7001"
  const TimeSource& time_;
  LineLink link_;
  StatusBoard board_;
  RawRing raw_;

  protocol::HostTime due_{};   ///< when to open, or when silence is a fault
  bool waits_to_open_ = true;  ///< `due_` is when to open
  std::string reported_;       ///< by fault_once() since the last line
  std::string_view condition_;
  bool clock_reported_ = false;
  bool rate_reported_ = false;
  std::uint64_t lines_seen_ = 0;
  std::uint64_t points_seen_ = 0;
  std::uint64_t unreadable_reported_ = 0;
  protocol::HostTime unreadable_report_at_{};
  std::uint64_t turned_away_seen_ = 0;
  std::uint64_t times_refused_seen_ = 0;
  std::uint64_t time_jumps_seen_ = 0;
  std::uint64_t gaps_seen_ = 0;

  bool began_ = false;  ///< there is a new connection for which the receiver is not yet reset
  protocol::HostTime arrival_{};
  /// The reads of one cycle, one after the other in buffer_: one of a stream, or the datagrams that
  /// waited.
  static constexpr std::size_t kMostReads = 64;
  static constexpr std::size_t kMostRead = 65536;
  std::array<std::size_t, kMostReads> read_sizes_{};
  std::size_t read_count_ = 0;
  std::size_t filled_ = 0;     ///< bytes of all of them
  std::size_t next_read_ = 0;  ///< for next_read()
  std::size_t taken_ = 0;      ///< bytes that next_read() has returned
  std::array<std::byte, 2 * kMostRead> buffer_{};
};

}  // namespace abbe::drivers
