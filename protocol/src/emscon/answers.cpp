#include "abbe/protocol/emscon/answers.hpp"

#include <algorithm>
#include <utility>

#include "abbe/protocol/visit.hpp"
#include "emscon/fields.hpp"

namespace abbe::protocol::emscon {
namespace {

constexpr std::size_t kAnswerHeadSize = 16;  // size, type, command, status

template <std::size_t... I>
constexpr std::size_t largest_answer(std::index_sequence<I...>) {
  return kAnswerHeadSize + std::max({wire::size_of<std::variant_alternative_t<I, Answer>>()...});
}
static_assert(largest_answer(std::make_index_sequence<std::variant_size_v<Answer>>{}) ==
              kMaxAnswerSize);

// The first alternative of Answer is Acknowledge, which is valid for every command; each of the
// others belongs to its kCommand.
using OwnAnswers = std::make_index_sequence<std::variant_size_v<Answer> - 1>;
template <std::size_t I>
using OwnAnswer = std::variant_alternative_t<I + 1, Answer>;

using Decoded = tl::expected<Answer, DecodeError>;

template <class P>
Decoded decode_as(ByteReader& in, Status status) ABBE_RT {
  if (in.remaining() < wire::size_of<P>()) return tl::unexpected{DecodeError::Truncated};
  P p{};
  p.status = status;
  wire::fields(p, wire::Reader{in});
  return Answer{p};
}

template <std::size_t... I>
Decoded decode_body(Command command, Status status, ByteReader& in,
                    std::index_sequence<I...>) ABBE_RT {
  Decoded decoded = Answer{Acknowledge{command, status}};
  if (in.remaining() == 0) return decoded;
  const auto try_one = [&]<class P>(std::in_place_type_t<P>) ABBE_RT {
    if (P::kCommand != command) return false;
    decoded = decode_as<P>(in, status);
    return true;
  };
  (try_one(std::in_place_type<OwnAnswer<I>>) || ...);
  return decoded;
}

struct CommandOf {
  Command operator()(const Acknowledge& p) const ABBE_RT { return p.command; }
  template <class P>
  Command operator()(const P&) const ABBE_RT {
    return P::kCommand;
  }
};

}  // namespace

Command command_of(const Answer& answer) ABBE_RT {
  return visit_trivial(CommandOf{}, answer);
}

Status status_of(const Answer& answer) ABBE_RT {
  return visit_trivial([](const auto& p) { return p.status; }, answer);
}

std::size_t encode(const Answer& answer, std::span<std::byte> out) ABBE_RT {
  return visit_trivial(
      [out]<class P>(const P& p) -> std::size_t {
        constexpr std::size_t kSize = kAnswerHeadSize + wire::size_of<P>();
        if (out.size() < kSize) return 0;
        ByteWriter writer{out};
        wire::put_header(writer, kSize, PacketType::Command);
        writer.little(CommandOf{}(p));
        writer.little(p.status);
        wire::fields(p, wire::Writer{writer});
        return kSize;
      },
      answer);
}

tl::expected<Answer, DecodeError> decode_answer(std::span<const std::byte> packet) ABBE_RT {
  ByteReader in{packet};
  const auto header = wire::take_header(in);
  if (!header) return tl::unexpected{header.error()};
  if (header->type != PacketType::Command) return tl::unexpected{DecodeError::NotACommand};
  const auto command = in.little<Command>();
  const auto status = in.little<Status>();
  if (!in.ok()) return tl::unexpected{DecodeError::Truncated};
  return decode_body(command, status, in, OwnAnswers{});
}

}  // namespace abbe::protocol::emscon
