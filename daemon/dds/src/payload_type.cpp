#include "abbe/dds/payload_type.hpp"

#include <fastdds/rtps/common/InstanceHandle.h>
#include <fastdds/rtps/common/SerializedPayload.h>
#include <fastrtps/utils/md5.h>

#include <algorithm>
#include <cstring>
#include <string>
#include <string_view>

#include "abbe_v1.h"

namespace abbe::dds {
namespace {

using eprosima::fastrtps::rtps::InstanceHandle_t;

constexpr std::size_t kPayloadHeaderBytes = 4;

std::size_t largest_body_bytes(daemon::Topic topic) {
  switch (topic) {
    case daemon::Topic::Snapshot:
      return v1::Snapshot::getMaxCdrSerializedSize();
    case daemon::Topic::Compensation:
      return v1::Compensation::getMaxCdrSerializedSize();
    case daemon::Topic::ErrorModel:
      return v1::ErrorModel::getMaxCdrSerializedSize();
    case daemon::Topic::ErrorGrid:
      return v1::ErrorGrid::getMaxCdrSerializedSize();
    case daemon::Topic::ModelState:
      return v1::ModelState::getMaxCdrSerializedSize();
    case daemon::Topic::Health:
      return v1::Health::getMaxCdrSerializedSize();
    case daemon::Topic::CalibrationEvent:
      return v1::CalibrationEvent::getMaxCdrSerializedSize();
    case daemon::Topic::Identity:
      return v1::Identity::getMaxCdrSerializedSize();
  }

  return 0;
}

void append_big_endian(std::string& key, std::uint32_t value) {
  key.resize((key.size() + 3) / 4 * 4);  // CDR aligns a 4-byte number to 4, padding is zero
  for (int shift = 24; shift >= 0; shift -= 8)
    key.push_back(static_cast<char>((value >> shift) & 0xffu));
}

void append_big_endian(std::string& key, std::string_view text) {
  append_big_endian(key, static_cast<std::uint32_t>(text.size() + 1));
  key.append(text).push_back('\0');
}

InstanceHandle_t md5_of(const std::string& bytes) {
  InstanceHandle_t handle;
  MD5 md5;
  md5.init();
  md5.update(bytes.data(), static_cast<MD5::size_type>(bytes.size()));
  md5.finalize();
  std::copy(std::begin(md5.digest), std::end(md5.digest), &handle.value[0]);
  return handle;
}

/// The instance of a received sample. Numbers of one machine up to kReceivedInstances give
/// different instances. The first octet is set because a handle of zeros means "none".
InstanceHandle_t received_instance(std::string_view machine, std::uint32_t number,
                                   std::string_view text) {
  const auto hash = md5_of(std::string(machine) + '\0' + std::string(text));
  const std::uint32_t index =
      ((std::uint32_t{hash.value[0]} << 8 | hash.value[1]) + number) % kReceivedInstances;
  InstanceHandle_t handle;
  handle.value[0] = 1;
  handle.value[14] = static_cast<std::uint8_t>(index >> 8);
  handle.value[15] = static_cast<std::uint8_t>(index & 0xff);
  return handle;
}

}  // namespace

PayloadType::PayloadType(daemon::Topic topic) : topic_(topic) {
  setName(std::string(daemon::traits(topic).type_name).c_str());
  // In an RTPS submessage a payload is padded to a multiple of 4 bytes.
  m_typeSize = static_cast<uint32_t>(kPayloadHeaderBytes + (largest_body_bytes(topic) + 3) / 4 * 4);
  m_isGetKeyDefined = true;
}

bool PayloadType::serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) {
  const auto& bytes = static_cast<const Payload*>(data)->bytes;
  if (bytes.size() > payload->max_size) return false;
  std::memcpy(payload->data, bytes.data(), bytes.size());
  payload->length = static_cast<uint32_t>(bytes.size());
  payload->encapsulation = CDR_LE;
  return true;
}

bool PayloadType::deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) {
  const auto* begin = reinterpret_cast<const std::byte*>(payload->data);
  auto& received = *static_cast<Payload*>(data);
  received.bytes.assign(begin, begin + payload->length);
  received.received = true;
  return true;
}

std::function<uint32_t()> PayloadType::getSerializedSizeProvider(void* data) {
  return [data] { return static_cast<uint32_t>(static_cast<const Payload*>(data)->bytes.size()); };
}

bool PayloadType::getKey(void* data, InstanceHandle_t* handle, bool /*force_md5*/) {
  const auto& payload = *static_cast<const Payload*>(data);
  const auto key = daemon::payload_key(topic_, payload.bytes);
  // A reader of Fast DDS 2.9 aborts if a sample without key hash has a key that cannot be read.
  // Therefore all malformed payloads get the same instance; decoding refuses them later.
  if (payload.received) {
    *handle = key ? received_instance(key->machine, key->number.value_or(0), key->text.value_or(""))
                  : received_instance("", 0, "");
    return true;
  }

  std::string big_endian;
  if (key) append_big_endian(big_endian, key->machine);
  if (key && key->number) append_big_endian(big_endian, *key->number);
  if (key && key->text) append_big_endian(big_endian, *key->text);
  *handle = md5_of(big_endian);
  return true;
}

}  // namespace abbe::dds
