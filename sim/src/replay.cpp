#include "abbe/sim/replay.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "abbe/result/try.hpp"
#include "abbe/sim/controller_server.hpp"
#include "abbe/sim/recorded_bus.hpp"
#include "abbe/sim/recorded_card.hpp"
#include "abbe/sim/recorded_dialogue.hpp"
#include "abbe/sim/recorded_tracker.hpp"
#include "abbe/sim/terminal_server.hpp"
#include "abbe/sim/usbip_server.hpp"

namespace abbe::sim {
namespace {

using Made = Result<std::unique_ptr<ReplayedDevice>>;

template <class T>
T chosen(const std::map<std::string, T>& by_name, const std::string& name, T otherwise) {
  const auto found = by_name.find(name);
  return found == by_name.end() ? otherwise : found->second;
}

std::string what_of(const RecordedTracker& tracker) {
  return fmt::format("{} packets", tracker.packets());
}
std::string what_of(const RecordedDialogue& dialogue) {
  return fmt::format("{} requests", dialogue.requests());
}

template <class Controller>
class ReplayedController final : public ReplayedDevice {
 public:
  using Server = ControllerServer<Controller>;
  ReplayedController(std::string name, RecordedKind kind, Server server)
      : name_(std::move(name)), kind_(kind), server_(std::move(server)) {}
  void poll(HostTime now) override { server_.poll(now); }
  [[nodiscard]] HostTime next_due() const override { return server_.next_due(); }
  void add_poll_fds(std::vector<pollfd>& fds) const override { server_.add_poll_fds(fds); }
  [[nodiscard]] bool finished() const override {
    return server_.device().finished() && !server_.wants_write();
  }
  [[nodiscard]] ReplayedPlace place() const override {
    return {name_, kind_, what_of(server_.device()), server_.port(), {}};
  }

 private:
  std::string name_;
  RecordedKind kind_;
  Server server_;
};

class ReplayedBus final : public ReplayedDevice {
 public:
  ReplayedBus(std::string name, std::string interface, RecordedBus bus)
      : name_(std::move(name)), interface_(std::move(interface)), bus_(std::move(bus)) {}
  void poll(HostTime now) override { bus_.poll(now); }
  [[nodiscard]] HostTime next_due() const override { return bus_.next_due(); }
  void add_poll_fds(std::vector<pollfd>& fds) const override {
    fds.push_back({bus_.fd(), POLLIN, 0});
  }
  [[nodiscard]] bool finished() const override { return bus_.finished(); }
  [[nodiscard]] ReplayedPlace place() const override {
    return {name_, RecordedKind::Encoders, fmt::format("{} cycles", bus_.syncs()),
            interface_.empty() ? bus_.port() : std::uint16_t{0}, interface_};
  }

 private:
  std::string name_;
  std::string interface_;
  RecordedBus bus_;
};

class ReplayedCard final : public ReplayedDevice {
 public:
  ReplayedCard(std::string name, UsbipServer server, const RecordedCard& card)
      : name_(std::move(name)), server_(std::move(server)), card_(card) {}
  void poll(HostTime now) override { server_.poll(now); }
  [[nodiscard]] HostTime next_due() const override { return server_.next_due(); }
  void add_poll_fds(std::vector<pollfd>& fds) const override { server_.add_poll_fds(fds); }
  [[nodiscard]] bool finished() const override {
    return card_.finished() && !server_.wants_write();
  }
  [[nodiscard]] ReplayedPlace place() const override {
    return {name_,
            RecordedKind::CounterCard,
            fmt::format("{} transfers", card_.transfers()),
            server_.port(),
            {}};
  }

 private:
  std::string name_;
  UsbipServer server_;
  const RecordedCard& card_;  ///< owned by the server
};

class ReplayedTerminal final : public ReplayedDevice {
 public:
  ReplayedTerminal(std::string name, TerminalServer server)
      : name_(std::move(name)), server_(std::move(server)) {}
  void poll(HostTime now) override { server_.poll(now); }
  [[nodiscard]] HostTime next_due() const override { return server_.next_due(); }
  void add_poll_fds(std::vector<pollfd>& fds) const override {
    add_client_fd(server_.fd(), server_.wants_write(), fds);
  }
  [[nodiscard]] bool finished() const override {
    return server_.device().finished() && !server_.wants_write();
  }
  [[nodiscard]] ReplayedPlace place() const override {
    return {name_, RecordedKind::ModbusRtu, what_of(server_.device()), 0, server_.link()};
  }

 private:
  std::string name_;
  TerminalServer server_;
};

class ReplayedLines final : public ReplayedDevice {
 public:
  ReplayedLines(std::string name, std::string link, LineServer<RecordedLines> server)
      : name_(std::move(name)), link_(std::move(link)), server_(std::move(server)) {}
  void poll(HostTime now) override { server_.poll(now); }
  [[nodiscard]] HostTime next_due() const override { return server_.next_due(); }
  void add_poll_fds(std::vector<pollfd>& fds) const override { server_.add_poll_fds(fds); }
  [[nodiscard]] bool finished() const override { return server_.device().finished(); }
  [[nodiscard]] ReplayedPlace place() const override {
    return {name_, RecordedKind::Lines,
            fmt::format("{} reads, {}", server_.device().reads(), server_.where()), server_.port(),
            link_};
  }

 private:
  std::string name_;
  std::string link_;
  LineServer<RecordedLines> server_;
};

class Maker {
 public:
  Maker(const ReplaySetup& setup, ReplayTimeline& timeline, bool has_tracker, HostTime now)
      : setup_(setup), timeline_(timeline), has_tracker_(has_tracker), now_(now) {}

  [[nodiscard]] Made make(const RecordedDevice& device) const {
    switch (device.kind) {
      case RecordedKind::Tracker:
        return tracker(device);
      case RecordedKind::Encoders:
        return bus(device);
      case RecordedKind::CounterCard:
        return card(device);
      case RecordedKind::ModbusRtu:
        return terminal(device);
      case RecordedKind::Lines:
        return lines(device);
      case RecordedKind::ModbusTcp:
      case RecordedKind::MeasuringMachine:
        break;
    }

    return dialogue(device);
  }

 private:
  template <class Controller>
  [[nodiscard]] Made controller(const RecordedDevice& device, std::uint16_t port,
                                std::unique_ptr<Controller> recorded) const {
    auto server = ControllerServer<Controller>::open(port, std::move(recorded));
    ABBE_TRY(server);
    return std::make_unique<ReplayedController<Controller>>(device.name, device.kind,
                                                            std::move(*server));
  }
  [[nodiscard]] Made tracker(const RecordedDevice& device) const {
    return controller(device, chosen(setup_.ports, device.name, setup_.tracker_port),
                      std::make_unique<RecordedTracker>(device, timeline_));
  }
  [[nodiscard]] Made dialogue(const RecordedDevice& device) const {
    return controller(device, chosen(setup_.ports, device.name, std::uint16_t{0}),
                      std::make_unique<RecordedDialogue>(device, dialogue_wire(device.kind)));
  }
  [[nodiscard]] Made bus(const RecordedDevice& device) const {
    CanPortOptions options = setup_.bus;
    options.port = chosen(setup_.ports, device.name, options.port);
    auto bus = RecordedBus::open(options, device, timeline_, !has_tracker_);
    ABBE_TRY(bus);
    return std::make_unique<ReplayedBus>(device.name, options.interface, std::move(*bus));
  }
  [[nodiscard]] Made card(const RecordedDevice& device) const {
    const auto serial = chosen(setup_.serials, device.name, CounterCardOptions{}.serial);
    auto card = std::make_unique<RecordedCard>(device, serial, timeline_, !has_tracker_);
    const RecordedCard& recorded = *card;
    auto server =
        UsbipServer::open(chosen(setup_.ports, device.name, std::uint16_t{0}), std::move(card));
    ABBE_TRY(server);
    return std::make_unique<ReplayedCard>(device.name, std::move(*server), recorded);
  }
  [[nodiscard]] std::string link_of(const RecordedDevice& device) const {
    const auto anywhere = std::filesystem::temp_directory_path() /
                          fmt::format("abbe-sim-{}-{}", ::getpid(), device.name);
    return chosen(setup_.links, device.name, anywhere.string());
  }
  /// If the lines went to a port of the daemon, the recorded port is used, because the daemon
  /// receives there again.
  [[nodiscard]] Made lines(const RecordedDevice& device) const {
    LineOutput output = chosen(setup_.lines, device.name, LineOutput{});
    const std::uint16_t port = device.name == setup_.axes ? std::uint16_t{0} : setup_.tracker_port;
    if (output.transport == LineTransport::Serial)
      output.link = link_of(device);
    else if (output.transport == LineTransport::Tcp)
      output.port = chosen(setup_.ports, device.name, port);
    else
      output.port = chosen(setup_.ports, device.name, port != 0 ? port : output.port);
    auto server = LineServer<RecordedLines>::open(
        output,
        std::make_unique<RecordedLines>(device, timeline_,
                                        !has_tracker_ || device.name != setup_.axes),
        now_);
    ABBE_TRY(server);
    return std::make_unique<ReplayedLines>(device.name, output.link, std::move(*server));
  }
  [[nodiscard]] Made terminal(const RecordedDevice& device) const {
    auto server = TerminalServer::open(
        link_of(device), std::make_unique<RecordedDialogue>(device, dialogue_wire(device.kind)),
        now_);
    ABBE_TRY(server);
    return std::make_unique<ReplayedTerminal>(device.name, std::move(*server));
  }

  const ReplaySetup& setup_;
  ReplayTimeline& timeline_;
  bool has_tracker_;
  HostTime now_;
};

}  // namespace

Result<std::unique_ptr<Replay>> Replay::open(const std::vector<RecordedDevice>& devices,
                                             const ReplaySetup& setup, HostTime now) {
  std::unique_ptr<Replay> replay(new Replay);
  const bool has_tracker = std::ranges::any_of(devices, [&](const auto& d) {
    return d.kind == RecordedKind::Tracker ||
           (d.kind == RecordedKind::Lines && d.name != setup.axes);
  });
  const Maker maker(setup, replay->timeline_, has_tracker, now);
  for (const RecordedDevice& device : devices) {
    auto made = maker.make(device);
    ABBE_TRY(made);
    replay->devices_.push_back(std::move(*made));
  }
  return replay;
}

void Replay::poll(HostTime now) {
  for (const auto& device : devices_) device->poll(now);
}

HostTime Replay::next_due() const {
  HostTime due = HostTime::max();
  for (const auto& device : devices_) due = std::min(due, device->next_due());
  return due;
}

void Replay::add_poll_fds(std::vector<pollfd>& fds) const {
  for (const auto& device : devices_) device->add_poll_fds(fds);
}

bool Replay::finished() const {
  return std::ranges::all_of(devices_, [](const auto& device) { return device->finished(); });
}

std::vector<ReplayedPlace> Replay::places() const {
  std::vector<ReplayedPlace> all;
  for (const auto& device : devices_) all.push_back(device->place());
  return all;
}

}  // namespace abbe::sim
