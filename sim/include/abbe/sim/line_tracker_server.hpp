#pragma once
/// The program that prints the lines of a simulated or a recorded device, on its transport.
/// Steppable: poll(now) never blocks and reads no clock. Not thread-safe.

#include <poll.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "abbe/sim/error.hpp"
#include "abbe/sim/line_axes.hpp"
#include "abbe/sim/line_tracker.hpp"
#include "abbe/sim/pseudo_terminal.hpp"
#include "abbe/sim/recorded_lines.hpp"
#include "abbe/sim/sim_clock.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {

/// How the lines leave; the names are those of abbe's configuration, seen from abbe.
enum class LineTransport {
  Tcp,        ///< listens on a port of 127.0.0.1
  TcpServer,  ///< connects to a port of 127.0.0.1
  Udp,        ///< sends datagrams to a port of 127.0.0.1
  Serial,     ///< a pseudo terminal; whether it is read cannot be seen
};

struct LineOutput {
  LineTransport transport = LineTransport::Tcp;
  std::uint16_t port = 0;  ///< Tcp: 0: the kernel chooses it
  std::string link;        ///< Serial: path of the symbolic link to the receiver's end
};

/// `Source`: LineTracker, LineAxes or RecordedLines.
template <class Source>
class LineServer {
 public:
  /// Error Io: a port is in use, the pseudo terminal cannot be created.
  [[nodiscard]] static Result<LineServer> open(const LineOutput& output,
                                               std::unique_ptr<Source> tracker, HostTime now);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  /// Of the listener; else the port of the receiver. 0: a pseudo terminal.
  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// "TCP 127.0.0.1:7001", ...
  [[nodiscard]] std::string where() const;
  /// Adds to `fds` the sockets that the caller must wait for, until next_due() at the latest.
  void add_poll_fds(std::vector<pollfd>& fds) const;
  [[nodiscard]] Source& device() { return *tracker_; }
  [[nodiscard]] const Source& device() const { return *tracker_; }

 private:
  LineServer(LineOutput output, std::unique_ptr<Source> tracker)
      : output_(std::move(output)), tracker_(std::move(tracker)) {}

  void find_receiver(HostTime now);
  void connect(HostTime now, int type);
  void lose(HostTime now);
  void send(HostTime now);

  LineOutput output_;
  std::unique_ptr<Source> tracker_;
  std::uint16_t port_ = 0;
  Socket listener_;
  Socket receiver_;
  PseudoTerminal terminal_;
  HostTime connect_at_ = HostTime::min();
  std::vector<std::byte> unsent_;
};

using LineTrackerServer = LineServer<LineTracker>;
using LineAxesServer = LineServer<LineAxes>;

}  // namespace abbe::sim
