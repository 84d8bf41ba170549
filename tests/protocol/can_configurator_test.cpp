#include <gtest/gtest.h>

#include <array>
#include <span>
#include <vector>

#include "abbe/protocol/can/cia406.hpp"
#include "abbe/protocol/can/encoder_configurator.hpp"
#include "abbe/protocol/can/sdo_server.hpp"

namespace abbe::protocol::can {
namespace {

using namespace std::chrono_literals;

/// Runs the configurator against a dictionary; `sent` keeps what went over the wire.
struct Bench {
  explicit Bench(EncoderIdentity identity, EncoderPlan plan)
      : objects(identity), server(identity.node, objects), configurator(plan) {}

  void run() {
    configurator.start(HostTime{});
    while (const auto frame = configurator.take_frame()) {
      sent.push_back(*frame);
      if (const auto answer = server.on_frame(*frame, HostTime{}))
        configurator.on_frame(*answer, HostTime{});
    }
  }
  ObjectDictionary objects;
  SdoServer server;
  EncoderConfigurator configurator;
  std::vector<CanFrame> sent;
};

TEST(PdoConfiguration, FollowsTheOrderOfTheStandard) {
  const auto writes = pdo_configuration({.node = 5, .heartbeat_ms = 200});
  const std::vector<std::pair<ObjectId, std::uint32_t>> order{
      {{0x1800, 1}, 0xC0000185}, {{0x1A00, 0}, 0},          {{0x1A00, 1}, 0x60040020},
      {{0x1A00, 0}, 1},          {{0x1800, 2}, 1},          {{0x1800, 3}, 0},
      {{0x1800, 5}, 0},          {{0x1800, 1}, 0x40000185}, {{0x1017, 0}, 200}};
  for (std::size_t i = 0; i < order.size(); ++i) {
    EXPECT_EQ(writes[i].object, order[i].first) << i;
    EXPECT_EQ(writes[i].value, order[i].second) << i;
  }
}

TEST(EncoderConfigurator, StopsTheNodeFirstAndStartsItLast) {
  Bench bench{{.node = 5}, {.node = 5}};
  bench.run();
  ASSERT_EQ(bench.configurator.state(), EncoderConfigurator::State::Ready);
  EXPECT_EQ(bench.sent.front(), encode_nmt(NmtCommand::PreOperational, 5));
  EXPECT_EQ(bench.sent.back(), encode_nmt(NmtCommand::Start, 5));
}

TEST(EncoderConfigurator, LeavesOneSynchronousPositionPdo) {
  Bench bench{{.node = 5},
              {.node = 5, .position = PositionType::Signed64, .sync_every = 2, .heartbeat_ms = 50}};
  bench.run();
  const auto pdo = bench.objects.tpdo(1);
  EXPECT_TRUE(pdo.enabled);
  EXPECT_EQ(pdo.transmission_type, 2);
  EXPECT_EQ(pdo.event_timer_ms, 0);
  ASSERT_EQ(pdo.mapped, 1);
  EXPECT_EQ(pdo.mapping[0], mapped_position(PositionType::Signed64));
  EXPECT_FALSE(bench.objects.tpdo(2).enabled);
  EXPECT_EQ(bench.objects.number(object::kHeartbeatTime), 50u);
}

TEST(EncoderConfigurator, CanUseTheSecondTpdo) {
  Bench bench{{.node = 5}, {.node = 5, .tpdo = 2}};
  bench.run();
  EXPECT_TRUE(bench.objects.tpdo(2).enabled);
  EXPECT_FALSE(bench.objects.tpdo(1).enabled);
}

TEST(EncoderConfigurator, ReadsIdentityAndStep) {
  Bench bench{{.node = 5, .vendor = 7, .product = 8, .revision = 9, .serial = 10, .step_nm = 25},
              {.node = 5}};
  bench.run();
  const auto& description = bench.configurator.description();
  EXPECT_EQ(description.vendor, 7u);
  EXPECT_EQ(description.serial, 10u);
  EXPECT_EQ(description.step_nm, 25u);
  EXPECT_FALSE(description.units_per_revolution);
}

TEST(EncoderConfigurator, ReadsUnitsPerRevolutionOfARotaryEncoder) {
  Bench bench{{.node = 5, .kind = object::EncoderKind::SingleTurn, .units_per_revolution = 36000},
              {.node = 5}};
  bench.run();
  EXPECT_EQ(bench.configurator.description().units_per_revolution, 36000u);
  EXPECT_FALSE(bench.configurator.description().step_nm);
}

TEST(EncoderConfigurator, DistinguishesAnotherDeviceFromAnEncoder) {
  Bench bench{{.node = 5}, {.node = 5}};
  bench.objects.set_number(object::kDeviceType, 0x00020192);  // a drive: profile 402
  bench.run();
  EXPECT_EQ(bench.configurator.state(), EncoderConfigurator::State::Failed);
  EXPECT_EQ(bench.configurator.error().fault, ConfigurationFault::NotAnEncoder);
  EXPECT_EQ(bench.configurator.error().seen, 0x00020192u);
}

TEST(EncoderConfigurator, RefusesAnExchangedScale) {
  Bench bench{{.node = 5, .serial = 11}, {.node = 5, .serial = 12}};
  bench.run();
  EXPECT_EQ(bench.configurator.error().fault, ConfigurationFault::WrongSerial);
  EXPECT_EQ(bench.configurator.error().seen, 11u);
}

TEST(EncoderConfigurator, RefusesARotaryEncoderWhereALinearOneIsConfigured) {
  Bench bench{{.node = 5, .kind = object::EncoderKind::MultiTurn}, {.node = 5, .linear = true}};
  bench.run();
  EXPECT_EQ(bench.configurator.error().fault, ConfigurationFault::WrongKind);
}

TEST(EncoderConfigurator, RefusesAStepOfZeroOnlyWhenTheStepIsNeeded) {
  for (const bool needed : {true, false}) {
    Bench bench{{.node = 5}, {.node = 5, .needs_scale = needed}};
    bench.objects.set_number(object::kPositionStep, 0);
    bench.objects.set_number(object::kMeasuringStep, 0);
    bench.run();
    EXPECT_EQ(bench.configurator.error().fault,
              needed ? ConfigurationFault::NoScale : ConfigurationFault::None);
  }
}

TEST(EncoderConfigurator, TakesTheMeasuringStepWhereThePositionStepIsZero) {
  Bench bench{{.node = 5, .step_nm = 20}, {.node = 5, .needs_scale = true}};
  bench.objects.set_number(object::kPositionStep, 0);
  bench.run();
  EXPECT_EQ(bench.configurator.description().step_nm, 20u);
}

TEST(EncoderConfigurator, NamesTheObjectAndTheReasonOfARefusal) {
  Bench bench{{.node = 5, .has_position64 = false},
              {.node = 5, .position = PositionType::Signed64}};
  bench.run();
  EXPECT_EQ(bench.configurator.error().fault, ConfigurationFault::Refused);
  EXPECT_EQ(bench.configurator.error().object, (ObjectId{0x1A00, 1}));
  EXPECT_EQ(bench.configurator.error().abort_code, AbortCode::NotMappable);
}

void fix(ObjectDictionary& objects, ObjectId object, std::uint32_t value, std::size_t size) {
  const std::array bytes{std::byte(value), std::byte(value >> 8), std::byte(value >> 16),
                         std::byte(value >> 24)};
  ASSERT_TRUE(objects.add(object, Access::ReadOnly, std::span{bytes}.first(size)));
}
/// A TPDO 1 that cannot be mapped: these entries.
void fix_mapping(ObjectDictionary& objects, std::span<const MappedObject> entries) {
  fix(objects, {0x1A00, 0}, static_cast<std::uint32_t>(entries.size()), 1);
  for (std::size_t i = 0; i < entries.size(); ++i)
    fix(objects, {0x1A00, static_cast<std::uint8_t>(i + 1)}, encode_mapping(entries[i]), 4);
}

TEST(EncoderConfigurator, UsesAFixedMappingThatHoldsThePosition) {
  Bench bench{{.node = 5}, {.node = 5}};
  fix_mapping(bench.objects,
              std::array{MappedObject{0x6030, 1, 16}, mapped_position(PositionType::Signed32)});
  bench.run();
  ASSERT_EQ(bench.configurator.state(), EncoderConfigurator::State::Ready)
      << to_text(bench.configurator.error().fault);
  EXPECT_TRUE(bench.configurator.description().fixed_mapping);
  EXPECT_EQ(bench.configurator.description().position_byte, 2);
  EXPECT_EQ(bench.objects.tpdo(1).transmission_type, 1);
}

TEST(EncoderConfigurator, RefusesAFixedMappingWithoutThePosition) {
  Bench bench{{.node = 5}, {.node = 5}};
  fix_mapping(bench.objects, std::array{MappedObject{0x6030, 1, 16}});
  bench.run();
  EXPECT_EQ(bench.configurator.error().fault, ConfigurationFault::FixedMapping);
  EXPECT_EQ(bench.configurator.error().object.index, 0x1A00);
}

TEST(EncoderConfigurator, UsesAFirstEntryThatCannotBeWrittenWhereItIsThePosition) {
  Bench bench{{.node = 5}, {.node = 5}};
  fix(bench.objects, {0x1A00, 1}, encode_mapping(mapped_position(PositionType::Signed32)), 4);
  bench.run();
  EXPECT_EQ(bench.configurator.state(), EncoderConfigurator::State::Ready);
  EXPECT_EQ(bench.objects.tpdo(1).mapped, 1);
}

TEST(EncoderConfigurator, ContinuesWithoutAHeartbeatThatCannotBeSet) {
  Bench bench{{.node = 5}, {.node = 5}};
  fix(bench.objects, object::kHeartbeatTime, 1000, 2);
  bench.run();
  EXPECT_EQ(bench.configurator.state(), EncoderConfigurator::State::Ready);
}

TEST(EncoderConfigurator, TakesAFixedTransmissionTypeOnlyIfItIsEverySync) {
  for (const std::uint32_t type : {1u, 254u}) {
    Bench bench{{.node = 5}, {.node = 5}};
    fix(bench.objects, {0x1800, 2}, type, 1);
    bench.run();
    EXPECT_EQ(bench.configurator.error().fault,
              type == 1 ? ConfigurationFault::None : ConfigurationFault::FixedType);
  }
}

TEST(EncoderConfigurator, RefusesAStepOtherThanConfigured) {
  for (const double configured : {10.0, 19.8}) {
    Bench bench{{.node = 5, .step_nm = 20}, {.node = 5, .step_nm = configured}};
    bench.run();
    const bool rounded = configured > 19.0;
    EXPECT_EQ(bench.configurator.error().fault,
              rounded ? ConfigurationFault::None : ConfigurationFault::WrongStep);
    EXPECT_EQ(bench.configurator.error().seen, rounded ? 0u : 20u);
  }
}

TEST(EncoderConfigurator, TakesTheUnitsOfARotaryEncoderOnlyWhileScalingIsOn) {
  for (const bool scaling : {true, false}) {
    Bench bench{{.node = 5, .kind = object::EncoderKind::MultiTurn, .units_per_revolution = 36000},
                {.node = 5}};
    bench.objects.set_number(object::kOperatingParameters, scaling ? object::kScalingOn : 0);
    bench.objects.set_number(object::kMeasuringStep, 65536);
    fix(bench.objects, object::kRevolutions, 4096, 2);
    bench.run();
    EXPECT_EQ(bench.configurator.description().units_per_revolution, scaling ? 36000u : 65536u);
    EXPECT_EQ(bench.configurator.description().revolutions.value_or(0), scaling ? 0u : 4096u);
    EXPECT_EQ(bench.configurator.description().total_range.has_value(), scaling);
  }
}

TEST(EncoderConfigurator, GivesUpOnAMuteNodeAfterAllRetries) {
  EncoderConfigurator configurator{{.node = 5}};
  HostTime now{};
  configurator.start(now);
  for (int i = 0; i < 3; ++i) {
    EXPECT_EQ(configurator.state(), EncoderConfigurator::State::Working);
    now = configurator.deadline();
    configurator.on_time(now);
  }
  EXPECT_EQ(configurator.state(), EncoderConfigurator::State::Failed);
  EXPECT_EQ(configurator.error().fault, ConfigurationFault::Silent);
  EXPECT_EQ(now, HostTime{} + 1500ms);
}

TEST(EncoderConfigurator, RepeatsTheWholeSequenceWhenStartedAgain) {
  Bench bench{{.node = 5}, {.node = 5}};
  bench.run();
  bench.objects.reset();
  bench.run();
  EXPECT_EQ(bench.configurator.state(), EncoderConfigurator::State::Ready);
  EXPECT_EQ(bench.objects.tpdo(1).transmission_type, 1);
}

}  // namespace
}  // namespace abbe::protocol::can
