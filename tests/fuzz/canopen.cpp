// Any frames, in any order, at any times, to everything that reads them: the decoders, SDO client
// and server, configurator and object dictionary, and the receiver. Input: records of 13 bytes:
// what to do, time step, length and flags, identifier (2), data (8).
// libFuzzer: -max_len=520

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "abbe/drivers/can/encoder_receiver.hpp"
#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/encoder_configurator.hpp"
#include "abbe/protocol/can/error_frame.hpp"
#include "abbe/protocol/can/sdo_server.hpp"

namespace {

using namespace abbe::protocol::can;
using abbe::protocol::HostTime;

void require(bool holds) {
  if (!holds) std::abort();
}

constexpr std::size_t kRecord = 13;

CanFrame frame_of(std::span<const std::uint8_t> record) {
  CanFrame frame;
  frame.length = record[2];  // wild lengths too: a frame is plain data
  frame.flags = static_cast<std::uint8_t>(record[0] >> 4);
  frame.id = static_cast<std::uint32_t>(record[3] << 8 | record[4]) & 0xFFF;
  for (std::size_t i = 0; i < 8; ++i) frame.data[i] = static_cast<std::byte>(record[5 + i]);
  return frame;
}

void decode(const CanFrame& frame) {
  if (const auto m = decode_nmt(frame))
    require(decode_nmt(encode_nmt(m->command, m->node)).has_value());
  if (const auto h = decode_heartbeat(frame)) require(is_node_id(h->node));
  if (const auto e = decode_emergency(frame)) require(is_node_id(e->node));
  (void)decode_sync(frame);
  (void)decode_error_frame(frame);
  for (const auto type :
       {PositionType::Signed32, PositionType::Unsigned32, PositionType::Signed64}) {
    (void)decode_position(frame.payload(), type, frame.byte(0));
  }
}

abbe::drivers::EncoderReceiverOptions two_axes() {
  abbe::drivers::EncoderReceiverOptions options;
  options.axes = {{.name = "X", .node = 1},
                  {.name = "C", .node = 2, .kind = abbe::drivers::AxisKind::Rotary}};
  return options;
}

/// A client talks to the server; the fuzzer's frames come in between.
struct World {
  inline static const ObjectDictionary kFresh{{.node = 1}};  // made once: half of the time else
  ObjectDictionary objects = kFresh;
  SdoServer server{1, objects};
  EncoderConfigurator configurator{{.node = 1}};
  abbe::drivers::EncoderReceiver receiver{two_axes()};
  HostTime now{};

  void pump() {
    for (int i = 0; i < 100; ++i) {
      const auto request = configurator.take_frame();
      if (!request) return;
      if (const auto answer = server.on_frame(*request, now)) configurator.on_frame(*answer, now);
    }
  }
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  World world;
  std::span<const std::uint8_t> rest{data, size};
  while (rest.size() >= kRecord) {
    const auto frame = frame_of(rest.first(kRecord));
    world.now += std::chrono::microseconds{rest[1] * rest[1] * 16};
    decode(frame);
    (void)world.server.on_frame(frame, world.now);
    (void)world.server.on_time(world.now);
    switch (rest[0] & 7) {
      case 0:
        world.configurator.start(world.now);
        break;
      case 1:
        world.pump();
        break;
      case 2:
        world.configurator.on_time(world.now);
        break;
      case 3:
        (void)world.receiver.on_sent(frame, world.now);
        break;
      case 4:
        require(world.receiver.on_time(world.now).size() <= 2);
        break;
      default:
        world.configurator.on_frame(frame, world.now);
    }
    const auto samples = world.receiver.on_frame(frame, world.now);
    require(samples.size() <= 2);
    for (const auto& sample : samples)
      require(sample.axis_count == 2 && (sample.missing_mask & ~3) == 0);
    rest = rest.subspan(kRecord);
  }

  require(world.objects.tpdo_frame(1).length <= 8);
  return 0;
}
