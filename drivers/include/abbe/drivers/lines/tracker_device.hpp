#pragma once
/// A tracker whose points come as lines of text, as a Device: LineReceiver behind a LineLink. abbe
/// sends nothing: what the tracker measures, and when, is decided by the program that prints the
/// lines. The arrival time is the user-space time at which the read returned.
///
/// States: "disconnected", "connecting", "waiting for the sender" (TCP server), "connected" (no
/// line yet), "streaming", "unreadable lines" (lines come, none can be read), "faulted" (no line
/// for silence_timeout). TCP connections are opened again after a silence; a datagram socket or a
/// serial line stays open.

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/lines/link.hpp"
#include "abbe/drivers/lines/receiver.hpp"
#include "abbe/drivers/raw_ring.hpp"
#include "abbe/drivers/sample_ring.hpp"
#include "abbe/drivers/status_board.hpp"
#include "abbe/drivers/time_source.hpp"

namespace abbe::drivers {

struct LineTrackerOptions {
  std::string name = "tracker";
  LineAddress address;
  /// datagrams and begins_anywhere are set from `address`.
  LineReceiverOptions receiver;
  std::chrono::nanoseconds connect_timeout = std::chrono::seconds{3};
  /// A longer time without a line is a fault.
  std::chrono::nanoseconds silence_timeout = std::chrono::milliseconds{1500};
  std::size_t point_capacity = 16384;  ///< 32 s at 500 points per second
  std::size_t raw_capacity_blocks = 4096;
};

/// Options of the receiver of this device; a replay needs the same ones.
[[nodiscard]] LineReceiverOptions receiver_options(const LineTrackerOptions& options);

class LineTrackerDevice final : public Device {
 public:
  /// `time` must outlive the device. Error BadConfiguration: the address or the format is not
  /// valid. The first wait() opens the connection.
  [[nodiscard]] static Result<std::unique_ptr<LineTrackerDevice>> create(
      const LineTrackerOptions& options, const TimeSource& time);

  void wait(std::chrono::nanoseconds at_most) override;
  void receive() ABBE_RT override;
  [[nodiscard]] DeviceStatus status() const override;

  /// One reader thread for each ring.
  [[nodiscard]] SampleRing<protocol::TrackerPoint>& points() noexcept { return points_; }
  [[nodiscard]] RawRing& raw() noexcept { return raw_; }
  /// Device thread. Of a TCP server or a datagram socket, once wait() has opened it; else 0.
  [[nodiscard]] std::uint16_t local_port() const noexcept { return link_.local_port(); }

 private:
  LineTrackerDevice(const LineTrackerOptions& options, const TimeSource& time);

  void open();
  void await_bytes(std::chrono::nanoseconds at_most);
  [[nodiscard]] bool take_ready(std::chrono::nanoseconds wall);
  void established();
  void read();
  void discard_reads() ABBE_RT { read_count_ = filled_ = 0; }
  void lose(const std::string& why);
  void close();
  void overdue();
  void open_later(std::chrono::nanoseconds pause);
  void look_at_lines();
  void report_unreadable();
  void report_times();
  void report_rate();
  void fault(const std::string& what);
  void fault_once(const std::string& what);

  LineTrackerOptions options_;
  std::string name_;  ///< in messages: "tracker 10.0.0.7:7001"
  const TimeSource& time_;
  LineLink link_;
  StatusBoard board_;
  SampleRing<protocol::TrackerPoint> points_;
  RawRing raw_;
  LineReceiver receiver_;

  protocol::HostTime due_{};   ///< when to open, or when silence is a fault
  bool waits_to_open_ = true;  ///< `due_` is when to open
  std::string reported_;       ///< by fault_once() since the last line
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
  std::size_t filled_ = 0;  ///< bytes of all of them
  std::array<std::byte, 2 * kMostRead> buffer_{};
};

}  // namespace abbe::drivers
