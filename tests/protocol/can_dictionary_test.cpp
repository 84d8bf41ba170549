#include <gtest/gtest.h>

#include <array>
#include <string>

#include "abbe/protocol/can/object_dictionary.hpp"

namespace abbe::protocol::can {
namespace {

std::array<std::byte, 8> bytes_of(std::uint64_t value) {
  std::array<std::byte, 8> bytes{};
  for (std::size_t i = 0; i < 8; ++i) bytes[i] = static_cast<std::byte>((value >> (8 * i)) & 0xFF);
  return bytes;
}
AbortCode write(ObjectDictionary& objects, ObjectId object, std::uint64_t value, std::size_t size) {
  const auto bytes = bytes_of(value);
  return objects.write(object, std::span{bytes}.first(size));
}
/// Node 5 with TPDO 1 disabled and its mapping cleared.
ObjectDictionary open_for_mapping() {
  ObjectDictionary objects{{.node = 5}};
  EXPECT_EQ(write(objects, {0x1800, 1}, 0xC0000185, 4), AbortCode::None);
  EXPECT_EQ(write(objects, {0x1A00, 0}, 0, 1), AbortCode::None);
  return objects;
}

TEST(ObjectDictionary, ContainsItsIdentity) {
  const ObjectDictionary objects{{.node = 5, .vendor = 0x11, .serial = 0x22}};
  EXPECT_EQ(objects.number(object::kDeviceType), 0x00080196u);
  EXPECT_EQ(objects.number(object::kVendor), 0x11u);
  EXPECT_EQ(objects.number(object::kSerial), 0x22u);
  EXPECT_EQ(objects.number({0x1200, 1}), 0x605u);
  EXPECT_EQ(objects.number({0x1200, 2}), 0x585u);
}

TEST(ObjectDictionary, KeepsItsNameWhenTheCallersTextIsGone) {
  std::string name = "scale X";
  const ObjectDictionary objects{{.name = name}};
  name = "overwritten";
  std::array<std::byte, kMaxSdoBytes> out{};
  std::size_t size = 0;
  ASSERT_EQ(objects.read(object::kDeviceName, out, size), AbortCode::None);
  EXPECT_EQ(std::string(reinterpret_cast<const char*>(out.data()), size), "scale X");
}

TEST(ObjectDictionary, DistinguishesMissingObjectsAndMissingSubindices) {
  ObjectDictionary objects{{}};
  EXPECT_EQ(objects.may_read({0x7000, 0}), AbortCode::NoObject);
  EXPECT_EQ(objects.may_read({0x1018, 9}), AbortCode::NoSubindex);
  EXPECT_EQ(objects.may_write({0x1018, 1}), AbortCode::ReadOnly);
  objects.add({0x2001, 0}, Access::WriteOnly, bytes_of(0));
  EXPECT_EQ(objects.may_read({0x2001, 0}), AbortCode::WriteOnly);
}

TEST(ObjectDictionary, RefusesValuesOfTheWrongWidth) {
  ObjectDictionary objects{{}};
  EXPECT_EQ(write(objects, object::kHeartbeatTime, 100, 1), AbortCode::TooShort);
  EXPECT_EQ(write(objects, object::kHeartbeatTime, 100, 4), AbortCode::TooLong);
  EXPECT_EQ(write(objects, object::kHeartbeatTime, 100, 2), AbortCode::None);
  EXPECT_EQ(objects.number(object::kHeartbeatTime), 100u);
}

TEST(ObjectDictionary, RefusesToRemapAnEnabledPdo) {
  ObjectDictionary objects{{.node = 5}};
  EXPECT_EQ(write(objects, {0x1A00, 0}, 0, 1), AbortCode::UnsupportedAccess);
  EXPECT_EQ(write(objects, {0x1A00, 1}, 0x60080040, 4), AbortCode::UnsupportedAccess);
}

TEST(ObjectDictionary, RefusesToRemapWhileTheCountIsNotZero) {
  ObjectDictionary objects{{.node = 5}};
  ASSERT_EQ(write(objects, {0x1800, 1}, 0x80000185, 4), AbortCode::None);
  EXPECT_EQ(write(objects, {0x1A00, 1}, 0x60080040, 4), AbortCode::UnsupportedAccess);
}

TEST(ObjectDictionary, RemapsInTheOrderOfTheStandard) {
  auto objects = open_for_mapping();
  EXPECT_EQ(write(objects, {0x1A00, 1}, 0x60080040, 4), AbortCode::None);
  EXPECT_EQ(write(objects, {0x1A00, 0}, 1, 1), AbortCode::None);
  EXPECT_EQ(write(objects, {0x1800, 1}, 0x40000185, 4), AbortCode::None);
  const auto pdo = objects.tpdo(1);
  EXPECT_TRUE(pdo.enabled);
  EXPECT_EQ(pdo.cob_id, 0x185u);
  EXPECT_EQ(pdo.mapping[0], mapped_position(PositionType::Signed64));
}

TEST(ObjectDictionary, MapsOnlyWhatExistsWithItsTrueWidth) {
  auto objects = open_for_mapping();
  EXPECT_EQ(write(objects, {0x1A00, 1}, 0x10000020, 4), AbortCode::NotMappable);
  EXPECT_EQ(write(objects, {0x1A00, 1}, 0x60040010, 4), AbortCode::NotMappable);
  EXPECT_EQ(write(objects, {0x1A00, 1}, 0x70000020, 4), AbortCode::NotMappable);
}

TEST(ObjectDictionary, RefusesAMappingOfMoreThanEightBytes) {
  auto objects = open_for_mapping();
  ASSERT_EQ(write(objects, {0x1A00, 1}, 0x60080040, 4), AbortCode::None);
  ASSERT_EQ(write(objects, {0x1A00, 2}, 0x65000010, 4), AbortCode::None);
  EXPECT_EQ(write(objects, {0x1A00, 0}, 2, 1), AbortCode::PdoLength);
  EXPECT_EQ(write(objects, {0x1A00, 0}, 9, 1), AbortCode::ValueTooHigh);
  EXPECT_EQ(write(objects, {0x1A00, 0}, 1, 1), AbortCode::None);
}

TEST(ObjectDictionary, WillNotEnableAPdoWithoutAMapping) {
  auto objects = open_for_mapping();
  EXPECT_EQ(write(objects, {0x1800, 1}, 0x185, 4), AbortCode::InvalidValue);
}

TEST(ObjectDictionary, RefusesReservedTransmissionTypes) {
  ObjectDictionary objects{{}};
  EXPECT_EQ(write(objects, {0x1800, 2}, 241, 1), AbortCode::InvalidValue);
  EXPECT_EQ(write(objects, {0x1800, 2}, 240, 1), AbortCode::None);
  EXPECT_EQ(write(objects, {0x1800, 2}, 254, 1), AbortCode::None);
}

TEST(ObjectDictionary, PresetSetsThePositionAndTheOffset) {
  ObjectDictionary objects{{}};
  objects.set_raw_position(1000);
  ASSERT_EQ(write(objects, object::kPreset, static_cast<std::uint32_t>(-50), 4), AbortCode::None);
  EXPECT_EQ(objects.position(), -50);
  objects.set_raw_position(1010);
  EXPECT_EQ(objects.number(object::kPosition), static_cast<std::uint32_t>(-40));
  EXPECT_EQ(objects.number(object::kPosition64), static_cast<std::uint64_t>(-40));
  EXPECT_EQ(objects.number(object::kOffset), static_cast<std::uint32_t>(-1050));
}

TEST(ObjectDictionary, CyclicTimerAndEventTimerAreOne) {
  ObjectDictionary objects{{}};
  ASSERT_EQ(write(objects, object::kCyclicTimer, 7, 2), AbortCode::None);
  EXPECT_EQ(objects.tpdo(1).event_timer_ms, 7);
  ASSERT_EQ(write(objects, {0x1800, 5}, 9, 2), AbortCode::None);
  EXPECT_EQ(objects.number(object::kCyclicTimer), 9u);
}

TEST(ObjectDictionary, SendsThePositionAsMapped) {
  ObjectDictionary objects{{.node = 5}};
  objects.set_raw_position(-2);
  EXPECT_EQ(objects.tpdo_frame(1), standard_frame(0x185, {0xFE, 0xFF, 0xFF, 0xFF}));
  EXPECT_EQ(objects.tpdo_frame(2), standard_frame(0x285, {0xFE, 0xFF, 0xFF, 0xFF}));
}

TEST(ObjectDictionary, KeepsTheLastErrorsNewestFirst) {
  ObjectDictionary objects{{}};
  for (std::uint16_t code = 0x5000; code < 0x5006; ++code) objects.record_error(code, 1);
  EXPECT_EQ(objects.number(object::kErrorHistory), 4u);
  EXPECT_EQ(objects.number({0x1003, 1}), 0x5005u);
  EXPECT_EQ(objects.number({0x1003, 4}), 0x5002u);
  ASSERT_EQ(write(objects, object::kErrorHistory, 0, 1), AbortCode::None);
  EXPECT_EQ(objects.number({0x1003, 1}), 0u);
}

TEST(ObjectDictionary, ResetBringsTheFactoryConfigurationBack) {
  auto objects = open_for_mapping();
  objects.reset();
  EXPECT_TRUE(objects.tpdo(1).enabled);
  EXPECT_EQ(objects.tpdo(1).mapping[0], mapped_position(PositionType::Signed32));
}

TEST(ObjectDictionary, ReportsThatItIsFullAtItsCapacity) {
  ObjectDictionary objects{{}};
  bool added = true;
  std::uint16_t index = 0x2000;
  while (added && index < 0x3000) added = objects.add({index++, 0}, Access::ReadWrite, bytes_of(0));
  EXPECT_FALSE(added);
  EXPECT_LT(index, 0x2000 + ObjectDictionary::kCapacity);
}

}  // namespace
}  // namespace abbe::protocol::can
