#pragma once
/// The data type of a topic for Fast DDS: payloads that are encoded (CDR) already. Fast DDS sends
/// the bytes that abbed encoded without changing them. A subscriber decodes received bytes with
/// daemon::decode, which returns an error for malformed input where generated code would throw. On
/// the wire this type is identical to the type generated from the IDL. Used by Fast DDS from any
/// thread.

#include <fastdds/dds/topic/TopicDataType.hpp>

#include <cstddef>
#include <vector>

#include "abbe/messages/topics.hpp"

namespace abbe::dds {

/// Number of instances into which a reader divides the received samples, by a hash of the key.
/// Other participants may send any number of keys, and Fast DDS 2.9 aborts when its table of
/// instances is full (DataReaderHistory.cpp:822). If two keys share an instance, the later sample
/// replaces an earlier one that was not taken yet. Slices of one machine always have different
/// instances.
inline constexpr int kReceivedInstances = 1024;

/// The data that a PayloadType serializes: the encapsulation header and the CDR bytes.
struct Payload {
  std::vector<std::byte> bytes;
  bool received = false;  ///< true: received by a reader of Fast DDS
};

class PayloadType final : public eprosima::fastdds::dds::TopicDataType {
 public:
  explicit PayloadType(daemon::Topic topic);

  bool serialize(void* data, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override;
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* data) override;
  std::function<uint32_t()> getSerializedSizeProvider(void* data) override;
  /// MD5 of the key as big-endian CDR [DDSI-RTPS 2.5, 9.6.3.8]. Always MD5, because the key of
  /// every abbe topic may be longer than 16 bytes. For a received payload the result is its
  /// instance, one of kReceivedInstances.
  bool getKey(void* data, eprosima::fastrtps::rtps::InstanceHandle_t* handle,
              bool force_md5) override;
  void* createData() override { return new Payload; }
  void deleteData(void* data) override { delete static_cast<Payload*>(data); }
  bool is_bounded() const override { return true; }

 private:
  daemon::Topic topic_;
};

}  // namespace abbe::dds
