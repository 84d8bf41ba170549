#include "abbe/drivers/usb/usbip_link.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "abbe/protocol/usb/descriptors.hpp"
#include "abbe/protocol/visit.hpp"

namespace abbe::drivers {
namespace {

using usbip::UrbStatus;

constexpr std::size_t kBuffer = std::size_t{512} * 1024;  // holds several transfers of maximum size

UsbOutcome outcome_of(UrbStatus status) {
  if (status == UrbStatus::Ok) return UsbOutcome::Done;
  return status == UrbStatus::Stalled ? UsbOutcome::Stalled : UsbOutcome::Failed;
}

bool gone(UrbStatus status) {
  return status == UrbStatus::NoDevice || status == UrbStatus::Shutdown;
}

}  // namespace

UsbipLink::UsbipLink(const UsbipOptions& options, const TimeSource& time)
    : options_(options), time_(time), buffer_(kBuffer) {
  tcp_.look_up(options_.host, options_.port);
}

std::string UsbipLink::name() const {
  return fmt::format("USB/IP {}:{} {}", options_.host, options_.port, options_.bus_id);
}

void UsbipLink::open() {
  close();
  const auto opened = tcp_.open();
  if (!opened) return lose(opened.error().code, opened.error().text);
  state_ = State::Connecting;
}

void UsbipLink::close() noexcept {
  disconnect();
  pending_events_.clear();
}

/// Closes the connection. The buffer is not changed before the next wait(), so the bytes of
/// delivered events stay valid.
void UsbipLink::disconnect() noexcept {
  tcp_.close();
  state_ = State::Closed;
  pending_.clear();
  streaming_ = stopping_ = false;
  resubmit_ = 0;
  begin_ = end_ = 0;
}

void UsbipLink::lose(ErrorCode code, const std::string& seen) {
  disconnect();
  pending_events_.emplace_back(UsbLost{Error{code, name() + ": " + seen}});
}

void UsbipLink::send(std::span<const std::byte> bytes) {
  if (const auto sent = tcp_.write(bytes); !sent) lose(sent.error().code, sent.error().text);
}

std::uint32_t UsbipLink::submit(const usbip::Submit& request, bool bulk) {
  usbip::Submit numbered = request;
  numbered.head.sequence = ++sequence_;
  numbered.head.device = device_id_;
  const auto header = usbip::encode(usbip::Urb{numbered});
  outgoing_.insert(outgoing_.end(), header.begin(), header.end());
  pending_.push_back({numbered.head.sequence, bulk, request.length, 0});
  return numbered.head.sequence;
}

void UsbipLink::submit_control(const usb::Setup& setup) {
  control_setup_ = setup;
  usbip::Submit request;
  request.head.direction = setup.device_to_host() ? usbip::Direction::In : usbip::Direction::Out;
  request.length = setup.length;
  request.setup = usb::encode(setup);
  outgoing_.clear();
  submit(request, false);
  send(outgoing_);
}

void UsbipLink::submit_bulk(std::size_t count) {
  usbip::Submit request;
  request.head.direction = usbip::Direction::In;
  request.head.endpoint = options_.identity.bulk_endpoint & 0x0Fu;
  request.length = static_cast<std::uint32_t>(stream_.transfer_bytes);
  outgoing_.clear();
  for (std::size_t i = 0; i < count; ++i) submit(request, true);
  send(outgoing_);
}

void UsbipLink::control(const usb::Setup& setup) {
  if (state_ == State::Open) submit_control(setup);
}

void UsbipLink::start_bulk_in(const UsbBulkStream& stream) {
  if (state_ != State::Open || streaming_) return;
  stream_ = stream;
  streaming_ = true;
  submit_bulk(stream.in_flight);
}

void UsbipLink::stop_bulk_in() {
  if (state_ != State::Open) return;
  streaming_ = false;
  stopping_ = true;
  resubmit_ = 0;
  outgoing_.clear();

  for (auto& pending : pending_) {
    if (!pending.bulk) continue;
    pending.unlink = ++sequence_;
    const usbip::Unlink unlink{.head = {.sequence = pending.unlink, .device = device_id_},
                               .victim = pending.sequence};
    const auto header = usbip::encode(usbip::Urb{unlink});
    outgoing_.insert(outgoing_.end(), header.begin(), header.end());
  }

  send(outgoing_);
  report_if_stopped();
}

void UsbipLink::report_if_stopped() {
  if (!stopping_ || std::ranges::any_of(pending_, &Pending::bulk)) return;
  stopping_ = false;
  pending_events_.emplace_back(UsbBulkStopped{});
}

std::span<const UsbEvent> UsbipLink::wait(std::chrono::nanoseconds wall) {
  events_.clear();
  make_room();
  if (const auto count = std::exchange(resubmit_, 0); count != 0 && streaming_) submit_bulk(count);
  const auto ready = tcp_.wait(pending_events_.empty() ? wall : std::chrono::nanoseconds{0});

  if (!ready) {
    lose(ready.error().code, ready.error().text);
  } else if (*ready == TcpClient::Ready::Established) {
    state_ = State::Importing;
    std::array<std::byte, usbip::kImportRequestSize> request{};
    (void)usbip::encode_import_request(usbip::BusId{options_.bus_id}, request);
    send(request);
  } else if (*ready == TcpClient::Ready::Readable) {
    read();
    parse();
  }

  events_.insert(events_.end(), pending_events_.begin(), pending_events_.end());
  pending_events_.clear();
  return events_;
}

/// Moves the incomplete message to the beginning of the buffer. The bytes of delivered events
/// become invalid.
void UsbipLink::make_room() {
  std::copy(buffer_.begin() + static_cast<std::ptrdiff_t>(begin_),
            buffer_.begin() + static_cast<std::ptrdiff_t>(end_), buffer_.begin());
  end_ -= std::exchange(begin_, 0);
}

void UsbipLink::read() {
  const auto count = tcp_.read(std::span{buffer_}.subspan(end_));
  arrival_ = time_.now();
  if (!count) return lose(count.error().code, count.error().text);
  end_ += *count;
}

void UsbipLink::parse() {
  while (state_ != State::Closed) {
    const bool more = state_ == State::Importing ? parse_import() : parse_urb();
    if (!more) return;
  }
}

bool UsbipLink::parse_import() {
  const auto reply = usbip::decode_import_reply(unread());
  if (!reply && reply.error() == usbip::OpError::Truncated) return false;
  if (!reply) {
    lose(ErrorCode::Protocol, fmt::format("import: {}", usbip::to_text(reply.error())));
    return false;
  }

  if (reply->status != usbip::OpStatus::Ok) {
    lose(ErrorCode::DeviceRefused,
         fmt::format("import: refused with status {}", static_cast<std::uint32_t>(reply->status)));
    return false;
  }

  begin_ += usbip::kImportReplySize;
  const auto wrong = wrong_ids(options_.identity, reply->device.vendor, reply->device.product);
  if (!wrong.empty()) {
    lose(ErrorCode::Protocol, wrong);
    return false;
  }

  device_id_ = usbip::device_id(reply->device);
  state_ = State::Inspecting;
  inspection_ = Inspection::Device;
  submit_control(usb::get_descriptor(usb::DescriptorType::Device, 0, usb::kDeviceDescriptorSize));

  return true;
}

bool UsbipLink::parse_urb() {
  const auto bytes = unread();
  if (bytes.size() < usbip::kUrbHeaderSize) return false;
  const auto urb = usbip::decode_urb(bytes.first<usbip::kUrbHeaderSize>());
  if (!urb) {
    lose(ErrorCode::Protocol, usbip::to_text(urb.error()));
    return false;
  }
  if (const auto* reply = std::get_if<usbip::SubmitReply>(&*urb)) return take(*reply);
  if (const auto* reply = std::get_if<usbip::UnlinkReply>(&*urb)) return take(*reply);
  lose(ErrorCode::Protocol, "the server sent a request");
  return false;
}

bool UsbipLink::take(const usbip::SubmitReply& reply) {
  const auto found = std::ranges::find(pending_, reply.head.sequence, &Pending::sequence);
  if (found == pending_.end()) {
    lose(ErrorCode::Protocol,
         fmt::format("answer to request {}, which was not sent", reply.head.sequence));
    return false;
  }

  const Pending pending = *found;
  if (reply.length > pending.length) {
    lose(ErrorCode::Protocol,
         fmt::format("{} bytes received, {} requested", reply.length, pending.length));
    return false;
  }

  const bool data = pending.bulk || control_setup_.device_to_host();
  const std::size_t body = data ? reply.length : 0;
  if (unread().size() < usbip::kUrbHeaderSize + body) return false;
  const auto bytes = unread().subspan(usbip::kUrbHeaderSize, body);
  begin_ += usbip::kUrbHeaderSize + body;
  pending_.erase(found);
  finish(pending, reply.status, bytes);

  return true;
}

/// The reply to a cancellation. If the request was answered before its cancellation, it is no
/// longer in pending_.
bool UsbipLink::take(const usbip::UnlinkReply& reply) {
  begin_ += usbip::kUrbHeaderSize;
  std::erase_if(pending_,
                [&](const Pending& p) { return p.bulk && p.unlink == reply.head.sequence; });
  report_if_stopped();
  return true;
}

void UsbipLink::finish(const Pending& pending, UrbStatus status, std::span<const std::byte> bytes) {
  if (gone(status)) return lose(ErrorCode::Unreachable, "the device is gone");
  if (pending.bulk) {
    finish_bulk(outcome_of(status), bytes);
  } else {
    finish_control(outcome_of(status), bytes);
  }
}

void UsbipLink::finish_bulk(UsbOutcome outcome, std::span<const std::byte> bytes) {
  if (stopping_) return report_if_stopped();
  if (outcome == UsbOutcome::Done) ++resubmit_;
  pending_events_.emplace_back(UsbBulkIn{bytes, arrival_, outcome});
}

void UsbipLink::finish_control(UsbOutcome outcome, std::span<const std::byte> bytes) {
  if (state_ == State::Inspecting) {
    if (outcome == UsbOutcome::Done) return inspect(bytes);
    return lose(ErrorCode::DeviceRefused, "it does not answer a standard request");
  }
  UsbControlDone done{.setup = control_setup_, .outcome = outcome};
  done.length = std::min(bytes.size(), done.data.size());
  std::copy_n(bytes.begin(), done.length, done.data.begin());
  pending_events_.emplace_back(done);
}

void UsbipLink::inspect(std::span<const std::byte> bytes) {
  switch (inspection_) {
    case Inspection::Device:
      return inspected_device(bytes);
    case Inspection::Configuration:
      if (!usb::find_endpoint(bytes, options_.identity.bulk_endpoint)) {
        return lose(ErrorCode::Protocol,
                    fmt::format("it has no endpoint {:02X}", options_.identity.bulk_endpoint));
      }
      break;
    case Inspection::Serial: {
      const auto text = usb::decode_string(bytes);
      serial_ = text ? text->view() : std::string_view{};
      const auto wrong = wrong_serial(options_.identity, serial_);
      if (!wrong.empty()) return lose(ErrorCode::Protocol, wrong);
      break;
    }
    case Inspection::Select:
      state_ = State::Open;
      pending_events_.emplace_back(UsbOpened{serial_});
      return;
  }

  inspection_ = static_cast<Inspection>(static_cast<unsigned>(inspection_) + 1);
  request_next();
}

void UsbipLink::inspected_device(std::span<const std::byte> bytes) {
  const auto device = usb::decode_device_descriptor(bytes);
  if (!device) return lose(ErrorCode::Protocol, "its device descriptor cannot be read");
  const auto wrong = wrong_ids(options_.identity, device->vendor, device->product);
  if (!wrong.empty()) return lose(ErrorCode::Protocol, wrong);
  serial_string_ = device->serial_string;
  serial_.clear();
  inspection_ = Inspection::Configuration;
  request_next();
}

void UsbipLink::request_next() {
  if (inspection_ == Inspection::Serial && serial_string_ == 0) {
    const auto wrong = wrong_serial(options_.identity, "");
    if (!wrong.empty()) return lose(ErrorCode::Protocol, wrong);
    inspection_ = Inspection::Select;
  }

  switch (inspection_) {
    case Inspection::Device:
      break;  // requested in parse_import()
    case Inspection::Configuration:
      return submit_control(
          usb::get_descriptor(usb::DescriptorType::Configuration, 0, usb::kMaxDescriptor));
    case Inspection::Serial:
      return submit_control(
          usb::get_descriptor(usb::DescriptorType::String, serial_string_, usb::kMaxDescriptor));
    case Inspection::Select:
      return submit_control(usb::set_configuration(options_.identity.configuration));
  }
}

}  // namespace abbe::drivers
