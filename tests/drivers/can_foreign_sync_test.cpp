// Another SYNC producer on the bus: nothing is sent.
#include "abbe/drivers/can/foreign_sync.hpp"

#include <gmock/gmock.h>

#include "encoder_device_on_udp.hpp"
#include "encoder_line.hpp"

namespace abbe::drivers {
namespace {

using namespace std::chrono_literals;
using encoder_line::kStart;
using testing::AllOf;
using testing::HasSubstr;

TEST(ForeignSync, ListensBeforeAnythingIsSent) {
  ForeignSync foreign;
  EXPECT_FALSE(foreign.may_send(kStart));
  foreign.opened(kStart);
  EXPECT_FALSE(foreign.may_send(kStart + ForeignSync::kListenFor - 1ns));
  EXPECT_TRUE(foreign.may_send(kStart + ForeignSync::kListenFor));
}

TEST(ForeignSync, ListensAgainEachTimeTheBusIsOpened) {
  ForeignSync foreign;
  foreign.opened(kStart);
  EXPECT_TRUE(foreign.may_send(kStart + 2s));
  foreign.opened(kStart + 1h);
  EXPECT_FALSE(foreign.may_send(kStart + 1h + ForeignSync::kListenFor - 1ns));
  EXPECT_TRUE(foreign.may_send(kStart + 1h + ForeignSync::kListenFor));
}

TEST(ForeignSync, ListensShorterAfterAShortBreakIfItProducedTheSync) {
  ForeignSync foreign;
  foreign.opened(kStart);
  EXPECT_TRUE(foreign.may_send(kStart + 2s));
  foreign.opened(kStart + 3s);
  EXPECT_FALSE(foreign.may_send(kStart + 3s + ForeignSync::kListenAgainFor - 1ns));
  foreign.opened(kStart + 4s);  // not listened to its end
  EXPECT_FALSE(foreign.may_send(kStart + 4s + ForeignSync::kListenFor - 1ns));
  EXPECT_TRUE(foreign.may_send(kStart + 4s + ForeignSync::kListenFor));
}

TEST(ForeignSync, ListensForThreePeriodsOfAProducerSeenBefore) {
  ForeignSync foreign;
  foreign.opened(kStart);
  foreign.heard(kStart);
  foreign.heard(kStart + 300ms);
  const auto ours = kStart + 300ms + ForeignSync::kQuietFor;
  EXPECT_TRUE(foreign.may_send(ours));
  foreign.opened(ours + 1s);
  EXPECT_FALSE(foreign.may_send(ours + 1s + 900ms - 1ns));
  EXPECT_TRUE(foreign.may_send(ours + 1s + 900ms));
}

TEST(ForeignSync, SilenceOfAClosedBusDoesNotCountAsQuiet) {
  ForeignSync foreign;
  foreign.opened(kStart);
  foreign.heard(kStart + 1s);
  foreign.opened(kStart + 1h);
  EXPECT_TRUE(foreign.present());
  EXPECT_FALSE(foreign.may_send(kStart + 1h + ForeignSync::kQuietFor - 1ns));
  foreign.heard(kStart + 2h);
  foreign.heard(kStart + 2h + 10ms);
  EXPECT_EQ(foreign.period(), 10ms) << "not from before";
}

TEST(ForeignSync, DetectsAProducerOfOneSyncASecond) {
  ForeignSync foreign;
  foreign.opened(kStart);
  foreign.heard(kStart + 1s);
  EXPECT_FALSE(foreign.may_send(kStart + ForeignSync::kListenFor));
  foreign.heard(kStart + 2s);
  EXPECT_EQ(foreign.period(), 1s);
  EXPECT_TRUE(foreign.may_send(kStart + 2s + ForeignSync::kQuietFor));
  EXPECT_FALSE(foreign.present());
}

TEST(ForeignSync, MeasuresThePeriodAlthoughSyncsAreMissing) {
  ForeignSync foreign;
  foreign.opened(kStart);
  for (int i = 0; i <= 1000; ++i) foreign.heard(kStart + 4ms * i);
  foreign.heard(kStart + 30s);
  EXPECT_EQ(foreign.period(), 4ms);
}

/// The nodes, and another SYNC producer, controlled by the test.
class BesideAnotherProducer : public EncoderDeviceOnUdp {
 protected:
  void SetUp() override {
    EncoderDeviceOnUdp::SetUp();
    listen();
  }
  /// Opens the bus.
  void listen() {
    device->wait(kCycle);
    device->receive();
    peer.talk_to(bus->local_port());
  }
  void lose_the_interface_for(std::chrono::nanoseconds duration) {
    bus->fail_next_read();
    device->wait(kCycle);
    device->receive();
    ASSERT_EQ(device->status().state, "closed");
    time.advance(duration);
    listen();
    ASSERT_NE(device->status().state, "closed");
  }
  void cycles_with_foreign_syncs(int n) {
    for (int i = 0; i < n; ++i) {
      if (i % 10 == 0) peer.send(std::array{can::encode_sync()});
      cycle();
    }
  }
};

TEST_F(BesideAnotherProducer, SendsNothingIfItReceivesASyncBeforeItsFirst) {
  cycles_with_foreign_syncs(5000);
  EXPECT_EQ(peer.frames_received(), 0u);
  EXPECT_EQ(device->status().state, "foreign SYNC");
  EXPECT_FALSE(device->status().connected);
  EXPECT_EQ(device->status().faults, 1u);
  EXPECT_THAT(device->status().last_fault, AllOf(HasSubstr("another SYNC producer"),
                                                 HasSubstr("10.000 ms"), HasSubstr("external")));
}

TEST_F(BesideAnotherProducer, StopsWhenItReceivesASyncLater) {
  begin_streaming();
  cycles_with_foreign_syncs(100);
  peer.serve(time.now());
  const auto sent = peer.frames_received();
  cycles_with_foreign_syncs(2000);
  EXPECT_EQ(peer.frames_received(), sent);
  EXPECT_EQ(device->status().state, "foreign SYNC");
}

TEST_F(BesideAnotherProducer, StreamsAgainOnceTheOtherProducerHasStopped) {
  cycles_with_foreign_syncs(100);
  turns(1000);
  time.advance(ForeignSync::kQuietFor);
  begin_streaming();
}

TEST_F(BesideAnotherProducer, SendsNothingAfterAnInterfaceWasDownForLong) {
  cycles_with_foreign_syncs(2000);
  lose_the_interface_for(10min);
  EXPECT_EQ(device->status().state, "foreign SYNC");
  cycles_with_foreign_syncs(2000);
  EXPECT_EQ(peer.frames_received(), 0u);
  EXPECT_EQ(device->status().state, "foreign SYNC");
}

TEST_F(BesideAnotherProducer, DetectsAProducerThatStartedWhileTheInterfaceWasDown) {
  begin_streaming();
  peer.serve(time.now());
  const auto sent = peer.frames_received();
  lose_the_interface_for(10min);
  EXPECT_EQ(device->status().state, "listening");
  for (int i = 0; i < 900; ++i) cycle();  // a slow one
  cycles_with_foreign_syncs(3000);
  EXPECT_EQ(peer.frames_received(), sent);
  EXPECT_EQ(device->status().state, "foreign SYNC");
  EXPECT_THAT(device->status().last_fault, HasSubstr("another SYNC producer"));
}

TEST_F(BesideAnotherProducer, ListensShortlyAfterAShortBreakAndStreams) {
  begin_streaming();
  peer.serve(time.now());
  const auto sent = peer.frames_received();
  lose_the_interface_for(500ms);
  turns(static_cast<int>(ForeignSync::kListenAgainFor / kCycle) - 2);
  EXPECT_EQ(peer.frames_received(), sent);
  EXPECT_EQ(device->status().state, "listening");
  samples.clear();
  EXPECT_TRUE(
      cycles_until([&] { return !samples.empty() && samples.back().missing_mask == 0; }, 400));
}

TEST_F(BesideAnotherProducer, ListensBeforeTheFirstFrame) {
  for (auto n = ForeignSync::kListenFor / kCycle - 2; n > 0; --n) cycle();
  EXPECT_EQ(peer.frames_received(), 0u);
  EXPECT_EQ(device->status().state, "listening");
  begin_streaming();
}

}  // namespace
}  // namespace abbe::drivers
