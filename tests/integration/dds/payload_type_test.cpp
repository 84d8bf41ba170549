// On the wire our pass-through type is identical to the types fastddsgen generates.
#include "abbe/dds/payload_type.hpp"

#include <fastdds/rtps/common/InstanceHandle.h>
#include <fastdds/rtps/common/SerializedPayload.h>
#include <gtest/gtest.h>

#include <set>
#include <string>

#include "abbe/messages/cdr.hpp"
#include "abbe_v1PubSubTypes.h"
#include "sample_messages.hpp"

namespace abbe::dds {
namespace {

using eprosima::fastrtps::rtps::InstanceHandle_t;
using eprosima::fastrtps::rtps::SerializedPayload_t;

template <class T>
Payload payload_of(const T& value) {
  Payload payload;
  EXPECT_TRUE(daemon::encode(value, payload.bytes).has_value());
  return payload;
}

template <class Generated, class T>
void expect_same_key(daemon::Topic topic, T value) {
  auto payload = payload_of(value);
  PayloadType ours(topic);
  Generated generated;
  InstanceHandle_t our_key, generated_key;
  ASSERT_TRUE(ours.getKey(&payload, &our_key, false));
  ASSERT_TRUE(generated.getKey(&value, &generated_key));
  EXPECT_EQ(our_key, generated_key);
}

TEST(PayloadType, KeyOfAMachineIsThatOfTheGeneratedType) {
  expect_same_key<v1::ModelStatePubSubType>(daemon::Topic::ModelState, test::active_state(1));
}

TEST(PayloadType, KeyOfASliceIsThatOfTheGeneratedType) {
  auto slice = test::grid_slices()[1];
  for (const char* machine : {"m", "mm", "mmm", "mmmm"}) {
    slice.machine(machine);  // the number behind it is aligned to 4
    expect_same_key<v1::ErrorGridPubSubType>(daemon::Topic::ErrorGrid, slice);
  }
}

TEST(PayloadType, KeyOfAStreamIsThatOfTheGeneratedType) {
  v1::Health health;
  health.machine("vmc-3");
  health.stream("tracker");
  expect_same_key<v1::HealthPubSubType>(daemon::Topic::Health, health);
}

TEST(PayloadType, NameAndSizeAreThoseOfTheGeneratedType) {
  const PayloadType ours(daemon::Topic::ErrorGrid);
  const v1::ErrorGridPubSubType generated;
  EXPECT_STREQ(ours.getName(), generated.getName());
  EXPECT_GE(ours.m_typeSize, generated.m_typeSize);
}

TEST(PayloadType, BytesAreThoseOfTheGeneratedType) {
  auto model = test::error_model();
  const auto payload = payload_of(model);
  v1::ErrorModelPubSubType generated;
  SerializedPayload_t serialized(generated.m_typeSize);
  ASSERT_TRUE(generated.serialize(&model, &serialized));
  const auto* begin = reinterpret_cast<const std::byte*>(serialized.data);
  EXPECT_EQ(payload.bytes, std::vector<std::byte>(begin, begin + serialized.length));
}

/// As a reader of Fast DDS asks for it.
template <class T>
InstanceHandle_t received_key(daemon::Topic topic, const T& value) {
  PayloadType type(topic);
  const auto payload = payload_of(value);
  SerializedPayload_t serialized(type.m_typeSize);
  Payload sent = payload, received;
  InstanceHandle_t key;
  EXPECT_TRUE(type.serialize(&sent, &serialized));
  EXPECT_TRUE(type.deserialize(&serialized, &received));
  EXPECT_TRUE(type.getKey(&received, &key, false));
  EXPECT_TRUE(key.isDefined());
  return key;
}

/// Fast DDS 2.9 aborts in a reader whose table of instances is full.
TEST(PayloadType, AReaderHasNoMoreThanItsInstancesWhateverStrangersMakeUp) {
  std::set<InstanceHandle_t> instances;
  auto state = test::active_state(1);
  for (int i = 0; i < 5000; ++i) {
    state.machine("stranger-" + std::to_string(i));
    instances.insert(received_key(daemon::Topic::ModelState, state));
  }
  EXPECT_LE(instances.size(), static_cast<std::size_t>(kReceivedInstances));
  EXPECT_GT(instances.size(), 900u);
}

TEST(PayloadType, ReceivedSlicesOfAMachineAreDifferentInstances) {
  std::set<InstanceHandle_t> instances;
  auto slice = test::grid_slices()[0];
  for (std::uint32_t i = 0; i < 64; ++i) {
    slice.slice(i);
    instances.insert(received_key(daemon::Topic::ErrorGrid, slice));
  }
  EXPECT_EQ(instances.size(), 64u);
}

/// Fast DDS 2.9 aborts in a reader whose type finds no key.
TEST(PayloadType, AllBytesWithoutAKeyAreOneInstance) {
  PayloadType type(daemon::Topic::Health);
  InstanceHandle_t first, second;
  for (auto* key : {&first, &second}) {
    Payload payload{std::vector<std::byte>(key == &first ? 0 : 6)};
    EXPECT_TRUE(type.getKey(&payload, key, false));
    EXPECT_TRUE(key->isDefined());
  }
  EXPECT_EQ(first, second);
}

}  // namespace
}  // namespace abbe::dds
