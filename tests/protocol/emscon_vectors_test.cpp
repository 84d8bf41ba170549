// Packets as hex, written down from the documented layouts independently of the codec.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "emscon_samples.hpp"

namespace abbe::protocol::emscon {
namespace {

using samples::encoded;
using samples::from_hex;

struct RequestVector {
  const char* name;
  Request request;
  const char* hex;
};

class EmsconRequestVector : public testing::TestWithParam<RequestVector> {};

TEST_P(EmsconRequestVector, EncodesByteForByte) {
  EXPECT_EQ(encoded(GetParam().request), from_hex(GetParam().hex));
}
TEST_P(EmsconRequestVector, DecodesToTheSameCommand) {
  const auto decoded = decode_request(from_hex(GetParam().hex));
  ASSERT_TRUE(decoded) << name_of(decoded.error());
  EXPECT_EQ(command_of(*decoded), command_of(GetParam().request));
  EXPECT_EQ(encoded(*decoded), from_hex(GetParam().hex));
}

INSTANTIATE_TEST_SUITE_P(
    Documented, EmsconRequestVector,
    testing::Values(
        RequestVector{"GetSystemStatus", GetSystemStatus{}, "0c000000 00000000 01000000"},
        RequestVector{"SetUnits",
                      SetUnits{{LengthUnit::Millimetre, AngleUnit::Radian, TemperatureUnit::Celsius,
                                PressureUnit::Millibar, HumidityUnit::RelativePercent}},
                      "20000000 00000000 05000000 01000000 00000000 00000000 00000000 00000000"},
        RequestVector{"Initialize", Initialize{}, "0c000000 00000000 07000000"},
        RequestVector{"ContinuousTime", SetMeasurementMode{MeasurementMode::ContinuousTime},
                      "10000000 00000000 18000000 01000000"},
        RequestVector{"EveryMillisecond",
                      SetContinuousTimeModeParams{1, 0, false, RegionType::Sphere},
                      "1c000000 00000000 1e000000 01000000 00000000 00000000 00000000"},
        RequestVector{"Start", StartMeasurement{}, "0c000000 00000000 31000000"},
        RequestVector{"Stop", StopMeasurement{}, "0c000000 00000000 34000000"},
        RequestVector{
            "Environment", SetEnvironmentParams{{20.0, 1013.25, 50.0}},
            "24000000 00000000 14000000 0000000000003440 0000000000aa8f40 0000000000004940"}),
    [](const auto& vector) { return vector.param.name; });

TEST(EmsconAnswer, OkToInitializeIsSixteenBytes) {
  const auto hex = from_hex("10000000 00000000 07000000 00000000");
  EXPECT_EQ(encoded(Answer{Acknowledge{Command::Initialize, Status::Ok}}), hex);
  const auto answer = decode_answer(hex);
  ASSERT_TRUE(answer);
  EXPECT_EQ(command_of(*answer), Command::Initialize);
  EXPECT_EQ(status_of(*answer), Status::Ok);
}

constexpr const char* kMultiHex =
    "54000000 03000000 00000000 01000000 01000000 00000000"
    "0000000000003440 0000000000aa8f40 0000000000004940  00000000 39300000 70580a00"
    "0000000000408f40 0000000000409f40 0000000000c072c0";

TEST(EmsconMultiResult, EncodesByteForByte) {
  const MultiHead head{Status::Ok, MeasurementMode::ContinuousTime, false, {20.0, 1013.25, 50.0}};
  const std::array points{MultiPoint{PointStatus::Ok, {12345, 678000}, {1000, 2000, -300}}};
  EXPECT_EQ(encoded(head, std::span<const MultiPoint>{points}), from_hex(kMultiHex));
}

TEST(EmsconMultiResult, DecodesTimeAndPlace) {
  const auto bytes = from_hex(kMultiHex);
  const auto result = MultiResult::from(bytes);
  ASSERT_TRUE(result);
  ASSERT_EQ(result->size(), 1u);
  EXPECT_EQ(result->head().environment.pressure, 1013.25);
  EXPECT_THAT(result->point(0).value, testing::ElementsAre(1000.0, 2000.0, -300.0));
  EXPECT_EQ(result->point(0).time.to_device_time().time_since_epoch(),
            std::chrono::milliseconds{12'345'678});
}

/// Whole sizes of the packets, from the documented table.
TEST(EmsconLayout, HasTheDocumentedSizes) {
  EXPECT_EQ(encoded(Request{SetStationOrientation{}}).size(), 60u);
  EXPECT_EQ(encoded(Request{SetTransformation{}}).size(), 68u);
  EXPECT_EQ(encoded(Request{SetRefractionParams{}}).size(), 28u);
  EXPECT_EQ(encoded(Request{SetContinuousDistanceModeParams{}}).size(), 32u);
  EXPECT_EQ(encoded(Request{SetSearchParams{}}).size(), 24u);
  EXPECT_EQ(encoded(Request{SetSystemSettings{}}).size(), 48u);
  EXPECT_EQ(encoded(Request{GoPosition{}}).size(), 40u);
  EXPECT_EQ(encoded(Request{SetExternTriggerParams{}}).size(), 28u);
  EXPECT_EQ(encoded(Answer{SystemStatusAnswer{}}).size(), 56u);
  EXPECT_EQ(encoded(Answer{UnitsAnswer{}}).size(), 36u);
  EXPECT_EQ(encoded(Answer{EnvironmentAnswer{}}).size(), 40u);
  EXPECT_EQ(encoded(Answer{RefractionAnswer{}}).size(), 32u);
  EXPECT_EQ(encoded(Answer{ReflectorsAnswer{}}).size(), 100u);
  EXPECT_EQ(encoded(Answer{SystemSettingsAnswer{}}).size(), 52u);
  EXPECT_EQ(encoded(Answer{TrackerInfoAnswer{}}).size(), 164u);
  EXPECT_EQ(encoded(samples::single()).size(), 156u);
}

TEST(EmsconLayout, PutsFieldsWhereTheyAreDocumented) {
  const auto at = [](const samples::Bytes& bytes, std::size_t offset) {
    std::int32_t value = 0;
    std::memcpy(&value, bytes.data() + offset, sizeof value);  // the test hosts are little-endian
    return value;
  };

  SystemStatusAnswer status;
  status.laser = LaserStatus::Heating;
  status.serial_number = 2042;

  EXPECT_EQ(at(encoded(Answer{status}), 24), 2);
  EXPECT_EQ(at(encoded(Answer{status}), 52), 2042);
  TrackerInfoAnswer info;
  info.serial_number = 77;
  info.max_data_rate_hz = 3000;
  EXPECT_EQ(at(encoded(Answer{info}), 84), 77);
  EXPECT_EQ(at(encoded(Answer{info}), 128), 3000);
  SystemSettings settings;
  settings.send_unsolicited_messages = true;
  settings.keep_last_position = false;
  EXPECT_EQ(at(encoded(Request{SetSystemSettings{settings}}), 24), 0);
  EXPECT_EQ(at(encoded(Request{SetSystemSettings{settings}}), 28), 1);
}

}  // namespace
}  // namespace abbe::protocol::emscon
