#include "abbe/sim/usbip_server.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <utility>

#include "abbe/result/try.hpp"

namespace abbe::sim {
namespace {

constexpr std::size_t kMostIncoming = 1 << 20;
constexpr std::uint32_t kBus = 1;
constexpr std::uint32_t kDevice = 2;
constexpr std::string_view kBusId = "1-1";
constexpr std::uint32_t kLargestRequest = 1 << 20;

std::size_t wanted_bytes(const auto& requests) {
  std::size_t sum = 0;
  for (const auto& request : requests) sum += request.length;
  return sum;
}

}  // namespace

Result<UsbipServer> UsbipServer::open(std::uint16_t port, const CounterCardOptions& card) {
  auto listener = listen_tcp(port);
  ABBE_TRY(listener);
  auto simulated = std::make_unique<CounterCard>(card);
  CounterCard* const simulated_card = simulated.get();
  UsbipServer server(std::move(*listener), std::move(simulated));
  server.simulated_ = simulated_card;
  return server;
}

Result<UsbipServer> UsbipServer::open(std::uint16_t port, std::unique_ptr<ExportedCard> card) {
  auto listener = listen_tcp(port);
  ABBE_TRY(listener);
  return UsbipServer(std::move(*listener), std::move(card));
}

UsbipServer::UsbipServer(Socket listener, std::unique_ptr<ExportedCard> card)
    : listener_(std::move(listener)), port_(port_of(listener_)), card_(std::move(card)) {}

void UsbipServer::poll(HostTime now) {
  end_faults(now);
  accept_clients();
  read(now);
  fill_requests(now);
  write();
  if (closing_ && unsent_.empty()) disconnect();
  if (client_ && card_->breaks_at() <= now) disconnect();
}

HostTime UsbipServer::next_due() const {
  HostTime due = std::min(fault_ends_.value_or(HostTime::max()), card_->breaks_at());
  if (!mute_ && !unresponsive_ && !requests_.empty())
    due = std::min(due, card_->available_at(requests_.front().length));
  return due;
}

void UsbipServer::accept_clients() {
  for (;;) {
    Socket accepted(::accept4(listener_.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    if (!accepted) return;
    if (!plugged_ || client_) continue;  // the new connection is closed at once
    const int on = 1;
    setsockopt(accepted.get(), IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    client_ = std::move(accepted);
  }
}

void UsbipServer::read(HostTime now) {
  std::array<std::byte, 16384> buffer;  // NOLINT: filled by recv
  while (client_) {
    const ssize_t size = ::recv(client_.get(), buffer.data(), buffer.size(), MSG_DONTWAIT);
    if (size > 0) {
      incoming_.insert(incoming_.end(), buffer.begin(), buffer.begin() + size);
      if (incoming_.size() > kMostIncoming) return disconnect();
      if (!unresponsive_) process_incoming(now);
    } else if (size < 0 && (errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR)) {
      return;
    } else {
      disconnect();
    }
  }

  accept_clients();  // a client may have been waiting since the previous one disconnected
}

void UsbipServer::process_incoming(HostTime now) {
  while (client_ && !closing_) {
    if (!(imported_ ? on_urb(now) : on_operation())) return;
  }
}

usbip::ExportedDevice UsbipServer::exported() const {
  usbip::ExportedDevice device;
  device.path = usbip::FixedText<256>{"/sys/devices/abbe-sim/usb1/1-1"};
  device.bus_id = usbip::BusId{kBusId};
  device.bus = kBus;
  device.number = kDevice;
  device.vendor = card_->ids().vendor;
  device.product = card_->ids().product;
  device.version = 0x0100;
  device.device_class = 0xFF;
  return device;
}

/// Processes one operation before the device is imported; false: more bytes are needed, or the
/// connection ends.
bool UsbipServer::on_operation() {
  const auto head = usbip::decode_op_head(incoming_);
  if (!head && head.error() == usbip::OpError::Truncated) return false;
  std::array<std::byte, 512> out{};

  if (head && head->code == usbip::OpCode::DeviceListRequest) {
    usbip::DeviceListWriter list{out, 1};
    list.add(exported(), std::array{usbip::ExportedInterface{.interface_class = 0xFF}});
    send_bytes(list.written());
    closing_ = true;
    return false;
  }

  const auto bus_id = usbip::decode_import_request(incoming_);
  if (!bus_id && bus_id.error() == usbip::OpError::Truncated) return false;
  if (!bus_id) {
    disconnect();
    return false;
  }

  incoming_.erase(incoming_.begin(), incoming_.begin() + usbip::kImportRequestSize);
  imported_ = bus_id->view() == kBusId;
  const auto device = exported();
  const auto size =
      usbip::encode_import_reply(imported_ ? usbip::OpStatus::Ok : usbip::OpStatus::NoDevice,
                                 imported_ ? &device : nullptr, out);
  send_bytes(std::span{out}.first(size));
  closing_ = !imported_;

  return imported_;
}

bool UsbipServer::on_urb(HostTime now) {
  if (incoming_.size() < usbip::kUrbHeaderSize) return false;
  const auto urb = usbip::decode_urb(std::span{incoming_}.first<usbip::kUrbHeaderSize>());
  const auto* submit = urb ? std::get_if<usbip::Submit>(&*urb) : nullptr;
  const auto* unlink = urb ? std::get_if<usbip::Unlink>(&*urb) : nullptr;

  if ((submit == nullptr && unlink == nullptr) ||
      (submit != nullptr && submit->length > kLargestRequest)) {
    disconnect();
    return false;
  }

  const bool data = submit != nullptr && submit->head.direction == usbip::Direction::Out;
  const std::size_t size = usbip::kUrbHeaderSize + (data ? submit->length : 0);
  if (incoming_.size() < size) return false;
  incoming_.erase(incoming_.begin(), incoming_.begin() + static_cast<std::ptrdiff_t>(size));
  if (submit != nullptr) on_submit(*submit, now);
  if (unlink != nullptr) on_unlink(*unlink);

  return true;
}

void UsbipServer::on_submit(const usbip::Submit& submit, HostTime now) {
  if (submit.head.endpoint == (quad08::kScanEndpoint & 0x0Fu) &&
      submit.head.direction == usbip::Direction::In) {
    requests_.push_back({submit.head.sequence, submit.length});
    return;
  }

  if (submit.head.endpoint != 0)
    return reply(submit.head.sequence, usbip::UrbStatus::Stalled, 0, {});
  fill_requests(now);  // earlier scans are sent before the answer to this request
  const auto answer = card_->answer(usb::decode_setup(submit.setup), now);
  if (answer.outcome == ControlAnswer::Outcome::Silent) return;
  if (answer.outcome == ControlAnswer::Outcome::Stalled)
    return reply(submit.head.sequence, usbip::UrbStatus::Stalled, 0, {});
  const auto& data = answer.data;
  reply(submit.head.sequence, usbip::UrbStatus::Ok, static_cast<std::uint32_t>(data.size()), data);
}

void UsbipServer::on_unlink(const usbip::Unlink& unlink) {
  const auto removed =
      std::erase_if(requests_, [&](const Request& r) { return r.sequence == unlink.victim; });
  const usbip::UnlinkReply answer{
      .head = {.sequence = unlink.head.sequence},
      .status = removed != 0 ? usbip::UrbStatus::Unlinked : usbip::UrbStatus::Ok};
  send_bytes(usbip::encode(usbip::Urb{answer}));
}

/// Answers waiting requests for scan data with as many bytes as they asked for. Only the rest of a
/// scan that has ended is sent as a shorter answer.
void UsbipServer::fill_requests(HostTime now) {
  if (unresponsive_) return;
  card_->advance(now, wanted_bytes(requests_));
  if (mute_) return;
  while (!requests_.empty() && card_->available() != 0) {
    const Request request = requests_.front();
    if (card_->available() < request.length && card_->scanning()) return;
    requests_.pop_front();
    const auto bytes = card_->take(request.length);
    reply(request.sequence, usbip::UrbStatus::Ok, static_cast<std::uint32_t>(bytes.size()), bytes);
  }
}

void UsbipServer::reply(std::uint32_t sequence, usbip::UrbStatus status, std::uint32_t length,
                        std::span<const std::byte> data) {
  const usbip::SubmitReply answer{
      .head = {.sequence = sequence}, .status = status, .length = length};
  send_bytes(usbip::encode(usbip::Urb{answer}));
  send_bytes(data);
}

void UsbipServer::send_bytes(std::span<const std::byte> bytes) {
  if (client_) unsent_.insert(unsent_.end(), bytes.begin(), bytes.end());
}

void UsbipServer::send_part(std::size_t bytes) {
  const std::size_t part = std::min(bytes, unsent_.size());
  if (client_) (void)::send(client_.get(), unsent_.data(), part, MSG_DONTWAIT | MSG_NOSIGNAL);
  unsent_.erase(unsent_.begin(), unsent_.begin() + static_cast<std::ptrdiff_t>(part));
}

void UsbipServer::write() {
  if (!client_ || hold_output_) return;
  send_what_fits(client_, unsent_);
}

void UsbipServer::disconnect() {
  client_.close();
  imported_ = closing_ = false;
  incoming_.clear();
  unsent_.clear();
  requests_.clear();
  card_->host_disconnected();
}

void UsbipServer::plug_out() {
  plugged_ = false;
  disconnect();
  simulated_->restart();  // the card is powered by the bus
}

void UsbipServer::end_faults(HostTime now) {
  if (!fault_ends_ || now < *fault_ends_) return;
  fault_ends_.reset();
  plugged_ = true;
  mute_ = unresponsive_ = hold_output_ = false;
  process_incoming(now);
}

void UsbipServer::inject(const Fault& fault, HostTime now) {
  if (simulated_ == nullptr) return;
  const HostTime until = now + seconds_to_ns(fault.duration_s);
  switch (fault.kind) {
    case FaultKind::Mute:
      unresponsive_ = true;
      fault_ends_ = until;
      break;
    case FaultKind::Stall:
      hold_output_ = true;
      fault_ends_ = until;
      break;
    case FaultKind::Unplug:
      plug_out();
      fault_ends_ = until;
      break;
    case FaultKind::CardRestart:
      disconnect();
      simulated_->restart();
      break;
    case FaultKind::Overrun:
      simulated_->overrun();
      break;
    case FaultKind::LostScans:
      simulated_->lose_scans(static_cast<std::size_t>(std::max(1.0, fault.value)));
      break;
    case FaultKind::FailRequest:
      simulated_->fail_controls(static_cast<std::size_t>(std::max(1.0, fault.value)));
      break;
    case FaultKind::Disconnect:  // the card keeps running
      disconnect();
      break;
    case FaultKind::ClockJump:
      simulated_->jump_clock(static_cast<std::int64_t>(fault.value));
      break;
    case FaultKind::UsbGarbage: {
      const std::vector<std::byte> garbage(usbip::kUrbHeaderSize, std::byte{0xA5});
      send_bytes(garbage);
      break;
    }
    default:
      break;  // this is not a fault of a counter card
  }

  write();
}

}  // namespace abbe::sim
