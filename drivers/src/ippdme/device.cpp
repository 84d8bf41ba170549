#include "abbe/drivers/ippdme/device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace abbe::drivers {

Result<std::unique_ptr<IppDevice>> IppDevice::create(const IppDeviceOptions& options,
                                                     const TimeSource& time) {
  IppDeviceOptions named = options;
  named.session.peer = fmt::format("{} {}:{}", options.name, options.host, options.port);
  if (const auto fine = check(named.session); !fine) return tl::unexpected{fine.error()};
  if (options.host.empty() || options.port == 0) {
    return tl::unexpected{
        Error{ErrorCode::BadConfiguration, named.session.peer + ": host or port is missing"}};
  }
  return std::unique_ptr<IppDevice>{new IppDevice{named, time}};
}

IppDevice::IppDevice(const IppDeviceOptions& options, const TimeSource& time)
    : options_(options),
      time_(time),
      touches_(options.touch_capacity),
      positions_(options.position_capacity),
      raw_(options.raw_capacity_blocks),
      receiver_(options.receiver),
      session_(options.session) {
  show();
}

IppDevice::~IppDevice() {
  try {
    tell(IppStopRequested{});
    tcp_.finish();
  } catch (...) {  // NOLINT(bugprone-empty-catch): out of memory; a server ends the session of a lost client
  }
}

void IppDevice::measure(const ProbePoint& point) {
  const std::lock_guard lock{requests_mutex_};
  requests_.push_back(point);
}

void IppDevice::wait(std::chrono::nanoseconds at_most) {
  read_mail();
  read_requests();
  tell(IppTick{});
  poll(at_most);
  show();
}

DeviceStatus IppDevice::status() const {
  return board_.read(options_.name, touches_.dropped() + positions_.dropped(), raw_.dropped());
}

/// What receive() understood, in order; the rest of it is void once the connection is closed.
void IppDevice::read_mail() {
  for (std::size_t i = 0; i < inbox_count_; ++i) {
    board_.set_connected(tcp_.established());
    std::visit([this](const auto& m) { tell(m); }, inbox_[i]);
  }
  inbox_count_ = 0;
  if (std::exchange(inbox_lost_, 0) != 0) {
    board_.fault(time_.now(), options_.session.peer + ": more lines in one read than there is room for");
  }
}

void IppDevice::read_requests() {
  std::vector<ProbePoint> requests;
  {
    const std::lock_guard lock{requests_mutex_};
    requests.swap(requests_);
  }
  for (const ProbePoint& point : requests) tell(point);
}

/// An action may fail at once, which is the next input.
void IppDevice::tell(const IppInput& input) {
  IppInput next = input;
  while (act(session_.on(next, time_.now()), next)) {
  }
}

bool IppDevice::act(const IppAction& action, IppInput& next) {
  if (std::holds_alternative<IppOpen>(action)) return open(next);
  if (const auto* command = std::get_if<IppSend>(&action)) return send(command->line, next);
  if (std::holds_alternative<IppClose>(action)) close();
  return false;
}

bool IppDevice::open(IppInput& next) {
  const auto opened = tcp_.open(options_.host, options_.port);
  if (!opened) next = IppConnectionLost{opened.error().text};
  return !opened;
}

bool IppDevice::send(const std::string& line, IppInput& next) {
  const auto bytes = std::as_bytes(std::span{line});
  raw_.push_bytes(time_.now(), protocol::RawBlock::Direction::ToDevice, bytes);
  receiver_.sent(bytes, time_.now());
  const auto sent = tcp_.write(bytes);
  if (sent) return false;
  close();
  next = IppConnectionLost{sent.error().text};
  return true;
}

void IppDevice::close() {
  tcp_.close();
  inbox_count_ = 0;
  filled_ = 0;
  board_.set_connected(false);
}

void IppDevice::poll(std::chrono::nanoseconds at_most) {
  const auto until_due = session_.deadline() - time_.now();
  const auto ready = tcp_.wait(time_.wall(std::clamp(until_due, std::chrono::nanoseconds{0}, at_most)));
  if (!ready) {
    close();
    tell(IppConnectionLost{ready.error().text});
  } else if (*ready == TcpClient::Ready::Established) {
    // The receiver must hear of the new connection before of the first command on it.
    arrival_ = time_.now();
    raw_.push_bytes(arrival_, protocol::RawBlock::Direction::FromDevice, {});
    receiver_.push({}, arrival_);
    tell(IppConnected{});
  } else if (*ready == TcpClient::Ready::Readable) {
    read();
  }
}

void IppDevice::read() {
  const auto count = tcp_.read(buffer_);
  arrival_ = time_.now();
  if (count) {
    filled_ = *count;
    return;
  }
  close();
  tell(IppConnectionLost{count.error().text});
}

void IppDevice::show() {
  board_.set_state(name_of(session_.state()));
  if (faults_seen_ == session_.fault().count) return;
  faults_seen_ = session_.fault().count;
  board_.fault(time_.now(), session_.fault().text);
}

}  // namespace abbe::drivers
