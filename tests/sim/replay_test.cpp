/// Replay of a recording on the wire: requests get the recorded answers, everything else is sent
/// with its recorded timing.

#include <gmock/gmock.h>

#include "abbe/protocol/can/canopen.hpp"
#include "abbe/protocol/can/udp_framing.hpp"
#include "abbe/protocol/mcap/writer.hpp"
#include "abbe/protocol/raw_bytes_cdr.hpp"
#include "abbe/sim/controller_server.hpp"
#include "abbe/sim/recorded_bus.hpp"
#include "abbe/sim/recorded_tracker.hpp"
#include "loopback_client.hpp"
#include "recording_instants.hpp"
#include "tracker_script.hpp"

namespace abbe::sim {
namespace {

using namespace std::chrono_literals;
namespace mcap = protocol::mcap;

template <class Packet>
std::vector<std::byte> packed(const Packet& packet) {
  std::vector<std::byte> bytes(emscon::kMaxPacketSize);
  bytes.resize(emscon::encode(packet, std::span(bytes)));
  return bytes;
}

std::vector<std::byte> datagram(std::span<const can::CanFrame> frames) {
  std::vector<std::byte> bytes(1400);
  can::DatagramWriter writer(bytes, 0);
  for (const can::CanFrame& frame : frames) EXPECT_TRUE(writer.add(frame));
  bytes.resize(writer.finish().size());
  return bytes;
}

RecordedDevice recorded_tracker() {
  const auto ok = [](emscon::Command c) {
    return packed(emscon::Answer{emscon::Acknowledge{c, emscon::Status::Ok}});
  };

  RecordedDevice device{"tracker", RecordedKind::Tracker, {}};
  emscon::SystemStatusAnswer status;
  status.serial_number = 4711;
  device.blocks = {
      {kRecorded, false, false, packed(emscon::Answer{status})},
      {kRecorded + 10ms, false, false, ok(emscon::Command::Initialize)},
      {kRecorded + 2s, true, false, packed(emscon::Request{emscon::StartMeasurement{}})},
      {kRecorded + 2s, false, false, ok(emscon::Command::StartMeasurement)},
      {kRecorded + 3s, false, false,
       packed(emscon::StatusChange{emscon::Event::MeasurementNotReady})},
      {kRecorded + 4s, false, false,
       packed(emscon::StatusChange{emscon::Event::MeasurementReady})}};

  return device;
}

RecordedDevice recorded_encoders() {
  RecordedDevice device{"encoders", RecordedKind::Encoders, {}};
  const can::CanFrame beat = can::encode_heartbeat(1, can::NodeState::Operational);
  const can::CanFrame sync = can::encode_sync();
  const can::CanFrame ask = can::standard_frame(0x601, {0x40, 0, 0x10, 0, 0, 0, 0, 0});
  const can::CanFrame response = can::standard_frame(0x581, {0x43, 0, 0x10, 0, 0x96, 0x01, 8, 0});

  const auto add = [&](HostTime t, bool to_device, const can::CanFrame& frame) {
    device.blocks.push_back({t, to_device, false, datagram(std::span(&frame, 1))});
  };

  add(kRecorded, true, ask);
  add(kRecorded + 1ms, false, response);
  add(kRecorded + 2ms, false, beat);

  for (int n = 0; n < 100; ++n) {
    add(kRecorded + 2s + n * 1ms, true, sync);
    add(kRecorded + 2s + n * 1ms + 100us, false,
        can::encode_position(0x181, can::PositionType::Signed32, 1000 + n));
  }

  add(kRecorded + 2s + 50ms, false, can::encode_emergency({1, 0x5000, 1, {}}));
  return device;
}

std::vector<std::byte> mcap_file(const std::vector<RecordedDevice>& devices) {
  mcap::ChunkBuilder chunk(1 << 20);
  chunk.add(mcap::Channel{7, 0, "abbe/v1/RawBytes", "cdr", {}});
  std::uint32_t sequence = 0;
  std::vector<std::byte> payload(protocol::kMaxRawBytesCdrSize);

  for (const RecordedDevice& device : devices) {
    for (const RecordedBlock& block : device.blocks) {
      protocol::RawBytes raw;
      raw.device = device.name;
      raw.time = block.time;
      raw.direction = block.to_device ? protocol::RawBlock::Direction::ToDevice
                                      : protocol::RawBlock::Direction::FromDevice;
      raw.bytes = block.bytes;
      const std::size_t size = protocol::encode_cdr(raw, payload).value();
      chunk.add(mcap::Message{7, sequence++, 0, 0, std::span(payload).first(size)});
    }
  }

  mcap::Buffer file;
  mcap::append_magic(file);
  mcap::append(file, mcap::Header{});
  const auto bytes = chunk.close().bytes;
  file.insert(file.end(), bytes.begin(), bytes.end());

  return file;
}

TEST(RecordedTraffic, FindsTheDevicesOfARecording) {
  const auto devices = read_traffic(mcap_file({recorded_tracker(), recorded_encoders()}), "r.mcap");
  ASSERT_TRUE(devices) << devices.error().text;
  ASSERT_EQ(devices->size(), 2u);
  EXPECT_EQ((*devices)[0].name, "encoders");
  EXPECT_EQ((*devices)[0].kind, RecordedKind::Encoders);
  EXPECT_EQ((*devices)[1].kind, RecordedKind::Tracker);
  EXPECT_EQ((*devices)[1].blocks.size(), recorded_tracker().blocks.size());
  EXPECT_EQ((*devices)[1].blocks[2].time, kRecorded + 2s);
  EXPECT_TRUE((*devices)[1].blocks[2].to_device);
}

/// A recorder empties one ring after the other, so that the order in the file may differ.
TEST(RecordedTraffic, IsInTheOrderOfTheWireForAnyOrderInTheFile) {
  RecordedDevice device = recorded_tracker();
  std::swap(device.blocks[2], device.blocks[1]);
  const auto read = read_traffic(mcap_file({device}), "file").value();
  EXPECT_TRUE(std::ranges::is_sorted(read.at(0).blocks, {}, &RecordedBlock::time));
}

TEST(RecordedTraffic, RefusesAFileThatIsNotARecording) {
  EXPECT_FALSE(read_traffic(std::as_bytes(std::span("PK zip")), "r.mcap"));
  EXPECT_FALSE(read_traffic(mcap_file({}), "r.mcap"));
}

TEST(RecordedTraffic, ReadsTheCompletePartOfAFileCutAnywhere) {
  const auto file = mcap_file({recorded_tracker()});
  for (std::size_t size = 0; size < file.size(); size += 7) {
    const auto devices = read_traffic(std::span(file).first(size), "r.mcap");
    if (!devices) continue;
    EXPECT_LE((*devices)[0].blocks.size(), recorded_tracker().blocks.size());
  }
}

std::vector<std::byte> reply(RecordedTracker& tracker, const emscon::Request& request,
                             HostTime now) {
  tracker.receive(packed(request), now);
  return tracker.take_output();
}

TEST(RecordedTracker, GivesTheRecordedAnswers) {
  ReplayTimeline timeline;
  RecordedTracker tracker(recorded_tracker(), timeline);
  tracker.connected(kReplayed);
  for (int i = 0; i < 2; ++i) {  // also more often than recorded
    const auto answer = emscon::decode_answer(reply(tracker, emscon::GetSystemStatus{}, kReplayed));
    EXPECT_EQ(std::get<emscon::SystemStatusAnswer>(answer.value()).serial_number, 4711);
  }
}

TEST(RecordedTracker, AnswersAnUnrecordedCommandWithNotImplemented) {
  ReplayTimeline timeline;
  RecordedTracker tracker(recorded_tracker(), timeline);
  tracker.connected(kReplayed);
  const auto answer = emscon::decode_answer(reply(tracker, emscon::GetUnits{}, kReplayed));
  EXPECT_EQ(status_of(answer.value()), emscon::Status::NotImplemented);
}

TEST(RecordedTracker, SendsPacketsWithTheRecordedTimingFromTheStartOfMeasuring) {
  ReplayTimeline timeline;
  RecordedTracker tracker(recorded_tracker(), timeline);
  tracker.connected(kReplayed);

  EXPECT_EQ(tracker.next_due(), HostTime::max());
  reply(tracker, emscon::StartMeasurement{}, kReplayed);
  EXPECT_EQ(tracker.next_due(), kReplayed + 1s);
  tracker.advance(kReplayed + 999ms);
  EXPECT_TRUE(tracker.take_output().empty());
  tracker.advance(kReplayed + 1s);
  EXPECT_EQ(tracker.take_output(),
            packed(emscon::StatusChange{emscon::Event::MeasurementNotReady}));
  EXPECT_FALSE(tracker.finished());
  tracker.advance(kReplayed + 2s);
  EXPECT_TRUE(tracker.finished());
}

TEST(RecordedTracker, BeginsAgainForTheNextClient) {
  ReplayTimeline timeline;
  RecordedTracker tracker(recorded_tracker(), timeline);
  tracker.connected(kReplayed);
  reply(tracker, emscon::StartMeasurement{}, kReplayed);
  tracker.advance(kReplayed + 10s);
  tracker.disconnected();
  tracker.connected(kReplayed + 20s);
  reply(tracker, emscon::StartMeasurement{}, kReplayed + 30s);
  EXPECT_EQ(tracker.next_due(), kReplayed + 31s);
}

TEST(RecordedTracker, AnswersAfterTheRecordedTime) {
  ReplayTimeline timeline;
  RecordedDevice device = recorded_tracker();
  device.blocks[2].time -= 500ms;
  RecordedTracker tracker(device, timeline);
  tracker.connected(kReplayed);
  EXPECT_TRUE(reply(tracker, emscon::StartMeasurement{}, kReplayed).empty());
  EXPECT_EQ(tracker.next_due(), kReplayed + 500ms);
  tracker.advance(kReplayed + 500ms);
  EXPECT_FALSE(tracker.take_output().empty());
  EXPECT_EQ(tracker.next_due(), kReplayed + 1500ms);
}

TEST(RecordedTracker, DoesNotAnswerWhereTheRecordingHasNoAnswer) {
  ReplayTimeline timeline;
  RecordedDevice device = recorded_tracker();
  device.blocks.erase(device.blocks.begin() + 3);
  RecordedTracker tracker(device, timeline);
  tracker.connected(kReplayed);
  EXPECT_TRUE(reply(tracker, emscon::StartMeasurement{}, kReplayed).empty());
}

TEST(RecordedTracker, BreaksTheConnectionAsRecordedAndContinuesWithTheNext) {
  ReplayTimeline timeline;
  RecordedDevice device = recorded_tracker();
  device.blocks[5] = {kRecorded + 4s, true, false, {}};
  device.blocks.push_back({kRecorded + 6s, false, false, {}});
  emscon::SystemStatusAnswer status;
  status.serial_number = 4712;
  device.blocks.push_back({kRecorded + 6s, false, false, packed(emscon::Answer{status})});
  RecordedTracker tracker(device, timeline);
  tracker.connected(kReplayed);
  reply(tracker, emscon::StartMeasurement{}, kReplayed);
  tracker.advance(kReplayed + 1900ms);

  EXPECT_FALSE(tracker.wants_close());
  tracker.advance(kReplayed + 2s);
  EXPECT_TRUE(tracker.wants_close());
  tracker.disconnected();
  tracker.connected(kReplayed + 3s);
  const auto answer =
      emscon::decode_answer(reply(tracker, emscon::GetSystemStatus{}, kReplayed + 3s));
  EXPECT_EQ(std::get<emscon::SystemStatusAnswer>(answer.value()).serial_number, 4712);
}

TEST(RecordedTracker, KeepsUnsolicitedPacketsUntilAClientConnects) {
  ReplayTimeline timeline;
  RecordedDevice device = recorded_tracker();
  device.blocks.insert(
      device.blocks.begin(),
      {{kRecorded, false, false, {}},
       {kRecorded + 1ms, false, false, packed(emscon::StatusChange{emscon::Event::ServerStarted})},
       {kRecorded + 2ms, false, false, {}}});
  RecordedTracker tracker(device, timeline);
  tracker.connected(kReplayed);
  tracker.disconnected();
  tracker.advance(kReplayed + 1s);

  EXPECT_TRUE(tracker.take_output().empty());
  tracker.connected(kReplayed + 2s);
  reply(tracker, emscon::StartMeasurement{}, kReplayed + 2s);
  tracker.advance(kReplayed + 3s);
  EXPECT_EQ(tracker.take_output(),
            packed(emscon::StatusChange{emscon::Event::MeasurementNotReady}));
}

TEST(RecordedTracker, SendsBytesThatAreNotAPacketUnchanged) {
  ReplayTimeline timeline;
  RecordedDevice device = recorded_tracker();
  const std::vector<std::byte> malformed(16, std::byte{0xFF});
  device.blocks[4].bytes = malformed;
  RecordedTracker tracker(device, timeline);
  tracker.connected(kReplayed);
  reply(tracker, emscon::StartMeasurement{}, kReplayed);
  tracker.advance(kReplayed + 1s);
  EXPECT_EQ(tracker.take_output(), malformed);
}

class RecordedBusTest : public testing::Test {
 protected:
  std::vector<can::CanFrame> send_and_collect(const can::CanFrame& frame, HostTime now) {
    test::send_bytes(peer_, datagram(std::span(&frame, 1)));
    test::readable(bus_.fd());
    bus_.poll(now);
    std::vector<can::CanFrame> frames;
    while (test::readable(peer_.get(), 0)) {
      const auto bytes = test::receive_bytes(peer_);
      auto view = can::DatagramView::parse(bytes);
      for (can::CanFrame f; view && view->next(f);) frames.push_back(f);
    }
    return frames;
  }

  std::optional<std::int64_t> position(HostTime now) {
    for (const can::CanFrame& frame : send_and_collect(can::encode_sync(), now)) {
      if (frame.id == 0x181)
        return can::decode_position(frame.payload(), can::PositionType::Signed32);
    }
    return std::nullopt;
  }

  ReplayTimeline timeline_;
  RecordedBus bus_ = RecordedBus::open({}, recorded_encoders(), timeline_, false).value();
  Socket peer_ = test::connected(SOCK_DGRAM, bus_.port());
};

TEST_F(RecordedBusTest, AnswersSdoRequestsAsRecorded) {
  const auto frames =
      send_and_collect(can::standard_frame(0x601, {0x40, 0, 0x10, 0, 0, 0, 0, 0}), kReplayed);
  ASSERT_FALSE(frames.empty());
  EXPECT_EQ(frames[0], can::standard_frame(0x581, {0x43, 0, 0x10, 0, 0x96, 0x01, 8, 0}));
  const auto unknown =
      send_and_collect(can::standard_frame(0x601, {0x40, 1, 0x20, 0, 0, 0, 0, 0}), kReplayed + 1ms);
  ASSERT_FALSE(unknown.empty());
  EXPECT_EQ(unknown[0].byte(0), 0x80);
}

TEST_F(RecordedBusTest, ReportsTheFirstPositionUntilTheReplayStarts) {
  EXPECT_EQ(position(kReplayed), 1000);
  EXPECT_EQ(position(kReplayed + 1ms), 1000);
}

TEST_F(RecordedBusTest, AnswersEverySyncWithTheNextCycleDespiteJitter) {
  timeline_.start(kRecorded + 2s, kReplayed);
  EXPECT_EQ(position(kReplayed + 10ms + 200us), 1010);
  EXPECT_EQ(position(kReplayed + 10ms + 900us), 1011);
  EXPECT_EQ(position(kReplayed + 12ms + 300us), 1012);
}

TEST_F(RecordedBusTest, ContinuesAtTheRecordedTimeAfterALongPause) {
  timeline_.start(kRecorded + 2s, kReplayed);
  EXPECT_EQ(position(kReplayed), 1000);
  EXPECT_EQ(position(kReplayed + 80ms), 1080);
  EXPECT_EQ(position(kReplayed + 10s), 1099);
}

TEST_F(RecordedBusTest, SendsAnEmergencyAtItsTime) {
  timeline_.start(kRecorded + 2s, kReplayed);
  const auto before = send_and_collect(can::encode_sync(), kReplayed + 49ms);
  const auto after = send_and_collect(can::encode_sync(), kReplayed + 50ms);
  const auto emergencies = [](const std::vector<can::CanFrame>& frames) {
    return std::count_if(frames.begin(), frames.end(), [](const can::CanFrame& f) {
      return can::decode_emergency(f).has_value();
    });
  };
  EXPECT_EQ(emergencies(before), 0);
  EXPECT_EQ(emergencies(after), 1);
}

TEST_F(RecordedBusTest, AnswersWithTheRecordedDelay) {
  RecordedDevice device = recorded_encoders();
  for (auto& block : device.blocks)
    if (block.time > kRecorded + 2s + 50ms && !block.to_device) block.time += 20ms;
  ReplayTimeline timeline;
  RecordedBus late = RecordedBus::open({}, device, timeline, true).value();
  const Socket peer = test::connected(SOCK_DGRAM, late.port());

  const auto sync_at = [&](HostTime now) {
    const can::CanFrame sync = can::encode_sync();
    test::send_bytes(peer, datagram(std::span(&sync, 1)));
    test::readable(late.fd());
    late.poll(now);
  };

  sync_at(kReplayed);
  sync_at(kReplayed + 60ms);
  late.poll(kReplayed + 60ms);  // heartbeats are also due
  EXPECT_EQ(late.next_due(), kReplayed + 60ms + 20ms + 100us);
}

TEST_F(RecordedBusTest, DoesNotAnswerWhereTheNodeDidNot) {
  RecordedDevice device = recorded_encoders();
  const can::CanFrame ask = can::standard_frame(0x601, {0x40, 0, 0x10, 0, 0, 0, 0, 0});
  device.blocks.push_back({kRecorded + 3s, true, false, datagram(std::span(&ask, 1))});
  device.blocks.push_back({kRecorded + 4s, true, false, datagram(std::span(&ask, 1))});
  ReplayTimeline timeline;
  RecordedBus bus = RecordedBus::open({}, device, timeline, true).value();
  const Socket peer = test::connected(SOCK_DGRAM, bus.port());
  std::vector<bool> answered;

  for (int i = 0; i < 2; ++i) {
    test::send_bytes(peer, datagram(std::span(&ask, 1)));
    test::readable(bus.fd());
    bus.poll(kReplayed);
    bool has_response = false;
    while (test::readable(peer.get(), 0)) {
      const auto bytes = test::receive_bytes(peer);
      auto view = can::DatagramView::parse(bytes);
      for (can::CanFrame f; view && view->next(f);) has_response = has_response || f.id == 0x581;
    }
    answered.push_back(has_response);
  }

  EXPECT_EQ(answered, (std::vector<bool>{true, false}));
}

// sync = "external": the daemon sends nothing to the nodes, neither in the recording nor now.
TEST_F(RecordedBusTest, SendsAForeignSyncAndItsAnswersWithoutARequest) {
  RecordedDevice device;
  const auto came = [&device](HostTime time, const can::CanFrame& frame) {
    device.blocks.push_back(
        {.time = time, .to_device = false, .bytes = datagram(std::span(&frame, 1))});
  };

  for (int cycle = 0; cycle < 3; ++cycle) {
    came(kRecorded + 4ms * cycle, can::encode_sync());
    came(kRecorded + 4ms * cycle + 1ms,
         can::encode_position(0x181, can::PositionType::Signed32, 500 + cycle));
  }

  ReplayTimeline timeline;
  RecordedBus bus = RecordedBus::open({}, device, timeline, true).value();
  EXPECT_EQ(bus.syncs(), 3u);
  const Socket peer = test::connected(SOCK_DGRAM, bus.port());
  const can::CanFrame hello = can::encode_heartbeat(9, can::NodeState::Operational);
  test::send_bytes(peer, datagram(std::span(&hello, 1)));  // the bus learns the address of its peer
  test::readable(bus.fd());
  std::vector<std::int64_t> positions;
  std::size_t syncs = 0;

  for (auto now = kReplayed; now < kReplayed + 20ms; now += 1ms) {
    bus.poll(now);
    while (test::readable(peer.get(), 0)) {
      const auto bytes = test::receive_bytes(peer);
      auto view = can::DatagramView::parse(bytes);
      for (can::CanFrame f; view && view->next(f);) {
        if (can::decode_sync(f)) ++syncs;
        if (f.id == 0x181)
          positions.push_back(*can::decode_position(f.payload(), can::PositionType::Signed32));
      }
    }
  }

  EXPECT_EQ(syncs, 3u);
  EXPECT_EQ(positions, (std::vector<std::int64_t>{500, 501, 502}));
  EXPECT_TRUE(bus.finished());
}

TEST_F(RecordedBusTest, WithoutATrackerTheFirstSyncStartsTheReplay) {
  ReplayTimeline timeline;
  RecordedBus alone = RecordedBus::open({}, recorded_encoders(), timeline, true).value();
  const Socket peer = test::connected(SOCK_DGRAM, alone.port());
  const can::CanFrame sync = can::encode_sync();
  test::send_bytes(peer, datagram(std::span(&sync, 1)));
  test::readable(alone.fd());
  alone.poll(kReplayed);
  EXPECT_EQ(timeline.due(kRecorded + 2s), kReplayed);
}

}  // namespace
}  // namespace abbe::sim
