// Any parameters as the announcement of a participant, a writer or a reader: what passes the
// message filter is read by Fast DDS without more memory than an announcement needs. Fast DDS is
// not instrumented: reads beyond the message are found only where they end the process.
//
// libFuzzer: -max_len=2048 -malloc_limit_mb=8

#include <fastdds/rtps/builtin/data/ParticipantProxyData.h>
#include <fastdds/rtps/builtin/data/ReaderProxyData.h>
#include <fastdds/rtps/builtin/data/WriterProxyData.h>
#include <fastdds/rtps/network/NetworkFactory.h>
#include <fastdds/dds/log/Log.hpp>
#include <fastdds/rtps/attributes/RTPSParticipantAllocationAttributes.hpp>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "abbe/subscriber/message_filter.hpp"

namespace {

using namespace eprosima::fastrtps::rtps;  // NOLINT(google-build-using-namespace): a program
using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kKindAt = 20, kPayloadAt = 44;
constexpr std::array<std::uint8_t, 3> kWriters{0x01, 0x03,
                                               0x04};  ///< of participants, writers, readers

/// A DATA submessage with `list` behind the encapsulation of a list of parameters.
Bytes message_of(std::uint8_t writer, bool little_endian, const std::uint8_t* list,
                 std::size_t size) {
  const auto body = static_cast<std::uint16_t>(24 + size);
  const auto low = static_cast<std::uint8_t>(body & 0xff),
             high = static_cast<std::uint8_t>(body >> 8);
  const bool participant = writer == kWriters[0];
  Bytes message{'R', 'T', 'P', 'S', 2, 3, 1, 15, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1};
  message.insert(message.end(), {0x15, 5, low, high, 0, 0, 16, 0, 0, 0, 0, 0});
  message.insert(message.end(), {0, static_cast<std::uint8_t>(participant ? 1 : 0),
                                 static_cast<std::uint8_t>(participant ? 0 : writer), 0xc2});
  message.insert(message.end(), {0, 0, 0, 0, 1, 0, 0, 0});
  message.insert(message.end(), {0, static_cast<std::uint8_t>(little_endian ? 3 : 2), 0, 0});
  message.insert(message.end(), list, list + size);
  return message;
}

void read_with_fast_dds(std::uint8_t writer, Bytes payload) {
  static const NetworkFactory network;
  CDRMessage_t message(0);
  message.wraps = true;
  message.buffer = payload.data();
  message.length = message.max_size = static_cast<std::uint32_t>(payload.size());
  if (writer == kWriters[0]) {
    ParticipantProxyData data{RTPSParticipantAllocationAttributes{}};
    data.readFromCDRMessage(&message, true, network, false);
  } else if (writer == kWriters[1]) {
    WriterProxyData data(4, 4);
    data.readFromCDRMessage(&message, network, false);
  } else {
    ReaderProxyData data(4, 4);
    data.readFromCDRMessage(&message, network, false);
  }
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int*, char***) {
  eprosima::fastdds::dds::Log::ClearConsumers();  // it reports each announcement that it refuses
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const auto writer = kWriters[data[0] % kWriters.size()];
  const std::size_t list_size = (size - 2) / 4 * 4;
  Bytes message = message_of(writer, data[1] % 2 == 0, data + 2, list_size);
  const std::size_t passed = abbe::dds::filter_message(message);
  if (passed != 0 && passed != message.size()) std::abort();
  if (passed != 0 && message[kKindAt] == 0x15)
    read_with_fast_dds(writer, {message.begin() + kPayloadAt, message.end()});
  return 0;
}
