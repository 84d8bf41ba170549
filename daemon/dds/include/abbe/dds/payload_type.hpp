#pragma once
/// The types of the topics as Fast DDS sees them here: payloads that are already CDR. What abbed
/// encoded goes on the wire byte for byte, and what arrives is decoded by the total daemon::decode,
/// not by generated code that lets a stranger's bytes throw. On the wire nothing tells it from the
/// generated types. Used by Fast DDS from any thread.

#include <fastdds/dds/topic/TopicDataType.hpp>

#include <cstddef>
#include <vector>

#include "abbe/messages/topics.hpp"

namespace abbe::dds {

/// What a PayloadType reads and writes: the encapsulation header and the CDR bytes.
struct Payload {
  std::vector<std::byte> bytes;
};

class PayloadType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  explicit PayloadType(daemon::Topic topic);

  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override;
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override;
  std::function<uint32_t()> getSerializedSizeProvider(void* data) override;
  /// MD5 of the key as big-endian CDR [DDSI-RTPS 2.5, 9.6.3.8]: every key of ours may exceed 16
  /// bytes.
  bool getKey(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle,
              bool force_md5) override;
  void* createData() override { return new Payload; }
  void deleteData(void* data) override { delete static_cast<Payload*>(data); }
  bool is_bounded() const override { return true; }

 private:
  daemon::Topic topic_;
};

}  // namespace abbe::dds
