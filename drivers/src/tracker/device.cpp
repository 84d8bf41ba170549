#include "abbe/drivers/tracker/device.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace abbe::drivers {

TrackerReceiverOptions receiver_options(const TrackerDeviceOptions& options) {
  TrackerReceiverOptions receiver;
  receiver.clock = options.clock;
  const bool periodic = options.session.mode == TrackerMode::ContinuousTime;
  receiver.time_separation = std::chrono::milliseconds{periodic ? options.session.time_separation_ms : 0};
  receiver.stationary_time = std::chrono::milliseconds{options.session.stationary_time_ms};
  return receiver;
}

Result<std::unique_ptr<TrackerDevice>> TrackerDevice::create(const TrackerDeviceOptions& options,
                                                             const TimeSource& time) {
  TrackerDeviceOptions named = options;
  named.session.peer = fmt::format("{} {}:{}", options.name, options.host, options.port);
  if (const auto fine = check(named.session); !fine) return tl::unexpected{fine.error()};
  if (options.host.empty() || options.port == 0) {
    return tl::unexpected{
        Error{ErrorCode::BadConfiguration, named.session.peer + ": host or port is missing"}};
  }
  return std::unique_ptr<TrackerDevice>{new TrackerDevice{named, time}};
}

TrackerDevice::TrackerDevice(const TrackerDeviceOptions& options, const TimeSource& time)
    : options_(options),
      time_(time),
      points_(options.point_capacity),
      environment_(options.environment_capacity),
      raw_(options.raw_capacity_blocks),
      receiver_(receiver_options(options)),
      session_(options.session) {
  show();
}

TrackerDevice::~TrackerDevice() {
  try {
    tell(TrackerStopRequested{});
    tcp_.finish();
  } catch (
      ...) {  // NOLINT(bugprone-empty-catch): out of memory; the closed connection stops the controller too
  }
}

void TrackerDevice::wait(std::chrono::nanoseconds at_most) {
  read_mail();
  tell(TrackerTick{});
  poll(at_most);
  show();
}

DeviceStatus TrackerDevice::status() const {
  return board_.read(options_.name, points_.dropped(), raw_.dropped());
}

/// What receive() understood, in order; the rest of it is void once the connection is closed.
void TrackerDevice::read_mail() {
  for (std::size_t i = 0; i < inbox_count_; ++i) {
    board_.set_connected(tcp_.established());
    std::visit([this](const auto& m) { tell(m); }, inbox_[i]);
  }
  inbox_count_ = 0;
  if (std::exchange(inbox_lost_, 0) != 0) {
    board_.fault(time_.now(), options_.session.peer + ": more messages in one read than there is room for");
  }
}

/// An action may fail at once, which is the next input.
void TrackerDevice::tell(const TrackerInput& input) {
  TrackerInput next = input;
  while (act(session_.on(next, time_.now()), next)) {
  }
}

bool TrackerDevice::act(const TrackerAction& action, TrackerInput& next) {
  if (std::holds_alternative<TrackerOpen>(action)) return open(next);
  if (const auto* command = std::get_if<TrackerSend>(&action)) return send(command->request, next);
  if (std::holds_alternative<TrackerClose>(action)) close();
  return false;
}

bool TrackerDevice::open(TrackerInput& next) {
  const auto opened = tcp_.open(options_.host, options_.port);
  if (!opened) next = TrackerConnectionLost{opened.error().text};
  return !opened;
}

bool TrackerDevice::send(const emscon::Request& request, TrackerInput& next) {
  std::array<std::byte, emscon::kMaxRequestSize> bytes{};
  const auto packet = std::span<const std::byte>{bytes}.first(emscon::encode(request, bytes));
  raw_.push_bytes(time_.now(), protocol::RawBlock::Direction::ToDevice, packet);
  const auto sent = tcp_.write(packet);
  if (sent) return false;
  close();
  next = TrackerConnectionLost{sent.error().text};
  return true;
}

void TrackerDevice::close() {
  tcp_.close();
  inbox_count_ = 0;
  filled_ = 0;
  began_ = false;
  board_.set_connected(false);
}

void TrackerDevice::poll(std::chrono::nanoseconds at_most) {
  const auto until_due = session_.deadline() - time_.now();
  const auto ready = tcp_.wait(time_.wall(std::clamp(until_due, std::chrono::nanoseconds{0}, at_most)));
  if (!ready) {
    close();
    tell(TrackerConnectionLost{ready.error().text});
  } else if (*ready == TcpClient::Ready::Established) {
    began_ = true;
    arrival_ = time_.now();
    tell(TrackerConnected{});
  } else if (*ready == TcpClient::Ready::Readable) {
    read();
  }
}

void TrackerDevice::read() {
  const auto count = tcp_.read(buffer_);
  arrival_ = time_.now();
  if (count) {
    filled_ = *count;
    return;
  }
  close();
  tell(TrackerConnectionLost{count.error().text});
}

void TrackerDevice::show() {
  board_.set_state(name_of(session_.state()));
  if (faults_seen_ == session_.fault().count) return;
  faults_seen_ = session_.fault().count;
  board_.fault(time_.now(), session_.fault().text);
}

}  // namespace abbe::drivers
