#include "abbe/protocol/emscon/results.hpp"

#include "emscon/fields.hpp"

namespace abbe::protocol::emscon {
namespace {

static_assert(wire::size_of<MultiPoint>() == kMultiPointSize);
static_assert(wire::size_of<ExtendedMultiPoint>() == kExtendedMultiPointSize);
static_assert(kHeaderSize + wire::size_of<SingleResult>() == 156);
static_assert(kHeaderSize + wire::size_of<ReflectorPosition>() == 36);

template <class P>
std::size_t encode_packet(PacketType type, const P& p, std::span<std::byte> out) ABBE_RT {
  constexpr std::size_t kSize = kHeaderSize + wire::size_of<P>();
  if (out.size() < kSize) return 0;
  ByteWriter writer{out};
  wire::put_header(writer, kSize, type);
  wire::fields(p, wire::Writer{writer});
  return kSize;
}

template <class Point>
std::size_t encode_multi(PacketType type, const MultiHead& head, std::span<const Point> points,
                         std::span<std::byte> out) ABBE_RT {
  constexpr std::size_t kPointSize = wire::size_of<Point>();
  if (points.size() > (kMaxPacketSize - kMultiHeadSize) / kPointSize) return 0;
  const std::size_t size = kMultiHeadSize + kPointSize * points.size();
  if (out.size() < size) return 0;
  ByteWriter writer{out};
  wire::put_header(writer, size, type);
  writer.little(head.status);
  writer.little(static_cast<std::int32_t>(points.size()));
  wire::Writer{writer}(head.mode, head.try_mode, head.environment);
  for (const Point& point : points) wire::fields(point, wire::Writer{writer});
  return size;
}

template <class P>
tl::expected<ControllerPacket, DecodeError> decode_as(ByteReader in) ABBE_RT {
  if (in.remaining() < wire::size_of<P>()) return tl::unexpected{DecodeError::Truncated};
  if (in.remaining() > wire::size_of<P>()) return tl::unexpected{DecodeError::SizeMismatch};
  P p{};
  wire::fields(p, wire::Reader{in});
  return ControllerPacket{p};
}

}  // namespace

tl::expected<MultiResult, DecodeError> MultiResult::from(
    std::span<const std::byte> packet) ABBE_RT {
  ByteReader in{packet};
  const auto header = wire::take_header(in);
  if (!header) return tl::unexpected{header.error()};
  const bool extended = header->type == PacketType::MultiResult2;
  if (!extended && header->type != PacketType::MultiResult)
    return tl::unexpected{DecodeError::UnknownType};
  MultiHead head;
  head.status = in.little<Status>();
  const auto count = in.little<std::uint32_t>();
  wire::Reader{in}(head.mode, head.try_mode, head.environment);
  if (!in.ok()) return tl::unexpected{DecodeError::Truncated};
  const std::size_t point_size = extended ? kExtendedMultiPointSize : kMultiPointSize;
  if (count != in.remaining() / point_size || in.remaining() % point_size != 0) {
    return tl::unexpected{DecodeError::CountMismatch};
  }
  return MultiResult{head, in.take(in.remaining()), point_size};
}

MultiPoint MultiResult::point(std::size_t k) const ABBE_RT {
  assert(k < size());
  ByteReader in{points_.subspan(k * point_size_, kMultiPointSize)};
  MultiPoint p;
  wire::fields(p, wire::Reader{in});
  return p;
}

MultiPointStatistics MultiResult::statistics(std::size_t k) const ABBE_RT {
  assert(k < size() && extended());
  ByteReader in{points_.subspan(k * point_size_ + kMultiPointSize,
                                kExtendedMultiPointSize - kMultiPointSize)};
  MultiPointStatistics s;
  wire::fields(s, wire::Reader{in});
  return s;
}

tl::expected<ControllerPacket, DecodeError> decode(std::span<const std::byte> packet) ABBE_RT {
  ByteReader in{packet};
  const auto header = wire::take_header(in);
  if (!header) return tl::unexpected{header.error()};

  const auto as_packet = [](const auto& p) { return ControllerPacket{p}; };
  switch (header->type) {
    case PacketType::Command:
      return decode_answer(packet).map(as_packet);
    case PacketType::MultiResult:
    case PacketType::MultiResult2:
      return MultiResult::from(packet).map(as_packet);
    case PacketType::Error:
      return decode_as<ErrorResponse>(in);
    case PacketType::StatusChange:
      return decode_as<StatusChange>(in);
    case PacketType::SingleResult:
      return decode_as<SingleResult>(in);
    case PacketType::ReflectorPosition:
      return decode_as<ReflectorPosition>(in);
    case PacketType::StationaryProbe:
    case PacketType::ContinuousProbe:
    case PacketType::Nivel:
    case PacketType::SingleResult2:
    case PacketType::ProbePosition:
      return ControllerPacket{OtherPacket{header->type}};
  }
  return tl::unexpected{DecodeError::UnknownType};
}

std::size_t encode(const ErrorResponse& p, std::span<std::byte> out) ABBE_RT {
  return encode_packet(PacketType::Error, p, out);
}
std::size_t encode(const StatusChange& p, std::span<std::byte> out) ABBE_RT {
  return encode_packet(PacketType::StatusChange, p, out);
}
std::size_t encode(const SingleResult& p, std::span<std::byte> out) ABBE_RT {
  return encode_packet(PacketType::SingleResult, p, out);
}
std::size_t encode(const ReflectorPosition& p, std::span<std::byte> out) ABBE_RT {
  return encode_packet(PacketType::ReflectorPosition, p, out);
}
std::size_t encode(const MultiHead& head, std::span<const MultiPoint> points,
                   std::span<std::byte> out) ABBE_RT {
  return encode_multi(PacketType::MultiResult, head, points, out);
}
std::size_t encode(const MultiHead& head, std::span<const ExtendedMultiPoint> points,
                   std::span<std::byte> out) ABBE_RT {
  return encode_multi(PacketType::MultiResult2, head, points, out);
}

}  // namespace abbe::protocol::emscon
