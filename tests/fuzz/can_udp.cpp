// Any bytes as a CAN-over-UDP datagram: refused, or read to the end and written again to the same
// bytes, except for the bits of the FD flag byte, which are not checked. Also as a raw block to the
// replaying receiver.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/protocol/can/udp_framing.hpp"

namespace {

using namespace abbe::protocol::can;

void require(bool holds) {
  if (!holds) std::abort();
}

void round_trip(std::span<const std::byte> bytes) {
  auto view = DatagramView::parse(bytes);
  if (!view) {
    require(*to_text(view.error()) != '\0');
    return;
  }

  std::vector<std::byte> buffer(bytes.size());
  DatagramWriter writer{buffer, view->sequence()};
  CanFrame frame;
  std::size_t count = 0;

  while (view->next(frame)) {
    require(writer.add(frame));
    ++count;
  }

  require(count == view->count());
  require(std::ranges::equal(writer.finish(), bytes));
}

void replay(std::span<const std::byte> bytes) {
  abbe::drivers::EncoderReceiverOptions options;
  options.axes = {{.name = "X", .node = 1}};
  abbe::drivers::EncoderReceiver receiver{options};
  abbe::protocol::RawBlock block;
  block.length = static_cast<std::uint16_t>(std::min(bytes.size(), block.bytes.size()));
  std::copy_n(bytes.begin(), block.length, block.bytes.begin());
  std::size_t samples = 0;

  for (const auto direction : {abbe::protocol::RawBlock::Direction::ToDevice,
                               abbe::protocol::RawBlock::Direction::FromDevice}) {
    block.direction = direction;
    block.time += std::chrono::microseconds{100};
    receiver.on_raw(block, [&](const auto&) { ++samples; });
  }

  require(samples == receiver.counters().samples);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto bytes = std::as_bytes(std::span{data, size});
  round_trip(bytes);
  replay(bytes);
  return 0;
}
