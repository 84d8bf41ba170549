// Any bytes, read as a controller's stream, as a client's, and as one packet: nothing may read past
// an end, and what decodes must encode to bytes that decode and encode to themselves. libFuzzer:
// -max_len=1024
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <span>
#include <vector>

#include "abbe/protocol/emscon/framer.hpp"
#include "abbe/protocol/emscon/results.hpp"

namespace {

using namespace abbe::protocol::emscon;
using Bytes = std::span<const std::byte>;

template <class... Arguments>
std::vector<std::byte> encoded(const Arguments&... arguments) {
  std::vector<std::byte> bytes(kMaxPacketSize);
  bytes.resize(encode(arguments..., std::span<std::byte>{bytes}));
  return bytes;
}

std::vector<std::byte> encoded(const MultiResult& result) {
  std::vector<MultiPoint> plain;
  std::vector<ExtendedMultiPoint> extended;
  for (std::size_t k = 0; k < result.size(); ++k) {
    plain.push_back(result.point(k));
    if (result.extended()) extended.push_back({result.point(k), result.statistics(k)});
  }
  return result.extended() ? encoded(result.head(), std::span<const ExtendedMultiPoint>{extended})
                           : encoded(result.head(), std::span<const MultiPoint>{plain});
}

std::vector<std::byte> encoded(const OtherPacket&) {
  return {};
}

std::vector<std::byte> encoded(const ControllerPacket& packet) {
  return std::visit([](const auto& p) { return encoded(p); }, packet);
}

void check(bool holds) {
  if (!holds) std::abort();
}

template <class Decode>
void try_packet(Bytes packet, Decode decode_it) {
  const auto first = decode_it(packet);
  if (!first) return;
  const auto bytes = encoded(*first);
  if (bytes.empty()) return;  // a packet without an encoder
  const auto second = decode_it(Bytes{bytes});
  check(second.has_value() && encoded(*second) == bytes);
}

void try_stream(Bytes stream, bool resync) {
  static const auto framer = std::make_unique<PacketFramer>();
  framer->reset();
  if (resync) framer->resync();

  while (!stream.empty()) {
    const auto taken = framer->push(stream.first(std::min<std::size_t>(stream.size(), 77)));
    check(taken != 0);
    stream = stream.subspan(taken);
    while (const auto packet = framer->next()) {
      try_packet(*packet, [](Bytes b) { return decode(b); });
      try_packet(*packet, [](Bytes b) { return decode_request(b); });
    }
    if (framer->broken()) return;
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const Bytes bytes = std::as_bytes(std::span{data, size});
  try_packet(bytes, [](Bytes b) { return decode(b); });
  try_packet(bytes, [](Bytes b) { return decode_request(b); });
  try_stream(bytes, false);
  try_stream(bytes, true);
  return 0;
}
