#pragma once
/// Replays all devices of a recording, each on its own wire: emScon, CAN over UDP or SocketCAN,
/// USB/IP, Modbus TCP and RTU, I++ DME, lines of text. Steppable: poll(now) never blocks and reads
/// no clock. Not thread-safe.

#include <poll.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "abbe/sim/can_port.hpp"
#include "abbe/sim/line_tracker_server.hpp"
#include "abbe/sim/recorded_traffic.hpp"

namespace abbe::sim {

struct ReplaySetup {
  std::uint16_t tracker_port = 0;  ///< port on 127.0.0.1; 0: the kernel chooses
  CanPortOptions bus;
  std::map<std::string, std::uint16_t> ports;  ///< TCP, by the name of the device
  /// path of the link to a pseudo terminal, by the name of the device
  std::map<std::string, std::string> links;
  std::map<std::string, std::string> serials;  ///< of counter cards, by the name of the device
  /// How the lines of a device leave, by its name; default: it listens.
  std::map<std::string, LineOutput> lines;
  std::string axes;  ///< the device whose lines are positions of axes; tracker_port is not its port
};

/// The place at which a device is served.
struct ReplayedPlace {
  std::string name;
  RecordedKind kind{};
  std::string what;        ///< the amount of data, for messages: "12 packets"
  std::uint16_t port = 0;  ///< 0: on `path`
  std::string path;        ///< path of a pseudo terminal, or name of a CAN interface
};

/// One device of a replay.
class ReplayedDevice {
 public:
  virtual ~ReplayedDevice() = default;
  virtual void poll(HostTime now) = 0;
  [[nodiscard]] virtual HostTime next_due() const = 0;
  virtual void add_poll_fds(std::vector<pollfd>& fds) const = 0;
  /// True if the whole recording has been sent.
  [[nodiscard]] virtual bool finished() const = 0;
  [[nodiscard]] virtual ReplayedPlace place() const = 0;
};

class Replay {
 public:
  /// Opens the replay. Io if a port is in use.
  [[nodiscard]] static Result<std::unique_ptr<Replay>> open(
      const std::vector<RecordedDevice>& devices, const ReplaySetup& setup, HostTime now);

  void poll(HostTime now);
  [[nodiscard]] HostTime next_due() const;
  void add_poll_fds(std::vector<pollfd>& fds) const;
  [[nodiscard]] bool finished() const;
  [[nodiscard]] std::vector<ReplayedPlace> places() const;

 private:
  Replay() = default;
  ReplayTimeline timeline_;
  std::vector<std::unique_ptr<ReplayedDevice>> devices_;
};

}  // namespace abbe::sim
