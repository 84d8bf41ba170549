#pragma once
/// The faults that every driver must handle, as one test suite: mute, late, torn, garbage,
/// unplugged, reconnected, flooding, slow consumer, restarted peer, clock jump. In every test
/// receive() allocates nothing, no invalid sample is marked valid, and every loss is counted.
///
/// A driver's test supplies a FaultyPeer: the driver, a peer that talks to it over a real socket in
/// the same thread, and a SteppedTime they share. Nothing sleeps: one cycle is peer, wait(),
/// receive(), then time advances by kCycle.
///
///   struct MyPeer { ... };  // models FaultyPeer
///   INSTANTIATE_TYPED_TEST_SUITE_P(My, DriverConformance, MyPeer);
///
/// `static std::set<std::string_view> shown(Fault)` returns the states of which the device must
/// report one during the fault (for a fault without an effect on the state: the normal states). The
/// counters are the same for every driver: see the names of the tests.
///
/// A peer whose device has its own clock also has jump_clock(): the clock jumps ahead by a second
/// or more.
///
/// A TCP peer that simulates unplugging keeps its port with a second socket bound to it
/// (SO_REUSEPORT, not listening).

#include <gtest/gtest.h>

#include <chrono>
#include <concepts>
#include <cstdint>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "abbe/drivers/device.hpp"
#include "abbe/drivers/time_source.hpp"
#include "abbe/protocol/samples.hpp"
#include "allocation_count.hpp"
#include "stepped_time.hpp"

namespace abbe::tests {

enum class Fault { None, Mute, Garbage, Unplugged, Restart };

/// The states of a session over TCP; `well`: the state without a fault.
inline std::set<std::string_view> shown_over_tcp(Fault fault, std::string_view well) {
  switch (fault) {
    case Fault::None:
      return {well};
    case Fault::Mute:
    case Fault::Garbage:
      return {"faulted"};
    case Fault::Unplugged:
    case Fault::Restart:
      return {"disconnected"};
  }
  return {};
}

/// The interface that a driver's test implements. All calls come from one thread and return at
/// once. After default construction the peer runs without a fault; the device exists and has had no
/// cycle yet.
template <class P>
concept FaultyPeer = requires(P p, std::vector<protocol::SampleHead>& heads) {
  { p.device() } -> std::same_as<drivers::Device&>;
  { p.time() } -> std::same_as<SteppedTime&>;
  /// Takes all samples from the device's sample ring (from all rings, if several carry the
  /// measurement).
  p.take_samples(heads);
  /// Accepts connections, answers commands; called once per cycle while the peer runs.
  p.serve();
  /// Sends one packet (burst, cycle) of valid samples that end about now. Called once per cycle
  /// while the peer sends; may send nothing in a cycle if the device is not streaming yet or the
  /// packet is not due.
  p.send_valid();
  /// The same with a tolerated delay: one packet is held back and sent later.
  p.hold_back();  ///< from now on send_valid() keeps its packet in the peer ...
  p.send_held();  ///< ... until this call sends it
  /// Sends the first half of a valid packet; then the rest, if the transport can deliver it
  /// (kTornCanBeFinished).
  p.send_torn();
  p.finish_torn();
  /// Sends bytes that are not a packet of the protocol.
  p.send_garbage();
  /// Unplugs the cable: connections are lost and refused. plug_in() connects it again.
  p.unplug();
  p.plug_in();
  /// Sends more valid samples at once than the sample ring can hold.
  p.flood();
  /// Power off and on: connections are lost, the device's clock and counters start again.
  p.restart();

  /// host time of one cycle
  { P::kCycle } -> std::convertible_to<std::chrono::nanoseconds>;
  /// silence of this duration is a fault
  { P::kSilenceLimit } -> std::convertible_to<std::chrono::nanoseconds>;
  /// longest time from the end of a fault to the first sample
  { P::kRecoveryLimit } -> std::convertible_to<std::chrono::nanoseconds>;
  /// true: a byte stream; false: datagrams or frames
  { P::kTornCanBeFinished } -> std::convertible_to<bool>;
};

/// A sample with one of these flags is not valid.
inline constexpr protocol::SampleFlags kNotToBeUsed =
    protocol::SampleFlag::AxisMissing | protocol::SampleFlag::BusOff |
    protocol::SampleFlag::DeviceError | protocol::SampleFlag::SpeedExceeded |
    protocol::SampleFlag::PointInvalid;
/// The first sample after an interruption has at least one of these flags.
inline constexpr protocol::SampleFlags kInterrupted = protocol::SampleFlag::GapBefore |
                                                      protocol::SampleFlag::Restarted |
                                                      protocol::SampleFlag::BeamReturned;

template <FaultyPeer Peer>
class DriverConformance : public testing::Test {
 protected:
  using Heads = std::vector<protocol::SampleHead>;

  drivers::DeviceStatus status() { return peer_.device().status(); }

  /// Runs one cycle; returns the heads of its samples.
  Heads cycle() {
    if (up_) peer_.serve();
    if (up_ && speaking_) peer_.send_valid();
    peer_.device().wait(Peer::kCycle);
    const AllocationCount allocations;
    peer_.device().receive();
    allocated_in_receive_ += allocations.value();
    peer_.time().advance(Peer::kCycle);
    Heads heads;
    if (reading_) peer_.take_samples(heads);
    taken_ += heads.size();
    return heads;
  }

  Heads cycles_for(std::chrono::nanoseconds duration) {
    Heads all;
    for (const auto end = peer_.time().now() + duration; peer_.time().now() < end;)
      append(cycle(), all);
    return all;
  }

  /// Runs cycles until `done()`; returns false after `limit` of host time. The samples are in
  /// `seen_`.
  template <class Done>
  bool cycles_until(std::chrono::nanoseconds limit, Done done) {
    seen_.clear();
    for (const auto end = peer_.time().now() + limit; !done();) {
      if (peer_.time().now() >= end) return false;
      append(cycle(), seen_);
    }
    return true;
  }

  static bool usable(const protocol::SampleHead& head) { return (head.flags & kNotToBeUsed) == 0; }
  static std::size_t usable_in(const Heads& heads) {
    std::size_t n = 0;
    for (const auto& head : heads) n += usable(head) ? 1 : 0;
    return n;
  }

  bool usable_samples_come(std::chrono::nanoseconds limit) {
    return cycles_until(limit, [this] { return usable_in(seen_) != 0; });
  }
  /// Starts the device until it streams; the precondition of every test.
  void begin_streaming() {
    ASSERT_TRUE(usable_samples_come(Peer::kRecoveryLimit))
        << "never streamed; last fault: " << status().last_fault;
    cycles_for(10 * Peer::kCycle);
    before_ = status();
  }

  void TearDown() override {
    EXPECT_EQ(allocated_in_receive_, 0u) << "receive() allocated memory";
    const auto s = status();
    EXPECT_EQ(s.samples, taken_ + s.dropped)
        << "a decoded sample must be taken or counted as dropped";
  }

  /// The device reports a state required for the fault, within twice the silence limit.
  bool shows(Fault fault) {
    if constexpr (requires { Peer::shown(fault); }) {
      const auto states = Peer::shown(fault);
      return cycles_until(2 * Peer::kSilenceLimit,
                          [&] { return states.count(status().state) != 0; });
    } else {
      return true;  // peers of the guest: the states are tested here, once
    }
  }

  Peer peer_;
  bool up_ = true;  ///< the peer is served: its process runs
  bool speaking_ = true;
  bool reading_ = true;  ///< the test takes the samples
  Heads seen_;
  drivers::DeviceStatus before_;  ///< at the end of begin_streaming()

 private:
  static void append(const Heads& from, Heads& to) {
    to.insert(to.end(), from.begin(), from.end());
  }
  std::uint64_t allocated_in_receive_ = 0;
  std::uint64_t taken_ = 0;
};

TYPED_TEST_SUITE_P(DriverConformance);

TYPED_TEST_P(DriverConformance, StreamsTheSamplesOfThePeer) {
  this->begin_streaming();
  const auto heads = this->cycles_for(20 * TypeParam::kCycle);
  EXPECT_GT(this->usable_in(heads), 0u);
  EXPECT_TRUE(this->status().connected);
  EXPECT_EQ(this->status().faults, this->before_.faults);
}

TYPED_TEST_P(DriverConformance, TimestampsAreNotInTheFuture) {
  this->begin_streaming();
  for (int i = 0; i < 20; ++i) {
    const auto before_cycle = this->peer_.time().now();
    for (const auto& head : this->cycle()) EXPECT_LE(head.time, before_cycle + 3 * head.u_time);
  }
}

TYPED_TEST_P(DriverConformance, DetectsAMutePeer) {
  this->begin_streaming();
  this->speaking_ = false;
  const auto noticed = [this] { return this->status().faults > this->before_.faults; };
  EXPECT_TRUE(this->cycles_until(2 * TypeParam::kSilenceLimit, noticed));
  EXPECT_NE(this->status().last_fault, "");
}

TYPED_TEST_P(DriverConformance, HasNoValidSampleWhileThePeerIsMute) {
  this->begin_streaming();
  this->speaking_ = false;
  this->cycles_for(2 * TypeParam::kCycle);  // packets in transit arrive
  EXPECT_EQ(this->usable_in(this->cycles_for(2 * TypeParam::kSilenceLimit)), 0u);
}

TYPED_TEST_P(DriverConformance, StreamsAgainWhenAMutePeerSendsAgain) {
  this->begin_streaming();
  this->speaking_ = false;
  this->cycles_for(2 * TypeParam::kSilenceLimit);
  this->speaking_ = true;
  EXPECT_TRUE(this->usable_samples_come(TypeParam::kRecoveryLimit)) << this->status().last_fault;
}

TYPED_TEST_P(DriverConformance, ToleratesALatePacket) {
  this->begin_streaming();
  this->peer_.hold_back();
  this->cycles_for(TypeParam::kSilenceLimit / 2);
  this->peer_.send_held();
  EXPECT_TRUE(this->usable_samples_come(TypeParam::kSilenceLimit));
  EXPECT_TRUE(this->status().connected);
}

TYPED_TEST_P(DriverConformance, WaitsForTheRestOfATornPacket) {
  if (!TypeParam::kTornCanBeFinished) GTEST_SKIP() << "the rest of a datagram is never delivered";
  this->begin_streaming();
  this->speaking_ = false;
  this->cycles_for(2 * TypeParam::kCycle);
  this->peer_.send_torn();
  EXPECT_EQ(this->cycles_for(3 * TypeParam::kCycle).size(), 0u);
  this->peer_.finish_torn();
  EXPECT_TRUE(this->usable_samples_come(3 * TypeParam::kCycle));
  EXPECT_EQ(this->status().faults, this->before_.faults);
}

TYPED_TEST_P(DriverConformance, CountsATornDatagramAndContinues) {
  if (TypeParam::kTornCanBeFinished) GTEST_SKIP() << "a byte stream may deliver the rest";
  this->begin_streaming();
  this->peer_.send_torn();
  const auto counted = [this] { return this->status().faults > this->before_.faults; };
  EXPECT_TRUE(this->cycles_until(TypeParam::kSilenceLimit, counted));
  EXPECT_TRUE(this->usable_samples_come(TypeParam::kRecoveryLimit));
}

TYPED_TEST_P(DriverConformance, CountsGarbageWithoutAValidSample) {
  this->begin_streaming();
  this->speaking_ = false;
  this->cycles_for(2 * TypeParam::kCycle);
  this->peer_.send_garbage();
  EXPECT_EQ(this->usable_in(this->cycles_for(5 * TypeParam::kCycle)), 0u);
  EXPECT_GT(this->status().faults, this->before_.faults);
  EXPECT_NE(this->status().last_fault, "");
}

TYPED_TEST_P(DriverConformance, StreamsAgainAfterGarbage) {
  this->begin_streaming();
  this->peer_.send_garbage();
  this->cycles_for(5 * TypeParam::kCycle);
  EXPECT_TRUE(this->usable_samples_come(TypeParam::kRecoveryLimit)) << this->status().last_fault;
}

TYPED_TEST_P(DriverConformance, DetectsThatItIsUnplugged) {
  this->begin_streaming();
  this->peer_.unplug();
  this->up_ = false;
  EXPECT_TRUE(this->cycles_until(2 * TypeParam::kSilenceLimit, [this] {
    return !this->status().connected && this->status().faults > this->before_.faults;
  }));
  EXPECT_EQ(this->usable_in(this->cycles_for(TypeParam::kSilenceLimit)), 0u);
}

TYPED_TEST_P(DriverConformance, StreamsAndMarksTheGapWhenPluggedInAgain) {
  this->begin_streaming();
  this->peer_.unplug();
  this->up_ = false;
  this->cycles_for(2 * TypeParam::kSilenceLimit);
  this->peer_.plug_in();
  this->up_ = true;
  ASSERT_TRUE(this->usable_samples_come(TypeParam::kRecoveryLimit)) << this->status().last_fault;
  EXPECT_TRUE(this->status().connected);
  protocol::SampleFlags flags = 0;  // of everything up to the first usable sample

  for (const auto& head : this->seen_) {
    flags |= head.flags;
    if (this->usable(head)) break;
  }

  EXPECT_NE(flags & kInterrupted, 0u);
}

TYPED_TEST_P(DriverConformance, StartsWhenThePeerStartsLater) {
  this->peer_.unplug();
  this->up_ = false;
  this->cycles_for(2 * TypeParam::kSilenceLimit);
  EXPECT_FALSE(this->status().connected);
  this->peer_.plug_in();
  this->up_ = true;
  EXPECT_TRUE(this->usable_samples_come(TypeParam::kRecoveryLimit)) << this->status().last_fault;
}

TYPED_TEST_P(DriverConformance, DropsCountsAndMarksWhenFlooded) {
  this->begin_streaming();
  this->peer_.flood();
  const auto dropped = [this] { return this->status().dropped > this->before_.dropped; };
  ASSERT_TRUE(this->cycles_until(TypeParam::kRecoveryLimit, dropped));
  const auto marked = [this] {
    for (const auto& head : this->seen_) {
      if (has(head.flags, protocol::SampleFlag::GapBefore) && head.lost_before != 0) return true;
    }
    return false;
  };
  EXPECT_TRUE(this->cycles_until(TypeParam::kRecoveryLimit, marked));
}

TYPED_TEST_P(DriverConformance, MarksSamplesMissedByASlowConsumer) {
  this->begin_streaming();
  this->reading_ = false;
  const auto dropped = [this] { return this->status().dropped > this->before_.dropped; };

  if (!this->cycles_until(4 * TypeParam::kRecoveryLimit, dropped)) {
    GTEST_SKIP() << "the device is too slow to fill its ring during a test";
  }

  this->reading_ = true;
  const auto marked = [this] {
    for (const auto& head : this->seen_) {
      if (has(head.flags, protocol::SampleFlag::GapBefore) && head.lost_before != 0) return true;
    }
    return false;
  };

  EXPECT_TRUE(this->cycles_until(TypeParam::kRecoveryLimit, marked));
  EXPECT_TRUE(this->status().connected) << "a slow reader must not affect the connection";
}

TYPED_TEST_P(DriverConformance, KeepsSampleTimesNearTheHostClockThroughAClockJump) {
  if constexpr (requires(TypeParam p) { p.jump_clock(); }) {
    this->begin_streaming();
    this->peer_.jump_clock();
    const auto marked = [this] {
      for (const auto& head : this->seen_) {
        if ((head.flags & kInterrupted) != 0) return true;
      }
      return false;
    };
    ASSERT_TRUE(this->cycles_until(TypeParam::kRecoveryLimit, marked)) << this->status().last_fault;
    ASSERT_TRUE(this->usable_samples_come(TypeParam::kRecoveryLimit)) << this->status().last_fault;
    for (const auto& head : this->seen_) {
      EXPECT_GE(head.time, this->peer_.time().now() - TypeParam::kRecoveryLimit);
      EXPECT_LE(head.time, this->peer_.time().now() + 3 * head.u_time);
    }
  } else {
    GTEST_SKIP() << "the device has no clock of its own, or the peer cannot make it jump";
  }
}

TYPED_TEST_P(DriverConformance, StreamsAndMarksTheGapAfterThePeerRestarted) {
  this->begin_streaming();
  this->peer_.restart();
  const auto marked = [this] {
    for (const auto& head : this->seen_) {
      if ((head.flags & kInterrupted) != 0) return true;
    }
    return false;
  };
  EXPECT_TRUE(this->cycles_until(TypeParam::kRecoveryLimit, marked)) << this->status().last_fault;
  EXPECT_TRUE(this->usable_samples_come(TypeParam::kRecoveryLimit)) << this->status().last_fault;
}

TYPED_TEST_P(DriverConformance, KeepsSampleTimesNearTheHostClockThroughARestart) {
  this->begin_streaming();
  this->peer_.restart();
  this->cycles_for(TypeParam::kRecoveryLimit / 2);
  ASSERT_TRUE(this->usable_samples_come(TypeParam::kRecoveryLimit)) << this->status().last_fault;
  for (const auto& head : this->seen_) {
    EXPECT_GE(head.time, this->peer_.time().now() - TypeParam::kRecoveryLimit);
    EXPECT_LE(head.time, this->peer_.time().now() + 3 * head.u_time);
  }
}

TYPED_TEST_P(DriverConformance, ShowsThatItStreams) {
  this->begin_streaming();
  EXPECT_TRUE(this->shows(Fault::None)) << this->status().state;
  EXPECT_TRUE(this->status().connected);
}

TYPED_TEST_P(DriverConformance, ShowsAMutePeerAndCountsAFault) {
  this->begin_streaming();
  this->speaking_ = false;
  EXPECT_TRUE(this->shows(Fault::Mute)) << this->status().state;
  EXPECT_TRUE(this->cycles_until(2 * TypeParam::kSilenceLimit,
                                 [this] { return this->status().faults > this->before_.faults; }));
  EXPECT_GE(this->status().last_fault_at, this->before_.last_sample);
}

TYPED_TEST_P(DriverConformance, ShowsGarbageAndCountsAFault) {
  this->begin_streaming();
  this->peer_.send_garbage();
  EXPECT_TRUE(this->shows(Fault::Garbage)) << this->status().state;
  EXPECT_TRUE(this->cycles_until(2 * TypeParam::kSilenceLimit,
                                 [this] { return this->status().faults > this->before_.faults; }));
}

TYPED_TEST_P(DriverConformance, ShowsThatItIsUnpluggedAndCountsAFault) {
  this->begin_streaming();
  this->peer_.unplug();
  this->up_ = false;
  EXPECT_TRUE(this->shows(Fault::Unplugged)) << this->status().state;
  EXPECT_TRUE(this->cycles_until(2 * TypeParam::kSilenceLimit,
                                 [this] { return !this->status().connected; }));
  EXPECT_GT(this->status().faults, this->before_.faults);
}

TYPED_TEST_P(DriverConformance, ShowsARestartedPeerAndCountsIt) {
  this->begin_streaming();
  this->peer_.restart();
  EXPECT_TRUE(this->shows(Fault::Restart)) << this->status().state;
  const auto counted = [this] {
    const auto s = this->status();
    return s.faults > this->before_.faults || s.gaps > this->before_.gaps;
  };
  EXPECT_TRUE(this->cycles_until(TypeParam::kRecoveryLimit, counted));
  EXPECT_TRUE(this->usable_samples_come(TypeParam::kRecoveryLimit)) << this->status().last_fault;
}

TYPED_TEST_P(DriverConformance, ShowsAClockJumpAndCountsIt) {
  if constexpr (requires(TypeParam p) { p.jump_clock(); }) {
    this->begin_streaming();
    this->peer_.jump_clock();
    const auto counted = [this] {
      const auto s = this->status();
      return s.clock.restarts > this->before_.clock.restarts || s.gaps > this->before_.gaps;
    };
    EXPECT_TRUE(this->cycles_until(TypeParam::kRecoveryLimit, counted));
    EXPECT_TRUE(this->status().connected);
  } else {
    GTEST_SKIP() << "the device has no clock of its own, or the peer cannot make it jump";
  }
}

REGISTER_TYPED_TEST_SUITE_P(
    DriverConformance, ShowsThatItStreams, ShowsAMutePeerAndCountsAFault,
    ShowsGarbageAndCountsAFault, ShowsThatItIsUnpluggedAndCountsAFault,
    ShowsARestartedPeerAndCountsIt, ShowsAClockJumpAndCountsIt, StreamsTheSamplesOfThePeer,
    TimestampsAreNotInTheFuture, DetectsAMutePeer, HasNoValidSampleWhileThePeerIsMute,
    StreamsAgainWhenAMutePeerSendsAgain, ToleratesALatePacket, WaitsForTheRestOfATornPacket,
    CountsATornDatagramAndContinues, CountsGarbageWithoutAValidSample, StreamsAgainAfterGarbage,
    DetectsThatItIsUnplugged, StreamsAndMarksTheGapWhenPluggedInAgain, StartsWhenThePeerStartsLater,
    DropsCountsAndMarksWhenFlooded, MarksSamplesMissedByASlowConsumer,
    KeepsSampleTimesNearTheHostClockThroughAClockJump, StreamsAndMarksTheGapAfterThePeerRestarted,
    KeepsSampleTimesNearTheHostClockThroughARestart);

}  // namespace abbe::tests
