#include "abbe/protocol/usbip/urb.hpp"

#include <algorithm>

#include "abbe/protocol/bytes.hpp"
#include "abbe/protocol/visit.hpp"

namespace abbe::protocol::usbip {
namespace {

/// number_of_packets of a transfer that is not isochronous. usbip_protocol.rst requires FFFFFFFFh;
/// Linux itself sends 0 (vhci copies the field of the urb). A Linux server passes the value of a
/// request to its host controller unchanged, and some allocate memory for as many packets (dwc2).
/// So requests contain 0, replies FFFFFFFFh, and both are accepted in either direction.
constexpr std::uint32_t kNoPackets = 0;
constexpr std::uint32_t kNotIsochronous = 0xFFFFFFFF;

void put(ByteWriter& out, Command command, const UrbHead& head) ABBE_RT {
  out.big(command);
  out.big(head.sequence);
  out.big(head.device);
  out.big(head.direction);
  out.big(head.endpoint);
}

void put(ByteWriter& out, const Submit& urb) ABBE_RT {
  put(out, Command::Submit, urb.head);
  out.big(urb.flags);
  out.big(urb.length);
  out.big(urb.start_frame);
  out.big(kNoPackets);
  out.big(urb.interval);
  out.put(urb.setup);
}

void put(ByteWriter& out, const Unlink& urb) ABBE_RT {
  put(out, Command::Unlink, urb.head);
  out.big(urb.victim);
}

void put(ByteWriter& out, const SubmitReply& urb) ABBE_RT {
  put(out, Command::SubmitReply, urb.head);
  out.big(urb.status);
  out.big(urb.length);
  out.big(urb.start_frame);
  out.big(kNotIsochronous);
  out.big(urb.errors);
}

void put(ByteWriter& out, const UnlinkReply& urb) ABBE_RT {
  put(out, Command::UnlinkReply, urb.head);
  out.big(urb.status);
}

bool isochronous(std::uint32_t packets) ABBE_RT {
  return packets != kNoPackets && packets != kNotIsochronous;
}

tl::expected<Urb, UrbError> take_submit(const UrbHead& head, ByteReader& in) ABBE_RT {
  Submit urb{.head = head};
  urb.flags = in.big<std::uint32_t>();
  urb.length = in.big<std::uint32_t>();
  urb.start_frame = in.big<std::uint32_t>();
  if (isochronous(in.big<std::uint32_t>())) return tl::unexpected{UrbError::Isochronous};
  urb.interval = in.big<std::uint32_t>();
  std::ranges::copy(in.take(usb::kSetupSize), urb.setup.begin());
  return urb;
}

tl::expected<Urb, UrbError> take_submit_reply(const UrbHead& head, ByteReader& in) ABBE_RT {
  SubmitReply urb{.head = head};
  urb.status = in.big<UrbStatus>();
  urb.length = in.big<std::uint32_t>();
  urb.start_frame = in.big<std::uint32_t>();
  if (isochronous(in.big<std::uint32_t>())) return tl::unexpected{UrbError::Isochronous};
  urb.errors = in.big<std::uint32_t>();
  return urb;
}

}  // namespace

const char* to_text(UrbError error) noexcept {
  switch (error) {
    case UrbError::UnknownCommand:
      return "an unknown USB/IP command";
    case UrbError::BadDirection:
      return "an invalid USB/IP direction (neither in nor out)";
    case UrbError::Isochronous:
      return "an isochronous transfer";
  }
  return "?";
}

UrbBytes encode(const Urb& urb) ABBE_RT {
  UrbBytes bytes{};
  ByteWriter out{bytes};
  visit_trivial([&out](const auto& u) ABBE_RT { put(out, u); }, urb);
  return bytes;
}

tl::expected<Urb, UrbError> decode_urb(std::span<const std::byte, kUrbHeaderSize> bytes) ABBE_RT {
  ByteReader in{bytes};
  const auto command = in.big<Command>();
  UrbHead head;
  head.sequence = in.big<std::uint32_t>();
  head.device = in.big<std::uint32_t>();
  head.direction = in.big<Direction>();
  head.endpoint = in.big<std::uint32_t>();
  if (head.direction != Direction::Out && head.direction != Direction::In) {
    return tl::unexpected{UrbError::BadDirection};
  }
  switch (command) {
    case Command::Submit:
      return take_submit(head, in);
    case Command::Unlink:
      return Unlink{.head = head, .victim = in.big<std::uint32_t>()};
    case Command::SubmitReply:
      return take_submit_reply(head, in);
    case Command::UnlinkReply:
      return UnlinkReply{.head = head, .status = in.big<UrbStatus>()};
  }

  return tl::unexpected{UrbError::UnknownCommand};
}

}  // namespace abbe::protocol::usbip
