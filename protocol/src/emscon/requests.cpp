#include "abbe/protocol/emscon/requests.hpp"

#include <algorithm>
#include <utility>

#include "abbe/protocol/visit.hpp"
#include "emscon/fields.hpp"

namespace abbe::protocol::emscon {
namespace {

constexpr std::size_t kRequestHeadSize = 12;  // size, type, command

template <std::size_t... I>
constexpr std::size_t largest_request(std::index_sequence<I...>) {
  return kRequestHeadSize + std::max({wire::size_of<std::variant_alternative_t<I, Request>>()...});
}
using Alternatives = std::make_index_sequence<std::variant_size_v<Request>>;
static_assert(largest_request(Alternatives{}) == kMaxRequestSize);

using Decoded = tl::expected<Request, DecodeError>;

template <class P>
Decoded decode_as(ByteReader& in) ABBE_RT {
  if (in.remaining() < wire::size_of<P>()) return tl::unexpected{DecodeError::Truncated};
  if (in.remaining() > wire::size_of<P>()) return tl::unexpected{DecodeError::SizeMismatch};
  P p{};
  wire::fields(p, wire::Reader{in});
  return Request{p};
}

template <std::size_t... I>
Decoded decode_body(Command command, ByteReader& in, std::index_sequence<I...>) ABBE_RT {
  Decoded decoded = tl::unexpected{DecodeError::UnknownCommand};
  const auto try_one = [&]<class P>(std::in_place_type_t<P>) ABBE_RT {
    if (P::kCommand != command) return false;
    decoded = decode_as<P>(in);
    return true;
  };
  (try_one(std::in_place_type<std::variant_alternative_t<I, Request>>) || ...);
  return decoded;
}

}  // namespace

Command command_of(const Request& request) ABBE_RT {
  return visit_trivial([]<class P>(const P&) { return P::kCommand; }, request);
}

std::size_t encode(const Request& request, std::span<std::byte> out) ABBE_RT {
  return visit_trivial(
      [out]<class P>(const P& p) -> std::size_t {
        constexpr std::size_t kSize = kRequestHeadSize + wire::size_of<P>();
        if (out.size() < kSize) return 0;
        ByteWriter writer{out};
        wire::put_header(writer, kSize, PacketType::Command);
        writer.little(P::kCommand);
        wire::fields(p, wire::Writer{writer});
        return kSize;
      },
      request);
}

tl::expected<Request, DecodeError> decode_request(std::span<const std::byte> packet) ABBE_RT {
  ByteReader in{packet};
  const auto header = wire::take_header(in);
  if (!header) return tl::unexpected{header.error()};
  if (header->type != PacketType::Command) return tl::unexpected{DecodeError::NotACommand};
  const auto command = in.little<Command>();
  if (!in.ok()) return tl::unexpected{DecodeError::Truncated};
  return decode_body(command, in, Alternatives{});
}

}  // namespace abbe::protocol::emscon
