/// Lines of a tracker from a recording, sent again.

#include "abbe/sim/recorded_lines.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <array>
#include <string>
#include <string_view>

#include "abbe/sim/replay.hpp"
#include "recording_instants.hpp"

namespace abbe::sim {
namespace {

RecordedBlock read_of(HostTime time, std::string_view text) {
  RecordedBlock block{time, false, false, {}};
  std::ranges::transform(text, std::back_inserter(block.bytes),
                         [](char c) { return static_cast<std::byte>(c); });
  return block;
}

/// A connection that breaks after 2 s, and a second one.
RecordedDevice recorded_lines() {
  RecordedDevice device{"tracker", RecordedKind::Lines, {}};
  device.blocks = {read_of(kRecorded, ""),
                   read_of(kRecorded + 300ms, "0.1 1 2 3\n0.2 1 2"),
                   read_of(kRecorded + 600ms, " 4\n"),
                   {kRecorded + 2s, true, false, {}},
                   read_of(kRecorded + 3s, ""),
                   read_of(kRecorded + 3s + 300ms, "3.1 1 2 3\n")};
  return device;
}

TEST(RecordedLines, AreRecognisedByTextWithoutARequest) {
  const auto device = recorded_lines();
  EXPECT_EQ(kind_of(device.blocks), RecordedKind::Lines);
  auto asked = device.blocks;
  asked.push_back(read_of(kRecorded + 4s, "00001 GetPosition()\r\n"));
  asked.back().to_device = true;
  EXPECT_NE(kind_of(asked), RecordedKind::Lines);
}

TEST(RecordedLines, AreSentWithTheRecordedTimingFromTheConnectionOn) {
  ReplayTimeline timeline;
  RecordedLines lines(recorded_lines(), timeline);
  EXPECT_EQ(lines.next_due(), HostTime::max());
  lines.connected(kReplayed);
  EXPECT_EQ(lines.next_due(), kReplayed + 300ms);
  lines.advance(kReplayed + 299ms);
  EXPECT_EQ(lines.take_output(), "");
  lines.advance(kReplayed + 1s);
  EXPECT_EQ(lines.take_output(), "0.1 1 2 3\n0.2 1 2 4\n");
  EXPECT_FALSE(lines.finished());
}

/// Another device of the recording sets the timeline, later than these lines begin.
TEST(RecordedLines, BeginWithALineWhereTheTimelineOfAnotherDeviceIs) {
  ReplayTimeline timeline;
  RecordedLines lines(recorded_lines(), timeline, false);
  lines.connected(kReplayed);
  EXPECT_EQ(lines.next_due(), HostTime::max());
  timeline.restart(kRecorded + 580ms, kReplayed);
  lines.advance(kReplayed);
  EXPECT_EQ(lines.take_output(), "");
  lines.advance(kReplayed + 20ms);
  EXPECT_EQ(lines.take_output(), "");  // the end of a line whose beginning was not sent
}

TEST(RecordedLines, BreakTheConnectionAsRecordedAndContinueWithTheNextOne) {
  ReplayTimeline timeline;
  RecordedLines lines(recorded_lines(), timeline);
  lines.connected(kReplayed);
  lines.advance(kReplayed + 2s);
  EXPECT_TRUE(lines.take_hang_up());
  lines.disconnected();
  lines.connected(kReplayed + 4s);
  lines.advance(kReplayed + 5s);
  EXPECT_EQ(lines.take_output(), "3.1 1 2 3\n");
  EXPECT_TRUE(lines.finished());
}

TEST(RecordedLines, AreServedOnAPort) {
  const auto replay = Replay::open({recorded_lines()}, {}, kReplayed);
  ASSERT_TRUE(replay) << replay.error().text;
  const auto place = (*replay)->places().at(0);
  EXPECT_EQ(place.kind, RecordedKind::Lines);
  EXPECT_NE(place.port, 0);
}

}  // namespace
}  // namespace abbe::sim
