#include "abbe/protocol/usbip/operations.hpp"

#include <cstring>

#include "abbe/protocol/bytes.hpp"

namespace abbe::protocol::usbip {
namespace {

template <std::size_t N>
void put(ByteWriter& out, const FixedText<N>& text) ABBE_RT {
  out.put(std::as_bytes(std::span{text.characters}));
}

template <std::size_t N>
FixedText<N> take_text(ByteReader& in) ABBE_RT {
  FixedText<N> text;
  const auto bytes = in.take(N);
  if (!bytes.empty()) std::memcpy(text.characters.data(), bytes.data(), N);
  return text;
}

void put(ByteWriter& out, const OpHead& head) ABBE_RT {
  out.big(head.version);
  out.big(head.code);
  out.big(head.status);
}

void put(ByteWriter& out, const ExportedDevice& d) ABBE_RT {
  put(out, d.path);
  put(out, d.bus_id);
  out.big(d.bus);
  out.big(d.number);
  out.big(d.speed);
  out.big(d.vendor);
  out.big(d.product);
  out.big(d.version);
  out.big(d.device_class);
  out.big(d.device_subclass);
  out.big(d.device_protocol);
  out.big(d.configuration);
  out.big(d.configurations);
  out.big(d.interfaces);
}

ExportedDevice take_device(ByteReader& in) ABBE_RT {
  ExportedDevice d;
  d.path = take_text<256>(in);
  d.bus_id = take_text<32>(in);
  d.bus = in.big<std::uint32_t>();
  d.number = in.big<std::uint32_t>();
  d.speed = in.big<Speed>();
  d.vendor = in.big<std::uint16_t>();
  d.product = in.big<std::uint16_t>();
  d.version = in.big<std::uint16_t>();
  d.device_class = in.big<std::uint8_t>();
  d.device_subclass = in.big<std::uint8_t>();
  d.device_protocol = in.big<std::uint8_t>();
  d.configuration = in.big<std::uint8_t>();
  d.configurations = in.big<std::uint8_t>();
  d.interfaces = in.big<std::uint8_t>();
  return d;
}

bool known(OpCode code) ABBE_RT {
  switch (code) {
    case OpCode::DeviceListRequest:
    case OpCode::DeviceListReply:
    case OpCode::ImportRequest:
    case OpCode::ImportReply:
      return true;
  }
  return false;
}

tl::expected<OpHead, OpError> expect_head(std::span<const std::byte> bytes, OpCode code) ABBE_RT {
  const auto head = decode_op_head(bytes);
  if (head && head->code != code) return tl::unexpected{OpError::UnknownCode};
  return head;
}

std::size_t bytes_in(const ByteWriter& out) ABBE_RT {
  return out.ok() ? out.size() : 0;
}

}  // namespace

const char* to_text(OpError error) noexcept {
  switch (error) {
    case OpError::Truncated:
      return "a truncated message";
    case OpError::BadVersion:
      return "no USB/IP 1.1.1";
    case OpError::UnknownCode:
      return "not the expected message";
  }
  return "?";
}

tl::expected<OpHead, OpError> decode_op_head(std::span<const std::byte> bytes) ABBE_RT {
  ByteReader in{bytes};
  OpHead head;
  head.version = in.big<std::uint16_t>();
  head.code = in.big<OpCode>();
  head.status = in.big<OpStatus>();
  if (!in.ok()) return tl::unexpected{OpError::Truncated};
  if (head.version != kVersion) return tl::unexpected{OpError::BadVersion};
  if (!known(head.code)) return tl::unexpected{OpError::UnknownCode};
  return head;
}

std::size_t encode_import_request(const BusId& bus_id, std::span<std::byte> out) ABBE_RT {
  ByteWriter writer{out};
  put(writer, OpHead{.code = OpCode::ImportRequest});
  put(writer, bus_id);
  return bytes_in(writer);
}

std::size_t encode_import_reply(OpStatus status, const ExportedDevice* device,
                                std::span<std::byte> out) ABBE_RT {
  ByteWriter writer{out};
  put(writer, OpHead{.code = OpCode::ImportReply, .status = status});
  if (device != nullptr) put(writer, *device);
  return bytes_in(writer);
}

tl::expected<BusId, OpError> decode_import_request(std::span<const std::byte> bytes) ABBE_RT {
  if (const auto head = expect_head(bytes, OpCode::ImportRequest); !head)
    return tl::unexpected{head.error()};
  ByteReader in{bytes};
  in.skip(kOpHeadSize);
  const auto bus_id = take_text<32>(in);
  if (!in.ok()) return tl::unexpected{OpError::Truncated};
  return bus_id;
}

tl::expected<ImportReply, OpError> decode_import_reply(std::span<const std::byte> bytes) ABBE_RT {
  const auto head = expect_head(bytes, OpCode::ImportReply);
  if (!head) return tl::unexpected{head.error()};
  ImportReply reply{.status = head->status, .device = {}};
  if (head->status != OpStatus::Ok) return reply;
  ByteReader in{bytes};
  in.skip(kOpHeadSize);
  reply.device = take_device(in);
  if (!in.ok()) return tl::unexpected{OpError::Truncated};
  return reply;
}

DeviceListWriter::DeviceListWriter(std::span<std::byte> out, std::uint32_t devices) ABBE_RT
    : out_(out) {
  ByteWriter writer{out_};
  put(writer, OpHead{.code = OpCode::DeviceListReply});
  writer.big(devices);
  size_ = bytes_in(writer);
}

bool DeviceListWriter::add(const ExportedDevice& device,
                           std::span<const ExportedInterface> interfaces) ABBE_RT {
  ByteWriter writer{out_.subspan(size_)};
  put(writer, device);
  for (const auto& i : interfaces) {
    writer.big(i.interface_class);
    writer.big(i.interface_subclass);
    writer.big(i.interface_protocol);
    writer.zeros(1);
  }
  if (!writer.ok() || device.interfaces != interfaces.size()) return false;
  size_ += writer.size();
  return true;
}

}  // namespace abbe::protocol::usbip
