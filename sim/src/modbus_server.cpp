#include "abbe/sim/modbus_server.hpp"

#include <fmt/format.h>
#include <modbus/modbus.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <utility>

#include "abbe/result/try.hpp"
#include "abbe/sim/pseudo_terminal.hpp"
#include "abbe/sim/socket.hpp"

namespace abbe::sim {
namespace {

using std::chrono::nanoseconds;

constexpr std::size_t kMostClients = 2;
constexpr std::uint32_t kByteTimeout_us = 20'000;
constexpr std::uint8_t kBusy = 6;
constexpr std::uint8_t kGatewayTargetSilent = 11;
constexpr std::string_view kGarbage = "no answer of any Modbus device";

/// Frees a libmodbus context without closing its sockets: objects of Socket own them.
struct FreeContext {
  void operator()(modbus_t* context) const { modbus_free(context); }
};
using Context = std::unique_ptr<modbus_t, FreeContext>;
struct FreeMapping {
  void operator()(modbus_mapping_t* mapping) const { modbus_mapping_free(mapping); }
};
using Mapping = std::unique_ptr<modbus_mapping_t, FreeMapping>;

bool readable(int fd) {
  pollfd poll{fd, POLLIN, 0};
  return ::poll(&poll, 1, 0) > 0;
}

struct Query {
  HostTime due{};
  int fd = -1;
  std::vector<std::uint8_t> bytes;
};

}  // namespace

struct ModbusServer::State {
  ModbusServerOptions options;
  HostTime start{};
  std::uint16_t port_number = 0;
  Socket listener;
  std::vector<Socket> clients;
  PseudoTerminal terminal;
  Context context;
  std::vector<Query> waiting;
  std::vector<std::pair<Fault, HostTime>> faults;  ///< each with its end time

  [[nodiscard]] bool serial() const {
    return std::holds_alternative<ModbusPtyEndpoint>(options.endpoint);
  }
  [[nodiscard]] const std::string& link() const {
    return std::get<ModbusPtyEndpoint>(options.endpoint).link;
  }
  [[nodiscard]] const Fault* active(FaultKind kind) const {
    for (const auto& [fault, end] : faults) {
      if (fault.kind == kind) return &fault;
    }
    return nullptr;
  }

  Result<void> plug_in();
  void unplug();
  void end_faults(HostTime now);
  void accept_clients();
  void receive(HostTime now);
  [[nodiscard]] bool receive_from(int fd, HostTime now);
  void answer_due(HostTime now);
  void answer(const Query& query, HostTime now);
  [[nodiscard]] Mapping mapping_for(std::uint8_t unit, HostTime now) const;
  [[nodiscard]] std::vector<BrokenInput> broken_inputs() const;
};

Result<void> ModbusServer::State::plug_in() {
  if (serial()) {
    auto opened = PseudoTerminal::open(link());
    ABBE_TRY(opened);
    terminal = std::move(*opened);
    return {};
  }
  auto opened = listen_tcp(port_number);
  ABBE_TRY(opened);
  listener = std::move(*opened);
  port_number = port_of(listener);
  return {};
}

void ModbusServer::State::unplug() {
  listener.close();
  clients.clear();
  terminal.close();
  waiting.clear();
}

void ModbusServer::State::end_faults(HostTime now) {
  const bool was_out = active(FaultKind::Disconnect) != nullptr;
  std::erase_if(faults, [now](const auto& f) { return f.second <= now; });
  if (!was_out || active(FaultKind::Disconnect) != nullptr) return;
  if (!plug_in()) {
    // The port is in use: try again after a second.
    faults.push_back({{.kind = FaultKind::Disconnect}, now + std::chrono::seconds{1}});
  }
}

void ModbusServer::State::accept_clients() {
  while (listener) {
    Socket client{::accept4(listener.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC)};
    if (!client) return;
    if (clients.size() == kMostClients)
      clients.erase(clients.begin());  // the oldest connection may be dead
    clients.push_back(std::move(client));
  }
}

void ModbusServer::State::receive(HostTime now) {
  std::erase_if(clients, [&](const Socket& client) {
    const int fd = client.get();
    if (!readable(fd) || receive_from(fd, now)) return false;
    std::erase_if(waiting, [fd](const Query& q) { return q.fd == fd; });
    return true;
  });
  if (terminal.fd() >= 0 && readable(terminal.fd())) (void)receive_from(terminal.fd(), now);
}

/// Receives one request from a client and answers it. false: the client has disconnected, or its
/// bytes are not Modbus.
bool ModbusServer::State::receive_from(int fd, HostTime now) {
  std::array<std::uint8_t, MODBUS_MAX_ADU_LENGTH> bytes{};
  modbus_set_socket(context.get(), fd);
  const int length = modbus_receive(context.get(), bytes.data());
  if (length < 0) return false;
  if (length == 0 || active(FaultKind::Mute) != nullptr) return true;
  const Fault* late = active(FaultKind::Late);
  waiting.push_back({late != nullptr ? now + seconds_to_ns(late->value) : now,
                     fd,
                     {bytes.begin(), bytes.begin() + length}});
  return true;
}

void ModbusServer::State::answer_due(HostTime now) {
  for (const Query& query : waiting) {
    if (query.due <= now) answer(query, now);
  }
  std::erase_if(waiting, [now](const Query& q) { return q.due <= now; });
}

void ModbusServer::State::answer(const Query& query, HostTime now) {
  if (active(FaultKind::ModbusGarbage) != nullptr) {
    (void)!::write(query.fd, kGarbage.data(), kGarbage.size());
    return;
  }

  modbus_set_socket(context.get(), query.fd);
  const auto exception = [&](unsigned code) {
    modbus_reply_exception(context.get(), query.bytes.data(), code);
  };

  if (const Fault* fault = active(FaultKind::ModbusException))
    return exception(fault->value > 0.0 ? static_cast<unsigned>(fault->value) : kBusy);
  const auto header = static_cast<std::size_t>(modbus_get_header_length(context.get()));
  const auto mapping = mapping_for(query.bytes[header - 1], now);

  if (!mapping) {
    if (!serial()) exception(kGatewayTargetSilent);
    return;
  }

  modbus_reply(context.get(), query.bytes.data(), static_cast<int>(query.bytes.size()),
               mapping.get());
}

std::vector<BrokenInput> ModbusServer::State::broken_inputs() const {
  std::vector<BrokenInput> broken;
  for (const auto& [fault, end] : faults)
    broken.push_back({.kind = fault.kind,
                      .input = fault.input,
                      .value = fault.value,
                      .since = end - seconds_to_ns(fault.duration_s) - start});
  return broken;
}

Mapping ModbusServer::State::mapping_for(std::uint8_t unit, HostTime now) const {
  auto registers = registers_of(options.identity, options.environment, now - start,
                                active(FaultKind::SensorsGone) != nullptr, broken_inputs());
  std::erase_if(registers, [unit](const auto& r) { return r.unit != 0 && r.unit != unit; });
  if (registers.empty()) return nullptr;
  unsigned end = 0;

  for (auto& r : registers) {
    if (active(FaultKind::WrongMap) != nullptr) ++r.address;
    end = std::max(end, r.address + 1u);
  }

  Mapping mapping{modbus_mapping_new_start_address(0, 0, 0, 0, 0, end, 0, end)};
  for (const auto& r : registers) {
    auto* table =
        r.space == RegisterSpace::Holding ? mapping->tab_registers : mapping->tab_input_registers;
    table[r.address] = r.value;
  }

  return mapping;
}

Result<ModbusServer> ModbusServer::open(const ModbusServerOptions& options, HostTime now) {
  auto state = std::make_unique<State>();
  state->options = options;
  state->start = now;
  if (const auto* tcp = std::get_if<ModbusTcpEndpoint>(&options.endpoint))
    state->port_number = tcp->port;
  ABBE_TRY(state->plug_in());
  state->context.reset(state->serial() ? modbus_new_rtu(state->link().c_str(), 19200, 'E', 8, 1)
                                       : modbus_new_tcp("127.0.0.1", state->port_number));
  if (!state->context) return io_error(fmt::format("{}: {}", options.name, modbus_strerror(errno)));
  modbus_set_slave(state->context.get(), options.identity.unit);
  modbus_set_byte_timeout(state->context.get(), 0, kByteTimeout_us);
  return ModbusServer{std::move(state)};
}

ModbusServer::ModbusServer(std::unique_ptr<State> state) : state_(std::move(state)) {}
ModbusServer::ModbusServer(ModbusServer&&) noexcept = default;
ModbusServer& ModbusServer::operator=(ModbusServer&&) noexcept = default;
ModbusServer::~ModbusServer() {
  if (state_) state_->unplug();
}

void ModbusServer::poll(HostTime now) {
  state_->end_faults(now);
  state_->accept_clients();
  state_->receive(now);
  state_->answer_due(now);
}

HostTime ModbusServer::next_due() const {
  HostTime due = HostTime::max();
  for (const auto& query : state_->waiting) due = std::min(due, query.due);
  for (const auto& [fault, end] : state_->faults) due = std::min(due, end);
  return due;
}

void ModbusServer::add_poll_fds(std::vector<pollfd>& fds) const {
  if (state_->listener) fds.push_back({state_->listener.get(), POLLIN, 0});
  if (state_->terminal.fd() >= 0) fds.push_back({state_->terminal.fd(), POLLIN, 0});
  for (const auto& client : state_->clients) fds.push_back({client.get(), POLLIN, 0});
}

void ModbusServer::inject(const Fault& fault, HostTime now) {
  if (fault.kind == FaultKind::Disconnect) state_->unplug();
  state_->faults.push_back({fault, now + seconds_to_ns(fault.duration_s)});
}

const std::string& ModbusServer::name() const {
  return state_->options.name;
}
std::uint16_t ModbusServer::port() const {
  return state_->port_number;
}
std::string ModbusServer::path() const {
  return state_->serial() ? state_->link() : std::string{};
}
std::string ModbusServer::where() const {
  return state_->serial() ? fmt::format("Modbus RTU on {}", state_->link())
                          : fmt::format("Modbus TCP on 127.0.0.1:{}", state_->port_number);
}

}  // namespace abbe::sim
